"""Write version, address and hash of built sdists into the conda recipes.

python tools/fill_recipe.py DIST    DIST: the folder that tools/build.sh wrote
"""

import re
import sys
from hashlib import sha256
from pathlib import Path

RECIPES = Path(__file__).resolve().parents[1] / "conda"


def fill_recipe(recipe: str, sdist: Path) -> str:
    """Return the text of a recipe with the version of an sdist and the SHA-256 of its bytes."""
    version = sdist.name.removesuffix(".tar.gz").rpartition("-")[2]
    found = sha256(sdist.read_bytes()).hexdigest()
    recipe, versions = re.subn(r'(set version = )"[^"]*"', rf'\1"{version}"', recipe)
    recipe, hashes = re.subn(r'( sha256: )"[^"]*"', rf'\1"{found}"', recipe)
    if (versions, hashes) != (1, 1):
        raise SystemExit("the recipe must name its version once and its sha256 once")
    return recipe


def main() -> None:
    """Fill both recipes."""
    if len(sys.argv) != 2:
        raise SystemExit(__doc__)
    for recipe, name in ((RECIPES / "meta.yaml", "airflock"), (RECIPES / "papers" / "meta.yaml", "airflock_papers")):
        sdists = list(Path(sys.argv[1]).glob(f"{name}-[0-9]*.tar.gz"))
        if len(sdists) != 1:
            raise SystemExit(f"{sys.argv[1]}: {len(sdists)} sdists of {name}, one is needed; tools/build.sh writes it")
        recipe.write_text(fill_recipe(recipe.read_text(encoding="utf-8"), sdists[0]), encoding="utf-8")
        print(f"{recipe}: {sdists[0].name}")


if __name__ == "__main__":
    main()
