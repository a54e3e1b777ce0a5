"""What the tests of tracking begin with: a store of their own, and runs in it."""

import pytest

from fractal_exp import tracking


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
