"""Docstrings as the site shows them: lines of `name : meaning` become a list, and lists of arguments have a dash."""

import re

from docutils import nodes
from sphinx.application import Sphinx

ITEM = re.compile(r"(\w[\w, `]*?) +: (.+)")


def setup(app: Sphinx) -> dict[str, bool]:
    """Before napoleon reads a docstring, and once a page is built."""
    app.connect("autodoc-process-docstring", lambda *given: listed(given[-1]), priority=400)
    app.connect("doctree-resolved", dashed)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def listed(lines: list[str]) -> None:
    """Make each paragraph that begins with `name : meaning` a list, in place; numpydoc's sections stay."""
    result: list[str] = []
    within = False
    for line, above, below in zip(lines, ["", *lines[:-1]], [*lines[1:], ""], strict=True):
        match = ITEM.fullmatch(line)
        indent = len(below) - len(below.lstrip())  # a meaning that goes on does so below its first word
        if match and (within or not above.strip() and indent in (0, match.start(2))):
            result.append(f"* ``{match[1].replace('`', '')}``: {match[2]}")
            within = True
        elif within and line and (line[0].islower() or line[0] == " ") and not line.startswith("nan "):
            result.append(f"  {line.strip()}")
        else:
            result += ["", line] if within and line else [line]
            within = False
    lines[:] = result


def dashed(_: Sphinx, doctree: nodes.document, __: str) -> None:
    """Write a dash for the two hyphens that sphinx puts behind an argument or a type."""
    for text in list(doctree.findall(nodes.Text)):
        if text.astext().startswith(" -- "):
            text.parent.replace(text, nodes.Text(" – " + text.astext()[4:]))
