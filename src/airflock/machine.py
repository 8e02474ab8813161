"""Machine: the processor that this process runs on. Two kinds may round differently."""

import platform
from pathlib import Path

CPUINFO = Path("/proc/cpuinfo")


def processor() -> str:
    """Model name of the processor, or what the system says of its kind."""
    if CPUINFO.is_file():  # Linux
        for line in CPUINFO.read_text(encoding="utf-8", errors="replace").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine() or "unknown"
