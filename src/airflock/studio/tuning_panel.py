"""Tuning panel: sliders and menus of every parameter of the active pane, undo, and files to save."""

import html
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from airflock.scenarios import FIXED_KEYS, TOP_LEVEL_KEYS, Scenario, expand_short_keys, is_fault_key
from airflock.search import shipped_study_axes
from airflock.studio.flight_pane import ParameterControl, fault_controls, free_path, scenario_controls, scenario_value
from airflock.studio.page_panels import PagePanel, small_print_html
from airflock.studio.page_scene import PANE_NAMES
from airflock.studio.player import Player
from airflock.support import AirflockError, ScenarioError, as_error, parse_toml_value

if TYPE_CHECKING:
    from airflock.studio.flight_page import FlightPage

KEY_EXAMPLE = "radio.delay = 400 ms, or goals.points = [[0, 50, 0]]"
RESTART_HINTS = {"agents": "“agents” under Play starts another flight", "dt": "write it into the scenario file"}


class TuningPanel(PagePanel):
    """Sliders of one pane."""

    def __init__(self, page: "FlightPage", tab: Any):
        super().__init__(page)
        self.tab = tab
        self._handles: dict[str, tuple[Any, ParameterControl]] = {}
        self._folders: list[Any] = []
        self._controls_for: Any = None
        self._fault_folders: list[Any] = []
        self._fault_names: Any = None
        panel, player = self.widgets, self.player
        panel.row(
            {
                "Undo": self.ask(lambda: self.show_on_controls(player.side.undo())),
                "Back to preset": self.ask(lambda: self.show_on_controls(player.side.undo_all())),
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
        self.setting_field = panel.field("any key", f"for instance {KEY_EXAMPLE}")
        panel.row({"Set": self.ask(self._set)})

    def rebuild(self) -> None:
        """Make the controls of the active pane; again only for another law or pane."""
        preset, two = self.player.preset, len(self.player.sides) > 1
        made_for = preset.model, preset.records.keys(), self.player.side.origin.where, self.player.hand if two else None
        if made_for != self._controls_for:
            for folder in [*self._folders, *self._fault_folders]:
                folder.remove()
            self._fault_folders, self._fault_names, self._handles, self._controls_for = [], None, {}, made_for
            self._folders = self._made(scenario_controls(preset, shipped_study_axes(preset)))
        self._rebuild_faults()
        self.show_values()

    def _rebuild_faults(self) -> None:
        """Make the controls of faults again when other faults are in force: some may be begun by hand."""
        entries = self.player.scenario.faults
        faults = [entry.fault.name for entry in entries]
        if faults != self._fault_names:
            for folder in self._fault_folders:
                folder.remove()
            self._handles = {key: made for key, made in self._handles.items() if not is_fault_key(key)}
            self._fault_folders, self._fault_names = self._made(fault_controls(entries)), faults

    def _made(self, controls: Mapping[str, list[ParameterControl]]) -> list[Any]:
        """Make folders of controls, by section."""
        folders = []
        with self.tab:
            for section, own in controls.items():
                name = f"{PANE_NAMES[self.player.hand]}: {section}" if len(self.player.sides) > 1 else section
                folder = self.widgets.folder(name, section.startswith("model"))
                folders.append(folder)
                with folder:
                    for control in own:
                        self._handles[control.key] = self.widgets.add_control(control, self._ask_to_change), control
        return folders

    def show_values(self) -> None:
        """Show the values in force."""
        values = {key: scenario_value(self.player.scenario, key) for key in self._handles}
        self.show_on_controls({key: value for key, value in values.items() if value != self._handles[key][0].value})

    def show_on_controls(self, values: dict[str, Any]) -> None:
        """Show values on their controls."""
        for key, value in values.items():
            if key in self._handles:
                self._handles[key][0].value = value

    def _ask_to_change(self, key: str, value: Any) -> None:
        self.player.ask(lambda: self._changed(key, value))

    def _changed(self, key: str, value: Any) -> None:
        try:
            self.player.change(key, value)
        except AirflockError:
            self.show_on_controls({key: scenario_value(self.player.scenario, key)})
            raise

    def _set(self) -> None:
        """Set a key by its name, as --set does; also one without a slider, or beyond the ends of its slider."""
        key, value = parse_setting(self.setting_field.value, self.player.scenario)
        self.player.change(key, value)
        self.setting_field.value = ""
        self.show_values()

    def _save_toml(self) -> None:
        self._saved(self.player.save_toml(free_path(Path(f"{file_stem(self.player)}_tuned.toml"))))

    def _save_recording(self) -> None:
        self._saved(self.player.save_recording(free_path(Path(f"{file_stem(self.player)}_seed{self.player.seed}.nc"))))

    def _save_replay(self) -> None:
        self._saved(self.player.save_replay(free_path(Path(f"{file_stem(self.player)}_seed{self.player.seed}.html"))))

    def _saved(self, path: Path) -> None:
        self.player.note = f"saved {path.absolute()}"
        self.player.fault(self.player.note)
        self.widgets.notify("Saved", str(path.absolute()))

    def refresh(self) -> None:
        """Show the command that opens this scenario again, with a button that copies it, and controls of new
        faults.
        """
        self._rebuild_faults()
        command = html.escape(self.player.command, quote=True)
        self.command.content = small_print_html(f"<code>{command}</code><br>{copy_button_html(command)}")


def copy_button_html(command: str) -> str:
    """Return a button that copies a command, escaped here; the page's script (`access_token`) copies it."""
    look = "border:1px solid #0072B2;border-radius:4px;background:none;color:#0072B2;cursor:pointer;margin-top:0.3em"
    return f"<button type='button' style='{look}' data-copy=\"{command}\">Copy command</button>"


def parse_setting(text: str, scenario: Scenario) -> tuple[str, Any]:
    """Return key and value of a line such as `radio.delay = 400 ms`; raises ScenarioError for an unknown key."""
    key, equals, value = (part.strip() for part in text.partition("="))
    if not (key and equals and value):
        raise ScenarioError([f"{text.strip() or 'any key'}: write KEY = VALUE, for instance model.p_rep = 0.14"])
    with as_error(key):
        found = parse_toml_value(value)
    if "." in key:
        return key, found
    if key in FIXED_KEYS:
        raise ScenarioError([f"{key} = {value}: {FIXED_KEYS[key]} cannot change in flight; {RESTART_HINTS[key]}"])
    if key in TOP_LEVEL_KEYS:
        raise ScenarioError([f"{key}: cannot be changed while a flock flies; write it into the scenario file"])
    records = {section: type(record) for section, record in scenario.records.items()}
    whole, _, faults = expand_short_keys({key: found}, records, ())
    if faults:
        raise ScenarioError(faults)
    return next(iter(whole.items()))


def file_stem(player: Player) -> str:
    """Return the stem of file names of the active pane."""
    return Path(player.side.origin.where).with_suffix("").name
