"""What several files of tests begin with, and how the tests share the machine's cores."""

import os

import pytest

from fractal_exp import codes, suite
from fractal_exp.ifs import attractor
from fractal_exp.runtime import threads

LEFT_OUT = pytest.StashKey[int]()


@pytest.fixture(scope="session")
def triangle():
    """The Sierpinski triangle's code in the frame, and its grey image of 128²."""
    code = attractor.normalize(codes.known("sierpinski_triangle"))
    return code, suite.target(code, 128)


@pytest.fixture(autouse=True)
def fair_share_of_cores():
    """Test processes that run side by side divide the cores, whatever the test before has set."""
    processes = int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", 1))
    threads.use(max(1, threads.available() // processes))


def pytest_deselected(items):
    if not items:  # as with --lf, where nothing has failed
        return
    config = items[0].config
    config.stash[LEFT_OUT] = config.stash.get(LEFT_OUT, 0) + len(items)


def pytest_sessionfinish(session):
    if hasattr(session.config, "workeroutput"):  # one of several processes
        session.config.workeroutput["left out"] = session.config.stash.get(LEFT_OUT, 0)


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node):
    """Every process left out the same tests."""
    node.config.stash[LEFT_OUT] = getattr(node, "workeroutput", {}).get("left out", 0)


def pytest_terminal_summary(terminalreporter, config):
    if config.getoption("numprocesses", None) and (count := config.stash.get(LEFT_OUT, 0)):
        terminalreporter.write_line(f"{count} deselected; make test-all runs them")
