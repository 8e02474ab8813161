"""Panel: the controls beside the scene, in the words of the studio. Viser is known here, in `view` and in `charts`."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import viser
from viser import uplot

from airflock.studio.charts import Chart
from airflock.studio.controls import ParameterControl
from airflock.view import colours

CHART_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#000000")


class Widgets:
    """The panel of one page.

    server : of viser
    """

    def __init__(self, server: viser.ViserServer):
        self.server = server

    def add_tabs(self, *names: str) -> list[Any]:
        """Tabs; each is a context in which controls are made."""
        group = self.server.gui.add_tab_group()
        return [group.add_tab(name) for name in names]

    def folder(self, name: str, is_open: bool = True) -> Any:
        """A folder; a context in which controls are made."""
        return self.server.gui.add_folder(name, expand_by_default=is_open)

    def text(self, content: str = "") -> Any:
        """HTML that can be rewritten: `.content`."""
        return self.server.gui.add_html(content)

    def add_button(self, label: str, action: Callable[[], None], hint: str = "") -> Any:
        """A button; `.label` can be rewritten."""
        handle = self.server.gui.add_button(label, hint=hint or None)
        handle.on_click(lambda _: action())
        return handle

    def row(self, actions: dict[str, Callable[[], None]]) -> None:
        """Small buttons side by side."""
        self.server.gui.add_button_group("", tuple(actions)).on_click(lambda event: actions[event.target.value]())

    def command(self, label: str, key: Any, action: Callable[[], None]) -> None:
        """A key that does something."""
        self.server.gui.add_command(label, hotkey=key).on_trigger(lambda _: action())

    def add_checkbox(self, label: str, value: bool, action: Callable[[bool], None], hint: str = "") -> Any:
        """A switch; its state is `.value`."""
        handle = self.server.gui.add_checkbox(label, value, hint=hint or None)
        handle.on_update(lambda event: action(bool(event.target.value)) if event.client is not None else None)
        return handle

    def add_menu(
        self, label: str, options: Sequence[str], value: str, action: Callable[[str], None], hint: str = ""
    ) -> Any:
        """A menu; what is chosen is `.value`."""
        handle = self.server.gui.add_dropdown(label, tuple(options), initial_value=value, hint=hint or None)
        handle.on_update(lambda event: action(event.target.value) if event.client is not None else None)
        return handle

    def number(self, label: str, value: int, low: int, high: int, action: Callable[[int], None], hint: str = "") -> Any:
        """A field for a whole number; beyond its ends it is ignored until the field is left, then set to the end."""
        handle = self.server.gui.add_number(label, value, min=low, max=high, step=1, hint=hint or None)

        @handle.on_update
        def _(event: Any) -> None:
            if event.client is not None and low <= event.target.value <= high:
                action(int(event.target.value))

        return handle

    def field(self, label: str, hint: str = "") -> Any:
        """A field for a line of text: `.value`."""
        return self.server.gui.add_text(label, "", hint=hint or None)

    def add_upload_button(self, label: str, ending: str, action: Callable[[str, bytes], None], hint: str = "") -> Any:
        """A button that takes a file from the reader's machine; `action` is called with its name and content."""
        handle = self.server.gui.add_upload_button(label, mime_type=ending, hint=hint or None)
        handle.on_upload(lambda event: action(event.target.value.name, event.target.value.content))
        return handle

    def add_slider(
        self, label: str, low: float, high: float, step: float, value: float, action: Callable[[float], None],
        hint: str = "",
    ) -> Any:  # fmt: skip
        """A slider; `action` is called for a hand on it, not of a value that is set from here."""
        handle = self.server.gui.add_slider(label, low, high, step, value, hint=hint or None)
        handle.on_update(lambda event: action(float(event.target.value)) if event.client is not None else None)
        return handle

    def add_control(self, control: ParameterControl, action: Callable[[str, Any], None]) -> Any:
        """A slider or a menu for a parameter."""
        if control.is_choice:
            return self.add_menu(
                control.label, control.options, control.value, lambda v: action(control.key, v), control.hint
            )
        return self.add_slider(
            control.label,
            control.low,
            control.high,
            control.step,
            control.value,
            lambda v: action(control.key, v),
            control.hint,
        )

    def add_chart(self, title: str, names: Sequence[str], band: bool = False, across: str = "t (s)") -> Chart:
        """A chart: `.data` is (time or what is `across`, *values). With a band, the last two are its ends, shaded."""
        series: list[Any] = [uplot.Series(label=across)]
        for number, name in enumerate(names):
            edge = band and number >= len(names) - 2
            stroke, width = ("#E69F00", 0.7) if edge else (CHART_COLOURS[number], 2.0)
            points = uplot.Series_Points(show=False)
            series.append(uplot.Series(label=name, points=points, stroke=stroke, width=width))
        shade = (uplot.Band(series=(len(names) - 1, len(names)), fill="rgba(230,159,0,0.2)"),) if band else None
        zero = np.zeros(2)
        return Chart(self.server.gui.add_uplot(
            (zero, *[zero] * len(names)), tuple(series), title=title, aspect=2.1, bands=shade, padding=(8, 8, 0, 0),
            scales={"x": uplot.Scale(time=False, range=(0.0, 1.0))}, legend=uplot.Legend(show=True),
            axes=(uplot.Axis(stroke=colours.AXIS_COLOUR, size=28), uplot.Axis(stroke=colours.AXIS_COLOUR, size=46)),
        ))  # fmt: skip

    def notify(self, title: str, body: str, is_error: bool = False) -> None:
        """A notice on every open page."""
        for client in self.server.get_clients().values():
            client.add_notification(title, body, color="red" if is_error else "blue", auto_close_seconds=8.0)
