"""Pictures of the gallery on other pages: of each law, and of each order parameter, low and high.

A build that executes no example has no pictures; its pages hold the links alone.
"""

import ast

from sphinx.application import Sphinx
from writing import DOCS

OF_MODEL = {
    "vasarhelyi_2018": "10_trajectories", "viragh_2014": "17_two_laws", "reynolds_1987": "50_boids",
    "vicsek_1995": "20_vicsek", "couzin_2002": "21_couzin_mill", "couzin_2005": "27_informed", "kidger": "30_city",
    "formation": "40_display", "dimock_2003": "51_formation_flight", "chen_2014": "25_predator_and_prey",
}  # fmt: skip
LOW_AND_HIGH = ("25_low_and_high", "26_low_and_high_flights")


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
