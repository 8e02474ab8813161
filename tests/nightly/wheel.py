"""Does the wheel alone do what the README says? In an environment that holds nothing else, far from the clone.

    python tests/nightly/wheel.py [DIST]    DIST: a folder that tools/build.sh wrote; built here if none is given

Every command of the README that needs no clone is run, and each command that it names prints its help. The sizes of the
environment are printed by package. Without DIST the wheels are built twice and must have the same bytes.
"""

import os
import re
import subprocess
import sys
import tempfile
import venv
from pathlib import Path
from urllib.request import urlopen

ROOT = Path(__file__).resolve().parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def build_twice(folder: Path) -> Path:
    """Build both distributions twice, and return the first folder; SystemExit if their bytes differ."""
    tools = folder / "tools"
    venv.create(tools, with_pip=True)
    subprocess.run([tools / "bin" / "pip", "install", "-q", "build"], check=True)
    environment = {**os.environ, "PATH": f"{tools / 'bin'}{os.pathsep}{os.environ['PATH']}"}
    for name in ("first", "second"):
        subprocess.run(
            ["bash", ROOT / "tools" / "build.sh", folder / name], check=True, env=environment, stdout=subprocess.DEVNULL
        )
    first, second = ((folder / name / "SHA256SUMS").read_text() for name in ("first", "second"))
    if first != second:
        raise SystemExit(f"two builds of one commit differ:\n{first}{second}")
    print("two builds: the same hashes\n" + first, end="")
    return folder / "first"


def readme_commands() -> list[str]:
    """Return the lines of the README's shell blocks, without what installs from a clone or needs one."""
    blocks = re.findall(r"^```sh\n(.*?)^```", README, re.M | re.S)
    parts = [part.strip() for block in blocks for line in block.splitlines() for part in line.split("&&")]
    return [part for part in parts if part.startswith("airflock ")]


def sizes(folder: Path) -> dict[str, float]:
    """Return the size (MB) of each package in a folder of packages, its compiled bytecode left out."""
    total: dict[str, float] = {}
    for file in folder.rglob("*"):
        if file.is_file() and file.suffix != ".pyc":
            first = file.relative_to(folder).parts[0]
            name = re.split(r"\.libs$|-[0-9].*$|\.py$", first)[0].lower()
            total[name] = total.get(name, 0.0) + file.stat().st_size / 1e6
    return total


def served(command: list[str | Path], where: Path, environment: dict[str, str]) -> None:
    """Start a command that serves a page, open the address that it prints, and end it; SystemExit without a page."""
    process = subprocess.Popen(
        [*command, "--port", "0"],
        cwd=where,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    assert process.stdout is not None
    try:
        for line in process.stdout:
            print(line, end="", flush=True)
            if address := re.search(r"http://\S+", line):
                with urlopen(address[0], timeout=30.0) as answer:
                    if answer.status == 200:
                        return
        raise SystemExit(f"no page from {' '.join(map(str, command))}")
    finally:
        process.terminate()
        process.wait(60.0)


def main() -> None:
    """Build, install and run."""
    with tempfile.TemporaryDirectory() as kept:
        folder = Path(kept)
        dist = Path(sys.argv[1]).resolve() if len(sys.argv) > 1 else build_twice(folder)
        bare, away = folder / "bare", folder / "away"
        venv.create(bare, with_pip=True)
        away.mkdir()
        wheels = list(dist.glob("airflock-*.whl"))
        subprocess.run([bare / "bin" / "pip", "install", "-q", *wheels], check=True, cwd=away)
        environment = {
            "PYTHONUNBUFFERED": "1",  # the address is read while the page is served
            "PATH": f"{bare / 'bin'}{os.pathsep}{os.environ['PATH']}",
            "HOME": str(folder),
            "AIRFLOCK_CACHE": str(folder / "cache"),
        }
        commands = readme_commands()
        if not commands:
            raise SystemExit("the README has no command: what does this file look for?")
        for command in commands:
            print(f"$ {command}", flush=True)
            words = [bare / "bin" / "airflock", *command.split()[1:]]
            if words[1] == "watch":
                served(words, away, environment)
            else:
                subprocess.run(words, check=True, cwd=away, env=environment)
        verbs = sorted(set(re.findall(r"`airflock ([a-z]+)", README)) - {"paper"})  # its pages are in airflock-papers
        for verb in verbs:
            subprocess.run(
                [bare / "bin" / "airflock", verb, "--help"],
                check=True,
                cwd=away,
                env=environment,
                stdout=subprocess.DEVNULL,
            )
        print(f"--help: {', '.join(verbs)}")
        (packages,) = bare.glob("lib/python*/site-packages")
        found = sizes(packages)
        for name in ("pip", "setuptools", "pkg_resources", "_distutils_hack"):
            found.pop(name, None)
        for name, size in sorted(found.items(), key=lambda pair: -pair[1])[:12]:
            print(f"{name:<12} {size:6.0f} MB")
        size = sum(found.values())
        print(f"{len(commands)} commands and {len(verbs)} helps work; {size:.0f} MB without bytecode and pip")


if __name__ == "__main__":
    main()
