"""Evolving: a search around what was set by hand, in the background, with its course and a way to take its best."""

import html
import math
import time
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from airflock.errors import StudioError
from airflock.studio.background import Progress, Study, around, varied
from airflock.studio.controls import fields
from airflock.studio.room import Room, note
from airflock.studio.saving import free, toml_of
from airflock.studio.tuning import stem

if TYPE_CHECKING:
    from airflock.studio.page import Page

EVERY = 2.0  # s of real time between two looks at the study


class Evolving(Room):
    """One study at a time, of the side in hand."""

    def __init__(self, page: "Page"):
        super().__init__(page)
        panel = self.panel
        self.study: Study | None = None
        self.found = Progress([], math.nan, {})
        self._looked = 0.0
        with panel.folder("Evolve from here", is_open=False):
            self.population = panel.number("population", 20, 4, 1000, lambda _: None, "candidates per generation")
            self.generations = panel.number("generations", 20, 1, 1000, lambda _: None)
            panel.row(
                {"Start": self.ask(self.start), "Stop": self.ask(self.stop), "Take the best": self.ask(self.take)}
            )
            self.said = panel.text(note("searches each number of the law from half to twice its value"))
            self.course = panel.chart("progress of the search", ("best so far", "mean"), across="generation")

    def start(self) -> None:
        """Begin a study around the present scenario. Raises StudioError where one runs or none can."""
        player, side = self.player, self.player.side
        if self.study is not None and self.study.running:
            raise StudioError("evolve: a study is running; stop it first")
        if side.origin.law is not None:
            raise StudioError(
                "evolve: a law given by --law is not named in a file; write model.kind into a scenario file"
            )
        scores = side.flight.scores()
        objective = "fitness" if "fitness" in scores else self.page.measuring.name
        text = toml_of(side.origin.where, side.settings, side.origin.document, side.preset.document)
        folder = free(Path(f"{stem(player)}_study"))
        space = around(side.scenario, varied(side.origin.where))
        self.study = Study(
            folder, text, space, objective, population=int(self.population.value),
            generations=int(self.generations.value), trust=side.origin.trust,
        )  # fmt: skip
        self.found = Progress([], math.nan, {})
        player.fault(f"evolving in {folder.absolute()}")

    def stop(self) -> None:
        """End the study; its folder stays."""
        if self.study is not None and self.study.running:
            self.study.stop()
            self.player.fault(f"stopped; airflock evolve {self.study.file} --out {self.study.folder} --resume goes on")

    def take(self) -> None:
        """Set the best parameters found so far, as one change."""
        if not self.found.parameters:
            raise StudioError("evolve: no candidate has been flown yet")
        self.player.side.change(self.found.parameters)
        self.page.tuning.put(self.found.parameters)

    def refresh(self) -> None:
        """Look at the study now and then."""
        if self.study is None or time.monotonic() - self._looked < EVERY:
            return
        self._looked = time.monotonic()
        self.found = self.study.progress()
        if self.found.generations:
            course = np.array(self.found.generations)
            self.course.data = np.arange(1.0, len(course) + 1.0), course[:, 0].copy(), course[:, 1].copy()
        self.said.content = note(self._status(self.study))

    def _status(self, study: Study) -> str:
        state = "searching" if study.running else "ended"
        if study.fault:
            return f"<span style='color:#b00020'>{html.escape(study.fault)}</span>"
        best = f"{study.objective} {self.found.best:.4g}" if self.found.parameters else "nothing flown yet"
        many = f"generation {len(self.found.generations)} of {study.generations}"
        keys = html.escape(fields(self.found.parameters))
        return f"{state}: {many}, best {best}<br><code>{keys}</code><br>in {html.escape(str(study.folder))}"
