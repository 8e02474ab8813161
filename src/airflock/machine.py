"""Machine: the processor that this process runs on. Two kinds may round differently."""

import os
import platform
from functools import cache
from pathlib import Path

CPUINFO = Path("/proc/cpuinfo")
LIMITS = ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes")  # of a container


def processor() -> str:
    """Model name of the processor, or what the system says of its kind."""
    if CPUINFO.is_file():  # Linux
        for line in CPUINFO.read_text(encoding="utf-8", errors="replace").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine() or "unknown"


@cache
def kind() -> str:
    """Kind of the processor for which drivers are compiled, for instance znver4: flights of one seed have its bits."""
    import llvmlite.binding as llvm

    return str(llvm.get_host_cpu_name())


@cache
def toolchain() -> str:
    """Versions and processor that compiled code depends on."""
    import llvmlite
    import numba
    import numpy

    return "|".join(
        (
            platform.python_version(),
            numba.__version__,
            llvmlite.__version__,
            numpy.__version__,
            kind(),
        )
    )


def free_memory() -> int | None:
    """Bytes that this process may still take: of the machine, or of its container if that is less; None if unknown."""
    found = []
    try:
        for line in Path("/proc/meminfo").read_text(encoding="ascii").splitlines():
            if line.startswith("MemAvailable:"):
                found.append(1024 * int(line.split()[1]))
    except (OSError, ValueError):
        names = os.sysconf_names if hasattr(os, "sysconf_names") else {}
        if {"SC_PHYS_PAGES", "SC_PAGE_SIZE"} <= set(names):
            found.append(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    for limit in map(Path, LIMITS):
        try:
            found.append(int(limit.read_text(encoding="ascii")))
        except (OSError, ValueError):  # no container, or one without a limit
            continue
    return min(found, default=None)
