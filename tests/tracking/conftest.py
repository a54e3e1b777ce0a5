"""What the tests of tracking begin with: a store of their own, and runs in it."""

import pytest

from fractal_exp import tracking
from fractal_exp.tracking import outbox, store


@pytest.fixture(scope="module", autouse=True)
def stores_are_copied():
    """Here they are not: how a store is made is what is tested."""


@pytest.fixture(scope="module")
def uri(tmp_path_factory):
    return tracking.prepare_store(tmp_path_factory.mktemp("out put é%#"))


@pytest.fixture
def start(uri, tmp_path):
    def start(name="fit", **options):
        return tracking.start_run(uri, "study", name, folder=tmp_path, **options)
    return start


@pytest.fixture
def impatient(monkeypatch):
    """Outages last milliseconds here."""
    monkeypatch.setattr(outbox, "FIRST_RETRY", 0.002)
    monkeypatch.setattr(outbox, "LAST_RETRY", 0.01)
    monkeypatch.setattr(store, "FIRST_RETRY", 0.01)
