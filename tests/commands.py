"""A command run in the test's own process: what it prints and its exit status, without the seconds in which a new
process imports torch and MLflow. What only a process of its own can show starts one."""

from __future__ import annotations

import contextlib
import io
import sys
from collections.abc import Callable

import pytest


def run_here(program: Callable[[], None], *words: str, server: str | None = None) -> tuple[int, str]:
    """The status of a command of fractal_exp.cli with these words, and all that it prints, errors too. server: the
    address of the one that keeps the runs."""
    printed = io.StringIO()
    with (pytest.MonkeyPatch.context() as patch, contextlib.redirect_stdout(printed),
          contextlib.redirect_stderr(printed), pytest.raises(SystemExit) as end):
        patch.setattr(sys, "argv", ["command", *words])
        patch.setattr("fractal_exp.cli.interruption.listen", lambda: None)  # the signals are pytest's
        patch.delenv("MLFLOW_TRACKING_URI", raising=False)
        if server is not None:
            patch.setenv("MLFLOW_TRACKING_URI", server)
        program()
    status = end.value.code or 0
    assert isinstance(status, int), status
    return status, printed.getvalue()
