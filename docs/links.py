"""Check that every link within the built documentation leads to a page, a file or a heading that exists, and that no
output of an example holds an address in memory, which would differ at each build.

python docs/links.py          # after .ci/docs; tells page and link; exit status 1 if one leads nowhere
"""

import re
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

BUILT = Path(__file__).parent / "_build"


class Page(HTMLParser):
    """Links and anchors of a page."""

    def __init__(self) -> None:
        super().__init__()
        self.links: list[str] = []
        self.anchors: set[str] = set()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Gather what a tag links to, and what it may be linked by."""
        given = {name: value for name, value in attrs if value}
        self.anchors |= {given[name] for name in ("id", "name") if name in given}
        self.links += [given[name] for name in ("href", "src") if name in given]


def faults(built: Path) -> list[str]:
    """Links that lead nowhere and outputs that name an address, each with its page."""
    pages: dict[Path, Page] = {}
    found = []
    for path in sorted(built.rglob("*.html")):
        if path.parent.name == "_static":  # the theme's own
            continue
        pages[path] = Page()
        text = path.read_text(encoding="utf-8")
        pages[path].feed(text)
        if re.search(r" object at 0x[0-9a-f]{6}", text):
            found.append(f"{path.relative_to(built)}: an output holds an address in memory")
    for path, page in pages.items():
        for link in sorted(set(page.links)):
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            there = target in pages if target.suffix == ".html" else target.exists()
            anchor = unquote(parts.fragment)
            if not there:
                found.append(f"{path.relative_to(built)}: {link} leads to no file")
            elif anchor and target in pages and anchor not in pages[target].anchors:
                found.append(f"{path.relative_to(built)}: {link} leads to no heading")
    return found


def main() -> int:
    """Print every fault; 1 if there is one."""
    if not BUILT.is_dir():
        print(f"{BUILT}: no such folder; bash .ci/docs builds the documentation", file=sys.stderr)
        return 2
    told = faults(BUILT)
    for fault in told:
        print(fault)
    return int(bool(told))


if __name__ == "__main__":
    sys.exit(main())
