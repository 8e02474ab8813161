"""A table of scores: a DataFrame that a notebook shows with the unit and the meaning of each column."""

from collections.abc import Callable
from html import escape
from typing import Any

import pandas as pd


class ScoreTable(pd.DataFrame):  # type: ignore[misc]  # pandas has no types here
    """Order parameters, a column each; `attrs["units"]` and `attrs["meanings"]` say what they are.

    It is a DataFrame in all but its heads in a notebook: below each name stands the unit, and pointing at a name shows
    the meaning. What pandas makes of it is such a table, too, as long as it keeps the attributes.
    """

    @property
    def _constructor(self) -> Callable[..., "ScoreTable"]:
        return ScoreTable

    def _repr_html_(self) -> str | None:
        """As pandas writes it, with units and meanings in the heads."""
        page: Any = super()._repr_html_()
        if page is None:  # pandas was told to show text
            return None
        head, end, rest = str(page).partition("</thead>")
        meanings = self.attrs.get("meanings", {})
        for name, unit in self.attrs.get("units", {}).items():
            written = escape(str(name))
            told = f'<th title="{escape(meanings.get(name, ""))}">{written}<br>{escape(unit) or "&nbsp;"}</th>'
            head = head.replace(f"<th>{written}</th>", told, 1)
        return head + end + rest


def with_units(table: pd.DataFrame, descriptions: dict[str, tuple[str, str]]) -> ScoreTable:
    """A table with the units and meanings of those of its columns that are known: name → unit, meaning."""
    made = ScoreTable(table)
    made.attrs |= table.attrs
    for place, about in (("units", 0), ("meanings", 1)):
        made.attrs[place] = {name: descriptions[name][about] for name in table.columns if name in descriptions}
    return made
