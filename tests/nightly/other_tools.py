"""Tools of others, in an environment of their own: `movement` and trajectorytools, with its fish of idtracker.ai.

    python tests/nightly/other_tools.py FOLDER

Makes the environment in FOLDER once (some 1.5 GB), and runs tests/unit/test_other_tools.py there. Tells which versions
pip gave. `movement` names its dimensions otherwise since 0.17, which needs a newer Python than 3.11: where one is at
hand, another environment tests that layout, else a line says that it was not run. Status 0 if every test ran and
passed: one that was skipped has shown nothing.
"""

import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
TOOLS = ("movement", "trajectorytools")
NEWER = ("python3.14", "python3.13", "python3.12")
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
    tests = [python, "-m", "pytest", "-n", "0", "-q", "-rs", str(ROOT / "tests" / "unit" / "test_other_tools.py")]
    ran = subprocess.run(tests, cwd=ROOT, capture_output=True, text=True)
    print(ran.stdout, ran.stderr)
    asked = f"from importlib.metadata import version; print(*(f'{{t}} {{version(t)}}' for t in {TOOLS}), sep=', ')"
    versions = subprocess.run([python, "-c", asked], capture_output=True, text=True, check=True).stdout.strip()
    sound = ran.returncode == 0 and "skipped" not in ran.stdout
    print(f"{versions}: {'all tests ran and passed' if sound else 'failed, or skipped'}")
    return sound, versions.split(",")[0].split()[1]


def works(interpreter: str) -> bool:
    """Whether an interpreter is at hand; some names only stand for one that could be installed."""
    found = shutil.which(interpreter)
    return found is not None and subprocess.run([found, "-c", "import venv"], capture_output=True).returncode == 0


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
    newer = next((name for name in NEWER if works(name)), None)
    if newer is None:
        print(f"not run: the layout of movement from 0.17 on, which needs one of {', '.join(NEWER)}")
        return 0 if sound else 1
    other, version = tested(folder / "newer", newer)
    if not is_renamed(version):
        print(f"not run: the layout of movement from 0.17 on; pip gave {version}")
    return 0 if sound and other else 1


if __name__ == "__main__":
    sys.exit(main())
