import io

import numpy as np
import pytest
from PIL import Image
from studio_helpers import served

from fractal_exp import codes, suite


@pytest.fixture(scope="module")
def studio(tmp_path_factory):
    pytest.importorskip("websockets", reason="the studio needs `pip install 'fractal-exp[studio]'`")
    with served(tmp_path_factory.mktemp("output")) as studio:
        yield studio


@pytest.fixture(scope="session")
def triangle():
    """A PNG of Sierpinski's triangle."""
    buffer = io.BytesIO()
    drawn = suite.target(codes.known("sierpinski_triangle"), 96).numpy()
    Image.fromarray(np.rint(255 * drawn).astype(np.uint8)).save(buffer, "PNG")
    return buffer.getvalue()
