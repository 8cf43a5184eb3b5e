"""What the benchmark ran on."""

import os
import platform
import time
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path


def _processor() -> str:
    info = Path("/proc/cpuinfo")
    if info.exists():
        for line in info.read_text().splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor() or platform.machine()


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def describe() -> dict:
    """Processor, cores, system, versions, the day, and the load the numbers were taken under."""
    packages = ("pliant", "mujoco", "jax", "numpy")
    return {
        "processor": _processor(),
        "cores": os.cpu_count(),
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
        "date": time.strftime("%Y-%m-%d"),
        "load_1min": round(os.getloadavg()[0], 2),
        "versions": {name: _version(name) for name in packages},
    }
