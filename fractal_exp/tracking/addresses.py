"""Where a store is, in words that give no password away."""

from __future__ import annotations

import os
import re
import shlex
from pathlib import Path

from ..errors import InputError

# user:password@host is all that may stand before the path; a password with / ? # @ must be written in %XX.
SERVER = re.compile(r"https?://([^/?#@\s]*@)?(\[[^\]\s]+\]|[^:/?#@\s]+)(:\d+)?([/?#]\S*)?")


def store_uri(folder: str | Path) -> str:
    """The store of an output folder, or the server that MLFLOW_TRACKING_URI names."""
    return os.environ.get("MLFLOW_TRACKING_URI") or f"sqlite:///{Path(folder).absolute()}/mlflow.db"


def dashboard_line(folder: str | Path) -> str:
    """The command that shows the runs of an output folder: in a clone of this project, make knows it."""
    folder, makefile = Path(folder).absolute(), Path("Makefile")
    if folder == Path("outputs").absolute() and makefile.is_file() and "fractal_exp.tracking dashboard" in (
            makefile.read_text(errors="replace")):
        return "make dashboard"
    return f"python -m fractal_exp.tracking dashboard {shlex.quote(str(folder))}"


def database_path(uri: str) -> Path | None:
    """The file of an SQLite store, None for a server. Raises `InputError` on any other kind of URI."""
    if re.match(r"https?://", uri):
        if not SERVER.fullmatch(uri):
            raise InputError("MLFLOW_TRACKING_URI begins as the address of a server but does not go on as one; write "
                             "http://USER:PASSWORD@HOST:PORT, special characters of the password as %XX")
        return None
    match = re.fullmatch(r"sqlite:///(/[^?]+)", uri)
    if match is None:
        raise InputError(f"runs are kept by a server (http://… or https://…) or in sqlite:////absolute/path.db without "
                         f"'?' in it, got {shown(uri)!r}; correct MLFLOW_TRACKING_URI or the output folder")
    return Path(match[1])


def shown(text: str) -> str:
    """A URI, or a text with URIs in it, without users, passwords and queries, which may hold tokens."""
    text = re.sub(r"(\w://)[^/\s]*@", r"\1", text)
    text = re.sub(r"(\w://[^\s?'\"]*\?)[^\s'\")]+", r"\1…", text)
    return re.sub(r"([?&][\w.~%-]+=)[^&\s'\")]+", r"\1…", text)  # a query alone, as errors of HTTP show it


def reason(error: BaseException) -> str:
    """An exception as one short line."""
    line = shown(": ".join([type(error).__name__, *str(error).strip().splitlines()[:1]]))
    return line if len(line) <= 300 else line[:299] + "…"


def root(error: BaseException) -> BaseException:
    """The exception that began it: MLflow wraps a refused connection five times."""
    while inner := error.__cause__ or error.__context__:
        error = inner
    return error
