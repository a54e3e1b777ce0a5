"""The benchmark of collage search begun with the amortised network's maps."""


import torch

from benchmarks import archive, starts
from benchmarks.ablation import SEED, CoreTime
from fractal_exp import IFS, suite
from fractal_exp.methods.amortized.method import Amortized
from fractal_exp.methods.base import CodeReconstruction
from fractal_exp.methods.collage.maps import from_code
from fractal_exp.methods.collage.state import State


def test_the_search_begins_with_the_answer_of_the_network(monkeypatch):
    answer = IFS(torch.eye(2).expand(2, 2, 2) / 2, torch.tensor([[-.25, 0.], [.25, 0.]]))
    monkeypatch.setattr(Amortized, "reconstruct", lambda self, image: CodeReconstruction(answer))
    image = suite.target(archive.true_code(3, SEED), 64, "grey")
    method = CoreTime(seconds=None, previews=0, search={"resume": {"steps": 0}, "pruning": False,
                                                             "merging": False})
    state = State.of(starts.network(image, method).load(), "cpu")
    assert state.done is None and state.step == 0, "the first restart is the one that goes on"
    assert torch.allclose(state.now.maps, from_code(answer))
    assert starts.random_maps(image, method).load() is None
