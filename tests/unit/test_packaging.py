"""Files about the package agree with pyproject.toml: the conda recipe, the citation, the table of extras."""

import importlib.util
import json
import re
import tomllib
from hashlib import sha256
from pathlib import Path

import airflock
from airflock.scenarios.named_code import MODELS

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def _script(path):
    """Return a script of the repository as a module."""
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


fill_recipe = _script(ROOT / "tools" / "fill_recipe.py").fill_recipe
wheel = _script(ROOT / "tests" / "nightly" / "wheel.py")
PUBLISHED = {name for name, law in MODELS.items() if "Ours." not in law.doc}
CONDA_NAMES = {"matplotlib": "matplotlib-base"}  # the part without a window system


def test_the_conda_recipe_needs_what_pip_installs():
    recipe = (ROOT / "conda" / "meta.yaml").read_text(encoding="utf-8")
    needs = re.findall(r"^    - (.+)$", recipe.partition("  run:\n")[2].partition("\ntest:")[0], re.M)
    wanted = [f"python {PROJECT['requires-python']}"]
    for need in PROJECT["dependencies"]:
        name, bounds = re.fullmatch(r"([\w-]+)(.*)", need).groups()
        wanted.append(f"{CONDA_NAMES.get(name, name)} {bounds}")
    assert sorted(needs) == sorted(wanted)
    for name in ("meta.yaml", "papers/meta.yaml"):
        assert f'version = "{airflock.__version__}"' in (ROOT / "conda" / name).read_text(encoding="utf-8")


def test_a_filled_recipe_has_the_version_and_the_hash_of_its_sdist(tmp_path):
    sdist = tmp_path / "airflock-9.8.7.tar.gz"
    sdist.write_bytes(b"any bytes")
    for name in ("meta.yaml", "papers/meta.yaml"):
        filled = fill_recipe((ROOT / "conda" / name).read_text(encoding="utf-8"), sdist)
        assert 'set version = "9.8.7"' in filled and f'sha256: "{sha256(b"any bytes").hexdigest()}"' in filled


def test_the_deposit_has_title_and_licence_of_the_citation():
    deposit = json.loads((ROOT / ".zenodo.json").read_text(encoding="utf-8"))
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f'title: "{deposit["title"]}"' in citation and f"license: {deposit['license']}\n" in citation
    assert deposit["keywords"] == PROJECT["keywords"]


def test_the_wheel_check_runs_each_command_of_the_readme():
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert wheel.readme_commands() == [
        "airflock run vasarhelyi_2018/4ms --plot flight.png",
        "airflock watch vasarhelyi_2018/obstacles --agents 30",
    ]
    assert all(command in readme for command in wheel.readme_commands())


def test_the_citation_names_this_version_and_the_publication_of_every_law():
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"\nversion: {airflock.__version__}\n" in citation
    bibliography = (ROOT / "references.bib").read_text(encoding="utf-8")
    for name in PUBLISHED | {"zapotecatl_2016"}:
        (entry,) = re.findall(rf"^@\w+\{{{name},(.*?)^}}", bibliography, re.M | re.S)
        (title,) = re.findall(r"^\s*title\s*= \{(.+)\}", entry, re.M)
        assert title.split("Swarms")[0].lower() in citation.lower(), name


def test_every_extra_stands_in_the_table_of_the_documentation():
    page = (ROOT / "docs" / "start.md").read_text(encoding="utf-8")
    told = set(re.findall(r"^\| `\[(\w+)\]` \|", page, re.M))
    assert told == set(PROJECT["optional-dependencies"]) - {
        "browser",
        "lint",
        "dev",
    }  # for who works on Airflock


def test_the_paper_names_as_many_laws_as_there_are_and_cites_each_publication():
    text = (ROOT / "paper" / "paper.md").read_text(encoding="utf-8")
    written = dict(zip(("twelve", "thirteen", "fourteen", "fifteen", "sixteen"), range(12, 17), strict=True))
    (laws,) = re.findall(r"(\w+) laws come with the package", text)
    assert written[laws.lower()] == len(MODELS)
    cited = set(re.findall(r"@(\w+)", text))
    assert cited >= PUBLISHED
    assert cited <= set(re.findall(r"^@\w+\{(\w+),", (ROOT / "references.bib").read_text(encoding="utf-8"), re.M))
