"""Opening: another scenario on the same page, by the name of a preset or as a file from the reader's machine."""

from pathlib import Path, PureWindowsPath
from typing import TYPE_CHECKING

from airflock.scenarios import presets
from airflock.studio.room import PagePanel, small_print_html
from airflock.studio.saving import free_path
from airflock.support import MAX_BYTES, FormatError, StudioError, TextError, atomic, parse_toml, printable

if TYPE_CHECKING:
    from airflock.studio.page import FlightPage

NO_CHOICE_TEXT = "a preset …"


class OpeningPanel(PagePanel):
    """A menu of presets, and a button that takes a scenario file."""

    def __init__(self, page: "FlightPage"):
        super().__init__(page)
        with self.widgets.folder("Open another scenario", is_open=False):
            self.preset_menu = self.widgets.add_menu(
                "preset", (NO_CHOICE_TEXT, *sorted(presets())), NO_CHOICE_TEXT, self._chosen
            )
            self.widgets.add_upload_button(
                "Open a file (.toml)",
                ".toml",
                self._ask_for_file,
                "it is saved in the folder where airflock watch runs",
            )
            self.message = self.widgets.text()

    def _chosen(self, name: str) -> None:
        if name != NO_CHOICE_TEXT:
            self.player.ask(lambda: self._opened(name))

    def _ask_for_file(self, name: str, content: bytes) -> None:
        self.player.ask(lambda: self.take(name, content))

    def take(self, name: str, content: bytes) -> None:
        """Open a scenario file that was sent; code that it names does not run. Raises AirflockError, and keeps nothing.

        name : of the file on the reader's machine; content : its bytes
        """
        text, path = read_scenario_text(name, content), free_path(Path(PureWindowsPath(name).name))
        atomic.write_file(path, text)
        try:
            self._opened(str(path))
        except Exception:
            path.unlink()
            raise
        self.player.fault(f"saved {path.absolute()}")

    def _opened(self, name: str) -> None:
        self.player.open(name)
        self.scene.collisions.clear()
        self.page.rebuild()
        self.message.content = small_print_html("")

    def rebuild(self) -> None:
        """The menu names what flies, where that is a preset."""
        where = self.player.side.origin.where
        self.preset_menu.value = where if where in presets() else NO_CHOICE_TEXT


def read_scenario_text(name: str, content: bytes) -> str:
    """Text of a scenario file that was sent. Raises StudioError where it is no TOML, and says why."""
    try:
        if len(content) > MAX_BYTES:
            raise TextError(f"is larger than {MAX_BYTES / 1e6:g} MB, more than any file of this kind needs")
        text = content.decode("utf-8-sig")
        parse_toml(text)
    except UnicodeDecodeError as fault:
        wrong = f"is not text in UTF-8: byte {fault.start} is 0x{content[fault.start]:02x}"
        raise StudioError(f"{name}: is not a scenario file (TOML): {wrong}") from fault
    except FormatError as fault:
        raise StudioError(f"{name}: is not a scenario file (TOML): {fault}") from fault
    except TextError as fault:
        raise StudioError(f"{name}: {fault}") from fault
    if "\0" in name:
        raise StudioError(f"{printable(name)}: holds a character (NUL) that no file name may have")
    if not name.lower().endswith(".toml"):
        raise StudioError(f"{name}: is not a scenario file; its name must end with .toml")
    return text
