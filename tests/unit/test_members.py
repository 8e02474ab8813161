"""Parts are found by their folder, in the package and in installed packages; what is broken is left out by one line."""

import re
import subprocess
import sys
import warnings
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import pytest

from airflock.core import contract
from airflock.parts import KINDS


def source_of(kind, name):
    """Return the file or folder that a member comes from."""
    folder = Path(import_module(kind.folder).__file__).parent
    paths = [folder / name, folder / f"{name}.py", *folder.glob("*.py")]
    named = re.compile(rf"^NAME = .{name}.$", re.M)
    return next(p for p in paths if p.is_dir() or (p.is_file() and (p.stem == name or named.search(p.read_text()))))


@pytest.fixture
def gathered(tmp_path, monkeypatch):
    """Gather a kind again, with more files beside those of the package."""

    def gather(kind, **texts):
        package = import_module(kind.folder)
        monkeypatch.setattr(package, "__path__", [*package.__path__, str(tmp_path)])
        for name, text in texts.items():
            (tmp_path / f"{name}.py").write_text(text)
            monkeypatch.delitem(sys.modules, f"{kind.folder}.{name}", raising=False)
        try:
            made = replace(kind)
            assert made is not kind and len(made)
            return made
        finally:
            for name in texts:
                sys.modules.pop(f"{kind.folder}.{name}", None)
                vars(package).pop(name, None)

    return gather


ids = {"ids": lambda kind: kind.noun}
WITH_FILES = [kind for kind in KINDS if kind.rules]


@pytest.mark.parametrize("kind", WITH_FILES, **ids)
def test_copy_of_a_part_in_its_folder_is_a_part_without_any_list(kind, gathered):
    name = sorted(set(kind) - set(kind.fixed))[-1]
    text = re.sub(r"^NAME = .*$", "", source_of(kind, name).read_text(encoding="utf-8"), flags=re.M)
    assert set(gathered(kind, copied=text)) == {*kind, "copied"}


@pytest.mark.parametrize("kind", WITH_FILES, **ids)
def test_file_without_a_rule_is_a_helper_and_no_part(kind, gathered):
    found = gathered(kind, helper="def assist(x):\n    return x\n")
    assert set(found) == set(kind) and "has none of" in found.errors["helper"]


@pytest.mark.parametrize("kind", KINDS, **ids)
@pytest.mark.filterwarnings("ignore:airflock")
def test_broken_file_is_left_out_by_one_line_and_the_others_stay(kind, gathered):
    found = gathered(kind, broken=f"{[*kind.rules, 'decide'][0]} = 3\nraise KeyError('wing')\n")
    assert set(found) == set(kind)
    line = found.unknown("broken")
    assert "broken.py: KeyError: 'wing'; it is left out" in line and "\n" not in line


@pytest.mark.parametrize("kind", KINDS, **ids)
def test_second_file_of_one_name_is_left_out_with_a_warning_that_names_it(kind, gathered):
    name = sorted(set(kind) - set(kind.fixed))[-1]
    path = source_of(kind, name)
    text = (path / "law.py" if path.is_dir() else path).read_text(encoding="utf-8")
    with pytest.warns(UserWarning, match=f"second.py: another {kind.noun} is named '{name}'"):
        found = gathered(kind, second=f"{text}\nNAME = {name!r}\n")
    assert set(found) == set(kind) and found[name] == kind[name]


# --- Installed packages ---

GUST = "def motion(vx, vy, vz, nx, ny, nz):\n    return nx + 0.1, ny, nz\n"


def installed(folder, name, module, init="", **files):
    """Lay an installed package with an entry point into a folder; names of files have __ for a slash."""
    info = folder / f"{name}-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(f"[airflock.parts]\nparts = {module}\n")
    files = {f"{name}/__init__": init, **{path.replace("__", "/"): text for path, text in files.items()}}
    for path, text in files.items():
        where = folder / f"{path}.py"
        where.parent.mkdir(parents=True, exist_ok=True)
        where.write_text(text)


CODE = """
import warnings
with warnings.catch_warnings(record=True) as told:
    warnings.simplefilter("always")
    import airflock
    from airflock.parts import KINDS, FAULTS
    names = [len(kind) for kind in KINDS]
    keys = {"faults": [{"kind": "gust", "at": 0.1}], "duration": 1.0, "agents": 3}
    scenario = airflock.load("vasarhelyi_2018/4ms", keys)
    score = airflock.score(scenario, [1], device="python")
    known = [key.name for key in airflock.keys("gust")]
print("gust" in FAULTS, len(score), len(known) > 0)
for each in told:
    print(each.message)
"""


def run(tmp_path):
    path = [str(tmp_path), *sys.path]
    code = f"import sys; sys.path[:] = {path!r}\n{CODE}"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


def test_fault_of_an_installed_package_flies_and_is_listed_while_broken_ones_are_one_line_each(tmp_path):
    installed(tmp_path, "gusts", "gusts.parts", gusts__parts__faults__gust=GUST)
    installed(tmp_path, "ruins", "ruins", init="import nowhere_at_all\n")
    installed(tmp_path, "halves", "halves", halves__bodies__half="ACCEPTS = 'velocity'\n")
    installed(tmp_path, "twins", "twins", twins__faults__motor=GUST)
    first, *lines = run(tmp_path)
    assert first == "True 1 True"
    assert any(line.startswith("halves: ") and "half.py: body half lacks INTEGRATION" in line for line in lines)
    assert any(line.startswith("twins: ") and "another kind of fault is named 'motor'" in line for line in lines)
    assert any(line.startswith("ruins: ruins") and "nowhere_at_all" in line for line in lines)
    assert len(lines) == len(set(lines)) == 3


def test_package_without_parts_costs_no_import_of_metadata():
    contract.installed.cache_clear()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert isinstance(contract.installed(), tuple)


@pytest.mark.parametrize("kind", KINDS, **ids)
def test_no_file_of_the_package_is_left_out(kind):
    assert [line for line in kind.errors.values() if "has none of" not in line] == []
