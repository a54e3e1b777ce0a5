"""A store that is damaged is not touched, and the remedy is told."""

import shutil
import sqlite3
from contextlib import closing

import pytest

from fractal_exp import InputError, tracking


def half_made(folder, *statements) -> None:
    """A store as a kill while MLflow made its tables left it, when they were made in place."""
    tracking.prepare_store(folder)
    with closing(sqlite3.connect(folder / "mlflow.db")) as connection, connection:
        for statement in ("DELETE FROM experiments", "DROP TABLE latest_metrics", "DELETE FROM alembic_version",
                          *statements):
            connection.execute(statement)


def usable(folder) -> bool:
    uri = tracking.prepare_store(folder)
    with tracking.start_run(uri, "study", "run", folder=folder) as run:
        run.log({"eval/f1": 0.5})
    return list(tracking.runs_frame(uri, "study")["metrics.eval/f1"]) == [0.5]


@pytest.fixture
def copied(tmp_path):
    """A half-made store at a place that MLflow has no connection to yet."""
    def make(*statements):
        half_made(tmp_path / "made", *statements)
        shutil.copytree(tmp_path / "made", tmp_path / "store", ignore=shutil.ignore_patterns("*.lock"))
        return tmp_path / "store"
    return make


@pytest.mark.parametrize("content", [b"", b"SQLite format 3\x00"])
def test_an_empty_or_barely_begun_file_is_no_obstacle(tmp_path, content):
    (tmp_path / "mlflow.db").write_bytes(content)
    if content:  # not a database: nobody knows what it holds
        with pytest.raises(InputError, match="move that file away to begin anew"):
            tracking.prepare_store(tmp_path)
        (tmp_path / "mlflow.db").rename(tmp_path / "away.db")
    assert usable(tmp_path)


def test_a_store_that_holds_a_run_is_not_touched_and_the_remedy_works(copied):
    folder = copied("INSERT INTO runs (run_uuid, name) VALUES ('0123', 'precious')")
    with pytest.raises(InputError, match="cannot use .*move that file away"):
        tracking.prepare_store(folder)
    with closing(sqlite3.connect(folder / "mlflow.db")) as connection:
        assert connection.execute("SELECT name FROM runs").fetchall() == [("precious",)]


def test_leftovers_of_killed_builds_are_removed(tmp_path):
    left = tmp_path / ".mlflow.db-new-abc"
    left.mkdir()
    (left / "new.db-journal").write_bytes(b"half")
    tracking.prepare_store(tmp_path)
    assert not left.exists()
