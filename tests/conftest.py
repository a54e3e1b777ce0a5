"""What several files of tests begin with, and how the tests share the machine's cores."""

import os

# Before numpy is loaded, and for all processes that tests start: where each core has a test process already, OpenBLAS
# spends more on waking its threads, even for a system of six equations, than they save.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.pop("MLFLOW_TRACKING_URI", None)  # the server that keeps the runs of whoever runs the tests is not theirs

import shutil
import sqlite3
import sys
from contextlib import closing
from pathlib import Path

import pytest

from fractal_exp import codes, suite
from fractal_exp.ifs import attractor
from fractal_exp.runtime import threads
from fractal_exp.tracking import building

LEFT_OUT = pytest.StashKey[int]()
MAKES = building._make
LONGEST = ("test_studio_session.py", "test_words.py", "test_in_chromium.py", "test_collage.py", "test_train.py",
           "test_sweeps.py", "test_simpler_codes.py", "test_editing.py", "test_inversion.py", "test_configuration.py",
           "test_evaluate_fits.py")


@pytest.fixture
def folder(tmp_path, monkeypatch) -> Path:
    """Where the test works."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture(scope="session")
def triangle():
    """The Sierpinski triangle's code in the frame, and its grey image of 128²."""
    code = attractor.normalize(codes.known("sierpinski_triangle"))
    return code, suite.target(code, 128)


@pytest.fixture(scope="session")
def empty_store(tmp_path_factory):
    """A new store, made once for each test process: MLflow takes a second of a core for its tables."""
    made = []

    def store() -> Path:
        if not made:
            database = tmp_path_factory.mktemp("store") / "mlflow.db"
            MAKES(database)
            made.append(database)
        return made[0]
    return store


@pytest.fixture(scope="module", autouse=True)
def stores_are_copied(empty_store):
    """Stores are copies of one, but in the tests of tracking, where each is made for itself."""
    def copy(database: Path) -> None:
        shutil.copy(empty_store(), database)
        with closing(sqlite3.connect(database)) as connection, connection:
            connection.execute("UPDATE experiments SET artifact_location = ?",
                               [f"{building.artifacts(database).as_uri()}/0"])

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(building, "_make", copy)
        yield


@pytest.fixture(autouse=True)
def fair_share_of_cores():
    """Test processes that run side by side divide the cores, whatever the test before has set."""
    processes = int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", 1))
    threads.use(max(1, threads.available() // processes))


def pytest_collection_modifyitems(items):
    """The files that take longest come first, so that processes side by side end together."""
    items.sort(key=lambda item: LONGEST.index(item.path.name) if item.path.name in LONGEST else len(LONGEST))


def pytest_deselected(items):
    if not items:  # as with --lf, where nothing has failed
        return
    config = items[0].config
    config.stash[LEFT_OUT] = config.stash.get(LEFT_OUT, 0) + len(items)


def pytest_sessionfinish(session):
    if hasattr(session.config, "workeroutput"):  # one of several processes
        session.config.workeroutput["left out"] = session.config.stash.get(LEFT_OUT, 0)
    if widgets := sys.modules.get("ipywidgets"):  # those that are left complain when the interpreter ends
        widgets.Widget.close_all()


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node):
    """Every process left out the same tests."""
    node.config.stash[LEFT_OUT] = getattr(node, "workeroutput", {}).get("left out", 0)


def pytest_terminal_summary(terminalreporter, config):
    if config.getoption("numprocesses", None) and (count := config.stash.get(LEFT_OUT, 0)):
        terminalreporter.write_line(f"{count} deselected; make test-all runs them")
