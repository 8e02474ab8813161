"""Machine: the processor that this process runs on. Two kinds may round differently."""

import platform


def processor() -> str:
    """Model name of the processor, or what the system says of its kind."""
    try:
        with open("/proc/cpuinfo", encoding="utf-8", errors="replace") as lines:
            for line in lines:
                if line.startswith("model name"):
                    return line.partition(":")[2].strip()
    except OSError:  # another system
        pass
    return platform.processor() or platform.machine() or "unknown"
