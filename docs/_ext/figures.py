"""Pictures of an executed example: every Matplotlib figure that it has bound to a name, alone or in a list."""

from collections.abc import Callable
from typing import Any

import matplotlib.pyplot as plt
from matplotlib.figure import Figure
from sphinx_gallery.scrapers import figure_rst

WIDTH = 1600  # pixels


def _get_sg_image_scraper() -> Callable[..., str]:
    """What sphinx-gallery asks a module for."""
    return scrape


def scrape(block: Any, block_vars: dict[str, Any], gallery_conf: dict[str, Any]) -> str:
    """Save the figures that are new since the block before, and say where."""
    seen = block_vars["example_globals"].setdefault("__figures_seen__", set())
    names = []
    bound = list(block_vars["example_globals"].values())
    for value in [item for held in bound for item in (held if isinstance(held, list) else [held])]:
        if isinstance(value, Figure) and id(value) not in seen:
            seen.add(id(value))
            path = next(block_vars["image_path_iterator"])
            value.savefig(path, dpi=min(WIDTH / value.get_figwidth(), 200.0), bbox_inches="tight", pad_inches=0.08)
            names.append(path)
    plt.close("all")  # pyplot keeps those of all examples otherwise, and warns
    return figure_rst(names, gallery_conf["src_dir"])
