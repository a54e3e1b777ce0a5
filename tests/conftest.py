"""What several files of tests begin with."""

import pytest

from fractal_exp import codes, suite
from fractal_exp.ifs import attractor


@pytest.fixture(scope="session")
def triangle():
    """The Sierpinski triangle's code in the frame, and its grey image of 128²."""
    code = attractor.normalize(codes.known("sierpinski_triangle"))
    return code, suite.target(code, 128)
