"""The benchmark of collage search begun with the amortised network's maps."""

import torch

from benchmarks import starts
from benchmarks.searches import CoreTime
from fractal_exp import codes, suite
from fractal_exp.ifs.affine import from_code
from fractal_exp.ifs.attractor import normalize
from fractal_exp.methods.base import CodeReconstruction
from fractal_exp.methods.collage.state import State


def test_the_search_begins_with_the_answer_of_the_network():
    answer = normalize(codes.known("sierpinski_triangle"))
    image = suite.target(answer, 64, "grey")
    method = CoreTime(seconds=None, previews=0, search={"pruning": False})
    state = State.of(starts.network(image, method, lambda _: CodeReconstruction(answer)).load(), "cpu")
    assert state.done is None and state.step == 0, "the first restart is the one that goes on"
    assert torch.allclose(state.now.maps, from_code(answer), atol=.05)
    assert starts.random_maps(image, method).load() is None
