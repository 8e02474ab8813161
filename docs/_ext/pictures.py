"""Pictures of the gallery on other pages: of each law, and of each order parameter, low and high.

A build that executes no example has no pictures; its pages hold the links alone.
"""

import ast
import re

from sphinx.application import Sphinx
from writing import DOCS, LAWS

LOW_AND_HIGH = ("25_low_and_high", "26_low_and_high_flights")


def of_model(name: str) -> str:
    """Return the example of the gallery that shows a law, as its page of equations says; "" where none does."""
    found = re.match(r"Gallery: (\w+)\n", (LAWS / name / "equations.md").read_text(encoding="utf-8"))
    return found[1] if found else ""


def executed(app: Sphinx) -> bool:
    """Whether this build executes the examples, so that their pictures are there when the pages are read."""
    return str(app.config.plot_gallery).lower() not in ("0", "false", "")


def pairs() -> dict[str, tuple[str, int]]:
    """Order parameter → the example that shows it low and high, and the number of the picture there."""
    found: dict[str, tuple[str, int]] = {}
    for example in LOW_AND_HIGH:
        tree = ast.parse((DOCS / "gallery" / f"{example}.py").read_text(encoding="utf-8"))
        (listed,) = (
            node.value for node in tree.body if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "PAIRS"
        )
        assert isinstance(listed, ast.List)
        for number, pair in enumerate(listed.elts, 1):
            assert isinstance(pair, ast.Tuple)
            found |= {name: (example, number) for name in ast.literal_eval(pair.elts[0])}
    return found


def shown(example: str, number: int, what: str, *, there: bool) -> str:
    """A picture of the gallery as Markdown, with the link to where it is drawn."""
    link = f"[{what}](/generated/gallery/{example})"
    if not there:
        return f"{link} is in the gallery.\n"
    place = f"/generated/gallery/images/sphx_glr_{example}_{number:03d}.png"
    return f":::{{image}} {place}\n:alt: {what}\n:width: 40em\n:::\n\n{link}, in the gallery.\n"
