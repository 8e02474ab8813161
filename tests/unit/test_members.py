"""Parts are found by their folder."""

import runpy
import sys
from importlib import import_module
from pathlib import Path

import pytest

from airflock.core import find_members
from airflock.support import RuleError

FOLDERS = {  # folder → its file of kinds, the mapping there, and a part to copy
    "bodies": ("body_kinds", "BODIES", "direct"),
    "faults": ("fault_kinds", "KINDS", "motor"),
    "metrics": ("metric_sets", "METRICS", "milling"),
    "radios": ("radio_kinds", "RADIOS", "bursts"),
    "sensors": ("sensor_kinds", "SENSORS", "perfect"),
    "topologies": ("topology_kinds", "TOPOLOGIES", "nearest"),
}


@pytest.fixture
def added_file(tmp_path, monkeypatch):
    """Lay a file into a folder of the package for one test; return the names of all parts there."""

    def add(folder: str, name: str, text: str) -> set[str]:
        package = import_module(f"airflock.parts.{folder}")
        (tmp_path / f"{name}.py").write_text(text)
        monkeypatch.setattr(package, "__path__", [*package.__path__, str(tmp_path)])
        monkeypatch.delitem(sys.modules, f"airflock.parts.{folder}.{name}", raising=False)
        kinds, mapping, _ = FOLDERS[folder]
        try:
            return set(runpy.run_module(f"airflock.parts.{folder}.{kinds}")[mapping])
        finally:
            sys.modules.pop(f"airflock.parts.{folder}.{name}", None)
            vars(package).pop(name, None)

    return add


@pytest.mark.filterwarnings("ignore:.*found in sys.modules:RuntimeWarning")
@pytest.mark.parametrize("folder", FOLDERS)
def test_copy_of_a_part_in_its_folder_is_a_part_without_any_list(folder, added_file):
    kinds, mapping, original = FOLDERS[folder]
    members = getattr(import_module(f"airflock.parts.{folder}.{kinds}"), mapping)
    text = Path(import_module(f"airflock.parts.{folder}.{original}").__file__).read_text(encoding="utf-8")
    assert added_file(folder, "copied", text) == {*members, "copied"}


@pytest.mark.filterwarnings("ignore:.*found in sys.modules:RuntimeWarning")
@pytest.mark.parametrize("folder", FOLDERS)
def test_file_without_a_rule_is_a_helper_and_no_part(folder, added_file):
    kinds, mapping, _ = FOLDERS[folder]
    members = getattr(import_module(f"airflock.parts.{folder}.{kinds}"), mapping)
    assert added_file(folder, "helper", "def assist(x):\n    return x\n") == set(members)


def test_two_files_of_one_name_are_refused_with_both_places(tmp_path, monkeypatch):
    package = tmp_path / "twins"
    package.mkdir()
    (package / "__init__.py").touch()
    for name in ("first", "second"):
        (package / f"{name}.py").write_text("NAME = 'twin'\ndef sense(x):\n    return x\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    with pytest.raises(RuleError, match="twins.second: another file of twins is named 'twin', too"):
        find_members("twins", ["sense"], lambda module: module)
