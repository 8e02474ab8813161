"""What kernels of a GPU are made of, counted in their PTX: no GPU is needed, and no speed is told.

    python benchmarks/kernels.py [--capability 8.0] [KERNEL ...]

The kernels are those of `tests/unit/test_ptx.py`. Instructions are all lines of the text that do something, each once;
doubles are those that name `.f64`; local memory is what a thread keeps beyond its registers by the text, in bytes.
"""

import argparse
import re
import sys
from pathlib import Path

sys.path[:0] = [str(Path(__file__).resolve().parents[1] / "tests" / part) for part in ("", "unit")]

INSTRUCTION = re.compile(r"\s*(?:@!?%p\d+\s+)?[a-z][a-z0-9_.:]*\s.*;|\s*(?:ret|exit|trap);")
STACK = re.compile(r"\.local\s+\.align\s+\d+\s+\.b8\s+\w+\[(\d+)\]")


def counted(text):
    """Instructions, those with doubles, and local memory (bytes) of a PTX text."""
    lines = [line for line in text.splitlines() if INSTRUCTION.fullmatch(line.partition("//")[0].rstrip())]
    return len(lines), sum(".f64" in line for line in lines), sum(map(int, STACK.findall(text)))


def main():
    """Print one row per kernel."""
    from test_ptx import KERNELS, driver_of

    from inside import ptx, signature

    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--capability", default="8.0")
    parser.add_argument("kernels", nargs="*", metavar="KERNEL", default=[*KERNELS])
    asked = parser.parse_args()
    capability = tuple(map(int, asked.capability.split(".")))
    print(f"{'kernel, sm_' + asked.capability.replace('.', ''):32s}{'instructions':>13s}{'.f64':>6s}{'local, B':>10s}")
    for name in asked.kernels:
        driver, plan = driver_of(name, **KERNELS.get(name, {}))
        found = counted(ptx(driver, signature(plan.bits), (capability,))[capability])
        print(f"{name:32s}{found[0]:13d}{found[1]:6d}{found[2]:10d}", flush=True)


if __name__ == "__main__":
    main()
