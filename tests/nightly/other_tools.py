"""Tools of others, in an environment of their own: `movement` and trajectorytools, with its fish of idtracker.ai.

    python tests/nightly/other_tools.py FOLDER

Makes the environment in FOLDER once (some 1.5 GB), and runs tests/unit/test_other_tools.py and examples/real_fish.py
there. Tells which versions
pip gave. `movement` names its dimensions otherwise since 0.17, which needs a newer Python than 3.11: where one is at
hand, another environment tests that layout, else a line says that it was not run. Status 0 if every test ran and
passed: one that was skipped has shown nothing.
"""

import os
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
TOOLS = ("movement", "trajectorytools")
NEWER = ("3.14", "3.13", "3.12")
RENAMED = (0, 17)  # from this release of movement on the dimensions are keypoint and individual


def made(folder: Path, interpreter: str) -> Path:
    """The interpreter of the environment, which is made where it is not whole yet."""
    python, whole = folder / "bin" / "python", folder / "whole.txt"
    if not whole.exists():
        subprocess.run([interpreter, "-m", "venv", "--clear", folder], check=True)
        subprocess.run([python, "-m", "pip", "install", "--quiet", f"{ROOT}[test]", *TOOLS], check=True)
        whole.write_text("installed\n")
    return python


def tested(folder: Path, interpreter: str) -> tuple[bool, str]:
    """Whether every test ran and passed in an environment of an interpreter, and the version of movement there."""
    python = made(folder, interpreter)
    files = ("unit/test_other_tools.py", "unit/test_examples.py::test_example_runs[real_fish]")
    tests = [python, "-m", "pytest", "-n", "0", "-q", "-rs", *(str(ROOT / "tests" / name) for name in files)]
    ran = subprocess.run(tests, cwd=ROOT, capture_output=True, text=True)
    print(ran.stdout, ran.stderr)
    asked = f"from importlib.metadata import version; print(*(f'{{t}} {{version(t)}}' for t in {TOOLS}), sep=', ')"
    versions = subprocess.run([python, "-c", asked], capture_output=True, text=True, check=True).stdout.strip()
    sound = ran.returncode == 0 and "skipped" not in ran.stdout
    print(f"{versions}: {'all tests ran and passed' if sound else 'failed, or skipped'}")
    return sound, versions.split(",")[0].split()[1]


def newer() -> str | None:
    """A newer interpreter that is at hand: by its name, or among those that pyenv keeps."""
    kept = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv")) / "versions"
    for version in NEWER:
        for found in (shutil.which(f"python{version}"), *sorted(kept.glob(f"{version}.*/bin/python"))):
            # some names only stand for one that could be installed
            if found and subprocess.run([found, "-c", "import venv"], capture_output=True).returncode == 0:
                return str(found)
    return None


def is_renamed(version: str) -> bool:
    """Whether a release of movement has the dimensions of today."""
    return tuple(int(part) for part in version.split(".")[:2]) >= RENAMED


def main() -> int:
    """Run the tests with this Python and, for the other layout of movement, with a newer one; tell the versions."""
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    sound, version = tested(folder / "environment", sys.executable)
    if is_renamed(version):
        print("not run: the layout of movement up to 0.16, which pip gives on Python 3.11 alone")
        return 0 if sound else 1
    later = newer()
    if later is None:
        print(f"not run: the layout of movement from 0.17 on, which needs Python {', '.join(NEWER)}")
        return 0 if sound else 1
    other, version = tested(folder / "newer", later)
    if not is_renamed(version):
        print(f"not run: the layout of movement from 0.17 on; pip gave {version}")
    return 0 if sound and other else 1


if __name__ == "__main__":
    sys.exit(main())
