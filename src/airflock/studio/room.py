"""Room: a part of a page with one purpose, its controls and what it shows."""

import html
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from airflock.studio.page import FlightPage


class PagePanel:
    """One part of a page.

    page : which it belongs to
    """

    def __init__(self, page: "FlightPage"):
        self.page, self.player, self.view = page, page.player, page.view
        self.widgets, self.scene = page.view.panel, page.scene

    def rebuild(self) -> None:
        """Show other flights than before: another one began, or a second one joined or left."""

    def refresh(self) -> None:
        """Show the present moment; a few times a second."""

    def ask(self, action: Callable[[], Any]) -> Callable[[], None]:
        """What a control calls to have something done before the next frame."""
        return lambda: self.player.ask(lambda: (action(), None)[1])


def small_print_html(text: str) -> str:
    """Small print of a panel, as HTML."""
    return f"<div style='padding:0 0.75em;font-size:0.85em'>{text}</div>"


def status_html(text: str, is_error: bool) -> str:
    """What a page says above its tabs, as HTML, at a distance from them; red where it is bad."""
    look = f"padding:0 0.75em 0.6em;font-size:0.85em;color:{'#b00020' if is_error else '#555'}"
    return f"<div style='{look}'>{html.escape(text)}</div>" if text else ""
