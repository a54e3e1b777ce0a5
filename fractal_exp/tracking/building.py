"""An SQLite store that is there whole or not at all, however the process that makes it ends."""

from __future__ import annotations

import importlib.metadata
import os
import re
import shutil
import sqlite3
import sys
import tempfile
from contextlib import closing
from pathlib import Path
from typing import Any

from filelock import FileLock

from ..errors import InputError
from .addresses import reason, root, shown
from .client import configure, connect

FULL = "disk is full|disk I/O error|No space left|File too large|[Qq]uota"
REMEDIES = {FULL: "make room there or choose another output folder, and give the same command again",
            "not a database|malformed": "move that file away to begin anew"}


def build(database: Path, uri: str) -> None:
    """Make the store in the file `database` if it is not there, and check that it can be used.

    The tables are made in a folder beside it and renamed into place, so that a kill, Ctrl-C or a full disk leaves the
    old state. Raises `InputError` if the store cannot be made, written or read; none but an empty file is replaced.
    """
    try:
        artifacts(database).mkdir(parents=True, exist_ok=True)
        # Commands that are started together wait here for the first. Not with `files.alone_in`: that locks a whole
        # folder, here perhaps one that is not ours, and has to write into its lock, which a full disk would not let it.
        with FileLock(f"{database}.lock"):
            for leftover in database.parent.glob(f"{_scratch(database)}*"):
                shutil.rmtree(leftover, ignore_errors=True)
            if not database.exists() or not database.stat().st_size:
                _make(database)
            check(database, uri)
    except (OSError, sqlite3.Error) as error:
        raise InputError(_cannot(database, error)) from error


def check(database: Path, uri: str) -> None:
    """Raise `InputError` unless the store in the file `database` can be used. Whoever reads it writes to it, too."""
    try:
        _check_writing(database)
    except sqlite3.Error as error:
        raise InputError(_cannot(database, error)) from error
    _check_reading(database, uri)


def artifacts(database: Path) -> Path:
    """The folder of a store's files."""
    return database.parent / "mlartifacts"


def hide_default(store: Any) -> None:
    """Delete the experiment "Default", which MLflow makes in every store, if it is active and holds no run.

    store: an MLflow client or tracking store. MLflow does not make it again, as it still finds its number.
    """
    from mlflow.entities import ViewType

    if store.get_experiment("0").lifecycle_stage == "active" and not store.search_runs(
            ["0"], "", ViewType.ALL, max_results=1):
        store.delete_experiment("0")


def _scratch(database: Path) -> str:
    return f".{database.name}-new-"


def _make(database: Path) -> None:
    configure()
    from mlflow.store.tracking.sqlalchemy_store import SqlAlchemyStore

    # A new name each time: MLflow keeps its connections by name, also those to a file that is gone.
    with tempfile.TemporaryDirectory(prefix=_scratch(database), dir=database.parent) as folder:
        file = Path(folder, "new.db")
        try:
            store = SqlAlchemyStore(f"sqlite:///{file}", artifacts(database).as_uri())
            hide_default(store)
            store.engine.dispose()
        except Exception as error:  # MlflowException, SQLAlchemyError or OSError, by where the disk was full
            raise InputError(_cannot(database, root(error))) from error
        with closing(sqlite3.connect(file, isolation_level=None)) as connection:
            mode = connection.execute("PRAGMA journal_mode=WAL").fetchone()[0]
        if mode != "wal":
            raise InputError(_no_wal(database))
        if left := [path.name for path in Path(folder).iterdir() if path != file]:
            raise InputError(f"cannot make the store {database}: SQLite left {', '.join(left)} open")
        _sync(file)
        # A log that belonged to another file of this name would be played into the new one.
        for path in (database, *(Path(f"{database}-{end}") for end in ("journal", "wal", "shm"))):
            path.unlink(missing_ok=True)
        os.replace(file, database)
        _sync(database.parent)


def _sync(path: Path) -> None:
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _check_writing(database: Path) -> None:
    """Fail here, not after an hour, where nothing can be written."""
    if not os.access(database, os.W_OK):  # SQLite notices at the first change alone
        raise InputError(f"{database} may not be written to, and reading runs writes to it too; copy its folder to "
                         "where it may, or choose another output folder")
    with closing(sqlite3.connect(database, timeout=30, isolation_level=None)) as connection:
        mode = connection.execute("PRAGMA journal_mode=WAL").fetchone()[0]
        connection.execute("BEGIN IMMEDIATE")
        connection.execute("ROLLBACK")
    if mode != "wal":
        raise InputError(_no_wal(database))


def _check_reading(database: Path, uri: str) -> None:
    try:
        connect(uri).search_experiments(max_results=1)
    except Exception as error:  # MlflowException, SQLAlchemyError or alembic's CommandError, by version and defect
        if re.search(FULL, str(root(error))):
            raise InputError(_cannot(database, root(error))) from error
        version = importlib.metadata.version("mlflow")
        raise InputError(f"MLflow {version} cannot use {database}: {reason(root(error))}; if another version wrote it, "
                         f"copy the file and run: {sys.executable} -m mlflow db upgrade '{uri}'; to begin anew, move "
                         f"that file away") from error


def _no_wal(database: Path) -> str:
    return (f"{database} lies on a file system where SQLite cannot write concurrently; choose an output folder on a "
            f"local disk, or point MLFLOW_TRACKING_URI at a server")


def _cannot(database: Path, error: BaseException) -> str:
    line = shown(str(error).strip().splitlines()[0]) if str(error).strip() else type(error).__name__
    remedy = next((remedy for sign, remedy in REMEDIES.items() if re.search(sign, line)),
                  "choose an output folder that can be written")
    return f"cannot keep runs in {database}: {line}; {remedy}"
