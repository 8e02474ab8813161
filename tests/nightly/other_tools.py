"""Tools of others, in an environment of their own: `movement` and trajectorytools, with its fish of idtracker.ai.

    python tests/nightly/other_tools.py FOLDER

Makes the environment in FOLDER once (some 1.5 GB), and runs tests/unit/test_other_tools.py there. Tells which versions
pip gave. Status 0 if every test ran and passed: one that was skipped has shown nothing.
"""

import subprocess
import sys
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
TOOLS = ("movement", "trajectorytools")


def made(folder: Path) -> Path:
    """The interpreter of the environment, which is made where it is not whole yet."""
    python, whole = folder / "bin" / "python", folder / "whole.txt"
    if not whole.exists():
        venv.create(folder, with_pip=True, clear=True)
        subprocess.run([python, "-m", "pip", "install", "--quiet", f"{ROOT}[test]", *TOOLS], check=True)
        whole.write_text("installed\n")
    return python


def main() -> int:
    """Run the tests, and tell the versions."""
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    python = made(folder / "environment")
    tests = [python, "-m", "pytest", "-n", "0", "-q", "-rs", str(ROOT / "tests" / "unit" / "test_other_tools.py")]
    ran = subprocess.run(tests, cwd=ROOT, capture_output=True, text=True)
    print(ran.stdout, ran.stderr)
    asked = f"from importlib.metadata import version; print(*(f'{{t}} {{version(t)}}' for t in {TOOLS}), sep=', ')"
    versions = subprocess.run([python, "-c", asked], capture_output=True, text=True, check=True).stdout.strip()
    sound = ran.returncode == 0 and "skipped" not in ran.stdout
    print(f"{versions}: {'all tests ran and passed' if sound else 'failed, or skipped'}")
    return 0 if sound else 1


if __name__ == "__main__":
    sys.exit(main())
