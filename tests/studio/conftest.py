import pytest
from studio_helpers import SIDE, picture_of, served


@pytest.fixture(scope="module")
def studio(tmp_path_factory):
    pytest.importorskip("websockets", reason="the studio needs `pip install 'fractal-exp[studio]'`")
    with served(tmp_path_factory.mktemp("output")) as studio:
        yield studio


@pytest.fixture(scope="module", autouse=True)
def small_pictures():
    """Pictures are brought to 64² instead of 256², which makes a search several times as quick, and what is saved is
    drawn at 128² instead of 1024²."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("fractal_exp.studio.reading.RESOLUTION", SIDE)
        patch.setattr("fractal_exp.inversion.writing.SIDE", 2 * SIDE)
        yield


@pytest.fixture(scope="session")
def triangle():
    """A PNG of Sierpinski's triangle."""
    return picture_of("sierpinski_triangle")
