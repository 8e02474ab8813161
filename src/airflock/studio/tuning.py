"""Tuning: sliders and menus of every parameter of the side in hand, undo, and what can be saved of it."""

import html
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from airflock.scenarios.change import LASTING
from airflock.scenarios.document import TOP
from airflock.scenarios.fault_keys import is_fault_key
from airflock.scenarios.scenario import Scenario
from airflock.scenarios.short_keys import whole_keys
from airflock.search.bounds import studied
from airflock.studio.controls import Control, controls_of, controls_of_faults
from airflock.studio.drawing import NAMES
from airflock.studio.player import Player
from airflock.studio.room import Room, note
from airflock.studio.saving import free
from airflock.studio.side import value_of
from airflock.support.errors import AirflockError, ScenarioError
from airflock.support.untrusted import from_outside, toml_value

if TYPE_CHECKING:
    from airflock.studio.page import Page

EXAMPLE = "radio.delay = 400 ms, or goals.points = [[0, 50, 0]]"
ANEW = {"agents": "“agents” under Play starts another flight", "dt": "write it into the scenario file"}


class Tuning(Room):
    """Sliders of one side."""

    def __init__(self, page: "Page", tab: Any):
        super().__init__(page)
        self.tab = tab
        self._handles: dict[str, tuple[Any, Control]] = {}
        self._folders: list[Any] = []
        self._made_for: Any = None
        self._of_faults: list[Any] = []
        self._faults: Any = None
        panel, player = self.panel, self.player
        panel.row(
            {
                "Undo": self.ask(lambda: self.put(player.side.undo())),
                "Back to preset": self.ask(lambda: self.put(player.side.to_preset())),
            }
        )
        panel.row(
            {
                "Save scenario (.toml)": self.ask(self._save_toml),
                "Save flight (.nc)": self.ask(self._save_recording),
                "Save replay (.html)": self.ask(self._save_replay),
            }
        )
        self.command = panel.text()
        self.typed = panel.field("any key", f"for instance {EXAMPLE}")
        panel.row({"Set": self.ask(self._set)})

    def rebuild(self) -> None:
        """Make the controls of the side in hand; again only where another law or side is in hand."""
        preset, two = self.player.preset, len(self.player.sides) > 1
        made_for = preset.model, preset.records.keys(), self.player.side.origin.where, self.player.hand if two else None
        if made_for != self._made_for:
            for folder in [*self._folders, *self._of_faults]:
                folder.remove()
            self._of_faults, self._faults, self._handles, self._made_for = [], None, {}, made_for
            self._folders = self._made(controls_of(preset, studied(preset)))
        self._rebuild_faults()
        self.show_values()

    def _rebuild_faults(self) -> None:
        """Make the controls of faults again where others are in force: some may have been set off by hand."""
        entries = self.player.scenario.faults
        faults = [entry.fault.name for entry in entries]
        if faults != self._faults:
            for folder in self._of_faults:
                folder.remove()
            self._handles = {key: made for key, made in self._handles.items() if not is_fault_key(key)}
            self._of_faults, self._faults = self._made(controls_of_faults(entries)), faults

    def _made(self, controls: Mapping[str, list[Control]]) -> list[Any]:
        """Folders of controls, by section."""
        folders = []
        with self.tab:
            for section, own in controls.items():
                name = f"{NAMES[self.player.hand]}: {section}" if len(self.player.sides) > 1 else section
                folder = self.panel.folder(name, section.startswith("model"))
                folders.append(folder)
                with folder:
                    for control in own:
                        self._handles[control.key] = self.panel.control(control, self._change), control
        return folders

    def show_values(self) -> None:
        """Show the values in force."""
        values = {key: value_of(self.player.scenario, key) for key in self._handles}
        self.put({key: value for key, value in values.items() if value != self._handles[key][0].value})

    def put(self, values: dict[str, Any]) -> None:
        """Show values on their controls."""
        for key, value in values.items():
            if key in self._handles:
                self._handles[key][0].value = value

    def _change(self, key: str, value: Any) -> None:
        self.player.ask(lambda: self._changed(key, value))

    def _changed(self, key: str, value: Any) -> None:
        try:
            self.player.change(key, value)
        except AirflockError:
            self.put({key: value_of(self.player.scenario, key)})
            raise

    def _set(self) -> None:
        """Set a key by its name, as --set does; also one that has no slider, or beyond the ends of its slider."""
        key, value = pair(self.typed.value, self.player.scenario)
        self.player.change(key, value)
        self.typed.value = ""
        self.show_values()

    def _save_toml(self) -> None:
        self._saved(self.player.save_toml(free(Path(f"{stem(self.player)}_tuned.toml"))))

    def _save_recording(self) -> None:
        self._saved(self.player.save_recording(free(Path(f"{stem(self.player)}_seed{self.player.seed}.nc"))))

    def _save_replay(self) -> None:
        self._saved(self.player.save_replay(free(Path(f"{stem(self.player)}_seed{self.player.seed}.html"))))

    def _saved(self, path: Path) -> None:
        self.player.note = f"saved {path.absolute()}"
        self.player.fault(self.player.note)
        self.panel.say("Saved", str(path.absolute()))

    def refresh(self) -> None:
        """The command that opens this scenario again, with a button that copies it; controls of faults that are new."""
        self._rebuild_faults()
        command = html.escape(self.player.command, quote=True)
        self.command.content = note(f"<code>{command}</code><br>{copying(command)}")


def copying(command: str) -> str:
    """A button that copies a command, which is escaped, to the clipboard; the page's own script (`door`) does it."""
    look = "border:1px solid #0072B2;border-radius:4px;background:none;color:#0072B2;cursor:pointer;margin-top:0.3em"
    return f"<button type='button' style='{look}' data-copy=\"{command}\">Copy command</button>"


def pair(text: str, scenario: Scenario) -> tuple[str, Any]:
    """Key and value of a line such as `radio.delay = 400 ms`; raises ScenarioError where there is no such key."""
    key, equals, value = (part.strip() for part in text.partition("="))
    if not (key and equals and value):
        raise ScenarioError([f"{text.strip() or 'any key'}: write KEY = VALUE, for instance model.p_rep = 0.14"])
    with from_outside(key):
        found = toml_value(value)
    if "." in key:
        return key, found
    if key in LASTING:
        raise ScenarioError([f"{key} = {value}: {LASTING[key]} cannot change in flight; {ANEW[key]}"])
    if key in TOP:
        raise ScenarioError([f"{key}: cannot be changed while a flock flies; write it into the scenario file"])
    records = {section: type(record) for section, record in scenario.records.items()}
    whole, _, faults = whole_keys({key: found}, records, ())
    if faults:
        raise ScenarioError(faults)
    return next(iter(whole.items()))


def stem(player: Player) -> str:
    """What files of the side in hand are called."""
    return Path(player.side.origin.where).with_suffix("").name
