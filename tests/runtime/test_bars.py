"""Bars of progress on terminals, one that does not know its size too."""

import contextlib
import fcntl
import os
import struct
import sys
import termios

import pytest

from fractal_exp.api import _Bar
from fractal_exp.cli.progress import Reporter
from fractal_exp.methods.base import Progress
from fractal_exp.runtime.bars import progress_bar
from fractal_exp.tracking import Tracker

STEPS = [Progress(step, step / 2, {"error": 0.25}, stage="search") for step in range(3)]


SIZES = pytest.mark.parametrize("size", [(0, 0), (24, 80)], ids=["without a size", "24 × 80"])


@contextlib.contextmanager
def terminal(size):
    """A terminal that the outputs lead to; what was written to it so far."""
    ours, theirs = os.openpty()
    os.set_blocking(ours, False)
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", *size, 0, 0))
    with (open(theirs, "w", buffering=1) as shown, open(ours, "rb", buffering=0) as read,
          pytest.MonkeyPatch.context() as patch):
        for stream in ("stdout", "stderr", "__stdout__"):
            patch.setattr(sys, stream, shown)
        yield lambda: b"".join(iter(lambda: read.read(1000), None)).decode()


@SIZES
@pytest.mark.parametrize("bar", [lambda: _Bar(True), lambda: Reporter(Tracker(), None)], ids=["python", "a fit"])
def test_a_search_shows_how_far_it_is(size, bar):
    with terminal(size) as told:
        with bar() as on_step:
            for step in STEPS:
                on_step(step)
        assert "100%|" in (seen := told()) and "search, error 0.25" in seen


@SIZES
def test_what_is_drawn_is_counted(size):
    with terminal(size) as told:
        assert list(progress_bar(range(3), desc="drawing", unit="tile")) == [0, 1, 2]
        assert "drawing: 100%|" in (seen := told()) and "3/3" in seen
