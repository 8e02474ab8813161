"""Terms of the glossary link to it where the prose of a page first uses them."""

import re
from collections.abc import Collection

from docutils import nodes
from sphinx.application import Sphinx

SILENT = (
    nodes.literal, nodes.literal_block, nodes.reference, nodes.title, nodes.math, nodes.math_block, nodes.term,
    nodes.caption, nodes.table, nodes.strong,
)  # fmt: skip


def setup(app: Sphinx) -> dict[str, bool]:
    """Link once all pages are read."""
    app.connect("doctree-resolved", link)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def link(app: Sphinx, doctree: nodes.document, page: str) -> None:
    """Make the first use of each term on a page a link to the glossary."""
    objects = app.env.domains.standard_domain.objects
    known = {name: place for (kind, name), place in objects.items() if kind == "term"}
    if page == "glossary" or page.startswith("generated/project/changelog") or not known:
        return
    pattern, seen = pattern_of(known), set[str]()
    for text in list(doctree.findall(nodes.Text)):
        if _silent(text):
            continue
        match = next((found for found in pattern.finditer(text.astext()) if term_of(found[1], known) not in seen), None)
        if match is None:
            continue
        term = term_of(match[1], known)
        seen.add(term)
        home, anchor = known[term]
        where = app.builder.get_relative_uri(page, home) + "#" + anchor
        reference = nodes.reference("", match[0], internal=True, refuri=where, classes=["glossary-term"])
        whole = text.astext()
        parts = [nodes.Text(whole[: match.start()]), reference, nodes.Text(whole[match.end() :])]
        text.parent.replace(text, [part for part in parts if part.astext()])


def pattern_of(known: Collection[str]) -> re.Pattern[str]:
    """What finds terms in prose, the longest first, in the plural and at the head of a sentence, too.

    A key such as model.r is no term.
    """
    names = sorted(known, key=len, reverse=True)
    forms = (f"[{name[0].upper()}{name[0]}]{re.escape(name[1:])}" if name[0].islower() else name for name in names)
    return re.compile(r'(?<![\w."])(' + "|".join(forms) + r')s?(?![\w"]|\.\w)')


def term_of(written: str, known: Collection[str]) -> str:
    """The term as the glossary has it."""
    return written if written in known else written[0].lower() + written[1:]


def _silent(node: nodes.Node) -> bool:
    """Whether a text stands where no link belongs."""
    parent, within = node.parent, False
    while parent is not None:
        if isinstance(parent, SILENT):
            return True
        within = within or isinstance(parent, nodes.paragraph)
        parent = parent.parent
    return not within
