"""Whole fits on a GPU that is none (`pretended_gpu`): nothing mixes what lies here and there, and all comes out as on
the CPU. What the kernels do on a GPU is tested beside their twins (`test_cuda`, and on a real one `test_cuda_gpu`)."""

from dataclasses import replace

import pytest
import torch
from chaotic_helpers import OPTIMIZERS, Breaking, fit
from collage_helpers import BRIEF, merged
from pretended_gpu import pretended

from fractal_exp import codes, suite
from fractal_exp.methods.base import FitDiverged
from fractal_exp.methods.chaotic.method import FitProblem
from fractal_exp.methods.chaotic.model import SVD, ForwardModel, Naive
from fractal_exp.methods.chaotic.optimizers import GradientDescent
from fractal_exp.methods.chaotic.readback import STEPS_ELSEWHERE
from fractal_exp.methods.collage.method import Collage
from fractal_exp.ops import cuda_launch
from fractal_exp.runtime.checkpoint import Checkpoint

SHORT = merged(BRIEF, dict(rounds=1, search={"restarts": 1, "moves": 1, "detail_moves": 1, "proposals": 1},
                           moves={"count": 1}, growth={"enabled": True, "usual": 4, "counts": (4,), "steps": 5}))


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["grey", "binary"])
def test_collage_search_finds_the_same_code_on_both(kind):
    image = suite.target(replace(codes.known("sierpinski_triangle"), probabilities=None), 64, kind)
    expected = Collage(**SHORT).reconstruct(image).code
    with pretended():
        found = Collage(**SHORT, device="cuda").reconstruct(image).code
    assert torch.equal(found.linear, expected.linear) and torch.equal(found.offset, expected.offset)
    assert found.linear.device.type == "cpu"


@pytest.fixture(scope="module")
def target():
    raw = SVD().initial(3, torch.Generator().manual_seed(5))
    return ForwardModel(SVD(), resolution=32, maps=3, trajectories=400, length=60)(raw, 0).image.detach()


@pytest.mark.parametrize(("name", "parameterization"), [
    ("alternating", SVD()), ("gradient", Naive()),
    *(pytest.param(name, SVD(), marks=pytest.mark.slow) for name in OPTIMIZERS if name != "alternating"),
    *(pytest.param(name, Naive(), marks=pytest.mark.slow) for name in ("alternating", "noisy"))])
def test_the_papers_method_goes_the_same_way_on_both(target, name, parameterization):
    def losses(device):
        told, optimizer = [], OPTIMIZERS[name]()
        optimizer.cuda_graph = False
        fit(optimizer, parameterization=parameterization, starts=2, scouting=6, match_target=True,
            device=device).reconstruct(target, on_step=lambda progress: told.append(progress.scalars["loss"]))
        return told

    expected = losses("cpu")
    with pretended():
        assert losses("cuda") == pytest.approx(expected, rel=1e-3)  # Adam's divisions come in another order


def test_a_nan_among_steps_fetched_together_is_found_and_the_state_before_them_kept(target, tmp_path):
    told, checkpoint = [], Checkpoint(tmp_path / "f", resume=True)
    with (pretended(),
          pytest.raises(FitDiverged, match=r"iteration 34 met a NaN .*the state before iteration 32 is in")):
        fit(Breaking(34, cuda_graph=False), iterations=40, previews=0, device="cuda").reconstruct(
            target, checkpoint=checkpoint, on_step=told.append)
    assert [each.step for each in told] == [*range(1, 35)]
    assert checkpoint.load().iteration == 32 == STEPS_ELSEWHERE


@pytest.mark.parametrize(("parameterization", "backend", "installed", "expected"), [
    (SVD(), "auto", True, True), (SVD(), "auto", False, False), (SVD(), "torch", True, False),
    (Naive(), "auto", True, False)])
def test_steps_that_wait_are_not_recorded(target, monkeypatch, parameterization, backend, installed, expected):
    with pretended():
        monkeypatch.setattr(cuda_launch, "INSTALLED", installed)
        method = fit(GradientDescent(), parameterization=parameterization, device="cuda")
        method.model.backend = backend
        start = parameterization.initial(3, torch.Generator().manual_seed(0))
        method.optimizer.start({name: value.to("cuda") for name, value in start.items()}, 0)
        problem = FitProblem(method.model, method.objective, target.to("cuda"))
        assert method.optimizer.records(problem) is expected


def test_a_gradient_step_waits_for_nothing(target):
    with pretended() as waits:
        method = fit(GradientDescent(cuda_graph=False), device="cuda")
        problem = FitProblem(method.model, method.objective, target.to("cuda"))
        start = SVD().initial(3, torch.Generator().manual_seed(0))
        method.optimizer.start({name: value.to("cuda") for name, value in start.items()}, 0)
        method.optimizer.step(problem, 0, 1.0)
        before = waits.copy()
        for i in range(1, 6):
            method.optimizer.step(problem, i, 1.0)
        assert waits == before
