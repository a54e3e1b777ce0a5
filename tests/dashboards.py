"""The dashboard as a process of its own, as a user starts it."""

from __future__ import annotations

import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def running_dashboard(folder: Path) -> Iterator[tuple[int, list[str]]]:
    """The port of a dashboard of the runs under `folder`, and the lines that it has printed by the time it answers."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    process = subprocess.Popen([sys.executable, "-m", "fractal_exp.tracking", "dashboard", str(folder), "--port",
                                str(port)], text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    try:
        lines: list[str] = []
        while "compareRunsMode=CHART" not in (lines or [""])[-1]:
            lines.append(process.stdout.readline())
            assert lines[-1], lines
        yield port, lines
    finally:
        process.send_signal(signal.SIGTERM)
        process.communicate(timeout=300)
