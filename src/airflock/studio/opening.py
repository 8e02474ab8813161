"""Opening: another scenario on the same page, by the name of a preset or as a file from the reader's machine."""

from pathlib import Path, PureWindowsPath
from typing import TYPE_CHECKING

from airflock.scenarios.files import presets
from airflock.studio.room import Room, note
from airflock.studio.saving import free
from airflock.support import atomic
from airflock.support.errors import StudioError, printable
from airflock.support.untrusted import MOST_BYTES, FormatError, TextError, toml

if TYPE_CHECKING:
    from airflock.studio.page import Page

CHOOSE = "a preset …"


class Opening(Room):
    """A menu of presets, and a button that takes a scenario file."""

    def __init__(self, page: "Page"):
        super().__init__(page)
        with self.panel.folder("Open another scenario", is_open=False):
            self.menu = self.panel.menu("preset", (CHOOSE, *sorted(presets())), CHOOSE, self._chosen)
            self.panel.upload(
                "Open a file (.toml)", ".toml", self._given, "it is saved in the folder where airflock watch runs"
            )
            self.said = self.panel.text()

    def _chosen(self, name: str) -> None:
        if name != CHOOSE:
            self.player.ask(lambda: self._opened(name))

    def _given(self, name: str, content: bytes) -> None:
        self.player.ask(lambda: self.take(name, content))

    def take(self, name: str, content: bytes) -> None:
        """Open a scenario file that was sent; code that it names does not run. Raises AirflockError, and keeps nothing.

        name : of the file on the reader's machine; content : its bytes
        """
        text, path = scenario_text(name, content), free(Path(PureWindowsPath(name).name))
        atomic.write(path, text)
        try:
            self._opened(str(path))
        except Exception:
            path.unlink()
            raise
        self.player.fault(f"saved {path.absolute()}")

    def _opened(self, where: str) -> None:
        self.player.open(where)
        self.drawing.collisions.clear()
        self.page.rebuild()
        self.said.content = note("")

    def rebuild(self) -> None:
        """The menu names what flies, where that is a preset."""
        where = self.player.side.origin.where
        self.menu.value = where if where in presets() else CHOOSE


def scenario_text(name: str, content: bytes) -> str:
    """Text of a scenario file that was sent. Raises StudioError where it is no TOML, and says why."""
    try:
        if len(content) > MOST_BYTES:
            raise TextError(f"is larger than {MOST_BYTES / 1e6:g} MB, more than any file of this kind needs")
        text = content.decode("utf-8-sig")
        toml(text)
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
