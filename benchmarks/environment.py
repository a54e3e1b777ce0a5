"""Where a benchmark ran: what is written beside its figures."""

from __future__ import annotations

import platform
import subprocess
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import torch

ROOT = Path(__file__).parents[1]


def environment(device: str) -> dict:
    """Device, versions and commit."""
    def installed(name: str) -> str | None:
        try:
            return version(name)
        except PackageNotFoundError:
            return None

    commit = subprocess.run(["git", "rev-parse", "HEAD"], cwd=ROOT, capture_output=True, text=True)
    result = {"python": platform.python_version(), "commit": commit.stdout.strip() or None, "machine":
              platform.processor() or platform.machine()}
    result |= {name: installed(name) for name in ("torch", "numba", "numba-cuda", "cuda-bindings", "numpy")}
    if device == "cuda":
        properties = torch.cuda.get_device_properties(0)
        result |= {"device": properties.name, "capability": list(torch.cuda.get_device_capability()),
                   "multiprocessors": properties.multi_processor_count, "memory_gb": properties.total_memory / 1e9,
                   "cuda": torch.version.cuda}
    return result
