"""Equations as MathML, which browsers draw by themselves: no script and no network."""

import html
import re

from docutils import nodes
from docutils.utils.math import MathError
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError


def mathml(text: str, *, inline: bool) -> str:
    """MathML of an equation in LaTeX; an index that is a word, such as `frict`, stands upright."""
    text = re.sub(r"([_^])\{([A-Za-z]{3,})\}", r"\1{\\mathrm{\2}}", text)
    try:
        return str(tex2mathml(text, as_block=not inline))
    except MathError as fault:
        raise ExtensionError(f"equation {text!r}: {fault}") from fault


def visit_inline(translator, node: nodes.math) -> None:
    """Write an equation within a line."""
    translator.body.append(mathml(node.astext(), inline=True))
    raise nodes.SkipNode


def visit_block(translator, node: nodes.math_block) -> None:
    """Write an equation on a line of its own."""
    label = f' id="{html.escape(node["ids"][0])}"' if node["ids"] else ""
    translator.body.append(f'<div class="math"{label}>{mathml(node.astext(), inline=False)}</div>')
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, bool]:
    """Offer the renderer to sphinx under the name mathml."""
    app.add_html_math_renderer("mathml", (visit_inline, None), (visit_block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
