"""The Markdown of the repository as pages: reports on papers, decisions, ARCHITECTURE, with links that hold here."""

import re
import shutil
from pathlib import Path

from writing import DOCS, OUT, ROOT, put

EXAMPLES = ("gallery", "notebooks", "tours")


def repository() -> None:
    """Papers' reports, decisions and other Markdown of the repository, with links that hold within the site."""
    for name in ("ARCHITECTURE", "CONTRIBUTING", "CHANGELOG"):
        copy(ROOT / f"{name}.md", f"project/{name.lower()}.md")
    copy(DOCS / "evolve.md", "evolve.md")
    decisions = sorted((DOCS / "decisions").glob("*.md"))
    for path in decisions:
        copy(path, f"project/decisions/{path.name}")
    listed = "\n".join(path.stem for path in decisions)
    head = "# Decisions\n\nWhat is expensive to reverse, and what decided it.\n\n"
    put("project/decisions/index.md", f"{head}```{{toctree}}\n:maxdepth: 1\n\n{listed}\n```\n")
    papers = sorted(path for path in (ROOT / "papers").iterdir() if (path / "README.md").is_file())
    for folder in papers:
        extra = [path for path in sorted(folder.glob("*.md")) if path.name != "README.md"]
        tree = "\n".join(path.stem.lower() for path in extra)
        after = f"\n\n```{{toctree}}\n:maxdepth: 1\n\n{tree}\n```\n" if extra else ""
        copy(folder / "README.md", f"papers/{folder.name}/index.md", after)
        for path in extra:
            copy(path, f"papers/{folder.name}/{path.stem.lower()}.md")
    alone = sorted(path for path in (ROOT / "papers").glob("*.md") if path.name != "README.md")
    for path in alone:
        copy(path, f"papers/{path.stem.lower()}.md")
    listed = "\n".join([f"{path.name}/index" for path in papers] + [path.stem.lower() for path in alone])
    copy(ROOT / "papers/README.md", "papers/index.md", f"\n\n```{{toctree}}\n:maxdepth: 1\n\n{listed}\n```\n")


def copy(source: Path, name: str, after: str = "") -> None:
    """A Markdown file of the repository: pictures come along, links to files that are no pages become their names."""
    target = OUT / name

    def link(match: re.Match[str]) -> str:
        bang, text, where = match[1], match[2], match[3]
        path, _, anchor = where.partition("#")
        if where.startswith(("http://", "https://", "#")):
            return match[0] if not where.startswith("#") else text
        file = (source.parent / path).resolve()
        if bang and file.is_file():
            picture = target.parent / "pictures" / file.name
            picture.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(file, picture)
            return f"![{text}](pictures/{file.name})"
        page = _page_of(file)
        if page is not None:
            return f"[{text}](/{page}{f'#{anchor}' if anchor and not page.startswith('generated/') else ''})"
        where = file.relative_to(ROOT).as_posix() if file.is_relative_to(ROOT) else path
        return f"`{where}`" if where.endswith(text.strip("`")) else f"{text} (`{where}`)"

    text = source.read_text(encoding="utf-8")
    put(name, re.sub(r"(!?)\[([^\]]*)\]\(([^)\s]+)\)", link, text) + after)


def _page_of(file: Path) -> str | None:
    """The page of the site that a file of the repository is, or is made into; None if it has none."""
    if not file.is_relative_to(ROOT):
        return None
    parts = file.relative_to(ROOT).parts
    if parts[0] == "papers" and len(parts) == 2 and file.suffix == ".md":
        return f"generated/papers/{'index' if parts[1] == 'README.md' else file.stem.lower()}.md"
    if parts[0] == "papers" and len(parts) in (2, 3) and (len(parts) == 2 or file.suffix == ".md"):
        rest = "index" if len(parts) == 2 or parts[2] == "README.md" else file.stem.lower()
        return f"generated/papers/{parts[1]}/{rest}.md"
    if parts[:2] == ("docs", "decisions"):
        return f"generated/project/decisions/{parts[2] if len(parts) == 3 else 'index.md'}"
    if parts[-1] in ("ARCHITECTURE.md", "CONTRIBUTING.md", "CHANGELOG.md") and len(parts) == 1:
        return f"generated/project/{parts[-1].lower()}"
    if parts[0] == "docs" and len(parts) == 2 and file.suffix == ".md":
        return "generated/evolve.md" if file.stem == "evolve" else parts[1]
    if parts[0] == "docs" and len(parts) == 3 and parts[1] in EXAMPLES and file.suffix == ".py":
        return f"generated/{parts[1]}/{file.stem}"
    return None
