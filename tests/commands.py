"""A command run in the test's own process: what it prints and its exit status, without the seconds in which a new
process imports torch and MLflow. What only a process of its own can show starts one."""

from __future__ import annotations

import contextlib
import io
import sys
from types import ModuleType

import pytest
from hydra.core.hydra_config import HydraConfig


def run_here(program: ModuleType, *words: str, server: str | None = None, errors: io.StringIO | None = None
             ) -> tuple[int, str]:
    """The status of a module with a `main` that is called with these words, and all that it prints, errors too.
    server: the address of the one that keeps the runs; errors: where errors are kept apart."""
    printed, status = io.StringIO(), 0
    with (pytest.MonkeyPatch.context() as patch, contextlib.redirect_stdout(printed),
          contextlib.redirect_stderr(errors or printed)):
        patch.setattr(sys, "argv", [program.__name__, *words])
        patch.setattr(HydraConfig.instance(), "cfg", None)  # a later fit in this process is made by no command
        patch.setattr("fractal_exp.cli.interruption.listen", lambda answer: None)  # the signals are pytest's
        if server is not None:
            patch.setenv("MLFLOW_TRACKING_URI", server)
        try:
            program.main()
        except SystemExit as end:
            status = end.code or 0
    if isinstance(status, str):  # which Python would print
        return 1, printed.getvalue() + status
    return status, printed.getvalue()


def said(program: ModuleType, *words: str) -> str:
    """What a command prints that is refused its words."""
    status, error = run_here(program, *words)
    assert status == 2 and "Traceback" not in error, error
    return error


def refusal(program: ModuleType, *words: object) -> str:
    """The line of error, and nothing else there, with which a command refuses its words."""
    errors = io.StringIO()
    status, _ = run_here(program, *map(str, words), errors=errors)
    error = errors.getvalue()
    assert status == 2 and error.endswith("\n") and error[:-1].isprintable(), f"status {status}, no line: {error!r}"
    return error[:-1]
