"""Terms of the glossary link to it where the prose of a page first uses them."""

import re

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
    names = sorted(known, key=len, reverse=True)
    pattern = re.compile(
        r'(?<![\w."])(' + "|".join(map(re.escape, names)) + r')s?(?![\w"]|\.\w)'
    )  # no key such as model.r
    seen: set[str] = set()
    for text in list(doctree.findall(nodes.Text)):
        if _silent(text):
            continue
        match = next((found for found in pattern.finditer(text.astext()) if found[1] not in seen), None)
        if match is None:
            continue
        seen.add(match[1])
        home, anchor = known[match[1]]
        where = app.builder.get_relative_uri(page, home) + "#" + anchor
        reference = nodes.reference("", match[0], internal=True, refuri=where, classes=["glossary-term"])
        whole = text.astext()
        parts = [nodes.Text(whole[: match.start()]), reference, nodes.Text(whole[match.end() :])]
        text.parent.replace(text, [part for part in parts if part.astext()])


def _silent(node: nodes.Node) -> bool:
    """Whether a text stands where no link belongs."""
    parent, within = node.parent, False
    while parent is not None:
        if isinstance(parent, SILENT):
            return True
        within = within or isinstance(parent, nodes.paragraph)
        parent = parent.parent
    return not within
