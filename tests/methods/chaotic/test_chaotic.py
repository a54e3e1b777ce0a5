
import pytest
import torch
from chaotic_helpers import OPTIMIZERS, Breaking, fit
from known import Known

from fractal_exp import InputError, codes
from fractal_exp.ifs import attractor
from fractal_exp.methods.base import CodeReconstruction, FitDiverged
from fractal_exp.methods.chaotic.best_states import BestStates
from fractal_exp.methods.chaotic.model import SVD, ForwardModel, Naive
from fractal_exp.methods.chaotic.optimizers import Alternating, GradientDescent
from fractal_exp.runtime.checkpoint import Checkpoint


@pytest.fixture(scope="module")
def target():
    raw = SVD().initial(3, torch.Generator().manual_seed(5))
    return ForwardModel(SVD(), resolution=32, maps=3, trajectories=400, length=60)(raw, 0).image


@pytest.mark.parametrize(("name", "parameterization"), [
    *((name, SVD()) for name in OPTIMIZERS), *((name, Naive()) for name in OPTIMIZERS if name != "annealing")])
def test_every_variant_runs_and_repeats_from_its_seed(target, name, parameterization):
    def code(seed):
        return fit(OPTIMIZERS[name](), parameterization=parameterization, seed=seed).reconstruct(target).code

    first, again, other = (code(seed).linear for seed in (0, 0, 1))
    assert torch.equal(first, again) and not torch.equal(first, other)


def test_convolutions_of_a_fit_are_not_rounded_to_tf32(target):
    allowed, seen = torch.backends.cudnn.allow_tf32, []
    fit(iterations=2).reconstruct(target, on_step=lambda progress: seen.append(torch.backends.cudnn.allow_tf32))
    assert seen == [False, False] and torch.backends.cudnn.allow_tf32 == allowed


@pytest.mark.parametrize("parameterization", [SVD(), Naive()])
def test_a_fit_can_begin_with_the_code_of_another_method(target, parameterization):
    code = attractor.normalize(codes.known("fern"))  # with offsets above 1 in this frame, and four maps for three
    model = fit(parameterization=parameterization).model
    back = attractor.normalize(model.code(model.encode(code)))
    torch.testing.assert_close(back.linear, code.linear, atol=2e-4, rtol=1e-3)
    near = attractor.normalize(codes.known("sierpinski_triangle"))
    init = Known(CodeReconstruction(near))
    found = fit(parameterization=parameterization, iterations=1, init=init).reconstruct(target).code
    torch.testing.assert_close(found.linear, near.linear, atol=0.02, rtol=0)
    with pytest.raises(InputError, match="one start, got starts=3"):
        fit(init=init, starts=3)


SCOUTED = {"iterations": 8, "starts": 2, "scouting": 4}
SHRINKING = {"iterations": 9, "radii": (3, 1), "match_target": True}
INTERRUPTED = [*((make, {}, (1, 3, 4, 11)) for make in OPTIMIZERS.values()),
               (GradientDescent, SHRINKING, (4, 5, 6)), (GradientDescent, SCOUTED, (3, 4, 5, 8, 9, 14))]


@pytest.mark.parametrize(("make", "options", "stops"), INTERRUPTED, ids=[*OPTIMIZERS, "shrinking splats", "scouting"])
def test_a_fit_interrupted_anywhere_goes_on_bit_for_bit(target, tmp_path, make, options, stops):
    whole = fit(make(), **options).reconstruct(target).code
    for stop in stops:
        def interrupt(progress, stop=stop):
            assert progress.step <= stop
            if progress.step == stop:
                raise KeyboardInterrupt

        path = tmp_path / f"{stop}.safetensors"
        with pytest.raises(KeyboardInterrupt):
            fit(make(), **options).reconstruct(target, on_step=interrupt, checkpoint=Checkpoint(path))
        if not options:
            assert Checkpoint(path, resume=True).load().iteration == stop - 1
        resumed = fit(make(), **options).reconstruct(target, checkpoint=Checkpoint(path, resume=True)).code
        assert torch.equal(whole.linear, resumed.linear) and torch.equal(whole.offset, resumed.offset), stop


def test_several_starts_are_scouted_and_the_best_goes_on(target):
    told = []
    chaotic = fit(Alternating(every=2, candidates=2), iterations=10, starts=3, scouting=4)
    chaotic.reconstruct(target, on_step=told.append)
    assert len(told) == 3 * 4 + 10
    assert [p.scalars["temperature"] for p in told[:12]] == [0] * 12
    assert not any("accepted" in p.scalars for p in told[:12])
    assert [p.scalars["temperature"] for p in told[12:]] == pytest.approx([1 - i / 10 for i in range(10)])
    best_of_each = [min(p.scalars["loss"] for p in told[i:i + 4]) for i in (0, 4, 8)]
    assert len(set(best_of_each)) == 3, "the starts differ"
    assert told[12].scalars["loss"] == pytest.approx(min(best_of_each), rel=0.1)


def test_a_fit_of_a_small_target_gets_better(target):
    losses = []
    fit(iterations=80).reconstruct(target, on_step=lambda p: losses.append(p.scalars["loss"]))
    assert sum(losses[-10:]) < 0.8 * sum(losses[:10])


def test_progress_tells_loss_temperature_terms_and_previews(target):
    told = []
    fit(OPTIMIZERS["alternating"](), previews=3).reconstruct(target, on_step=told.append)
    assert [p.step for p in told] == list(range(1, 13))
    assert told[-1].fraction == 1 and told[0].fraction == pytest.approx(1 / 12)
    assert {"loss", "temperature", "mse", "ssim", "regularizer"} <= set(told[0].scalars)
    assert [p.scalars["temperature"] for p in told] == pytest.approx([1 - i / 12 for i in range(12)])
    assert "accepted" in told[2].scalars and "accepted" not in told[3].scalars
    assert [p.step for p in told if p.preview is not None] == [4, 8, 12]
    assert told[3].preview.shape == (32, 32)
    assert [p.step for p in told if p.code is not None] == [4, 8, 12] and len(told[3].code) == 3
    assert [p.stage for p in told[3:5]] == ["iterations from 1", "iterations from 5"]


def test_the_codes_on_the_way_are_those_of_the_lowest_loss_and_cost_the_fit_nothing(target):
    told = []
    chaotic = fit(starts=3, scouting=4, iterations=10, previews=22)
    found = chaotic.reconstruct(target, on_step=told.append).code
    assert torch.equal(found.linear, fit(starts=3, scouting=4, iterations=10).reconstruct(target).code.linear)
    changes = 0
    for before, now in zip(told, told[1:], strict=False):
        lower = now.scalars["loss"] < min(p.scalars["loss"] for p in told[:now.step - 1])
        changed = not torch.equal(now.code.linear, before.code.linear)
        assert changed == (lower and now.step != 13), "which scores the best of all starts again, with other points"
        changes += changed
    assert changes > 3


def test_seconds_end_a_fit_with_the_best_so_far(target):
    told = []
    code = fit(iterations=10**9, seconds=0.5).reconstruct(target, on_step=told.append).code
    assert 0 < len(told) < 10**6 and told[-1].fraction == 1 and len(code) == 3


def test_a_nan_stops_the_fit_and_keeps_the_last_good_state(target, tmp_path):
    checkpoint = Checkpoint(tmp_path / "f", resume=True)
    with pytest.raises(FitDiverged, match=r"iteration 5 met a NaN .*mse .*the state before it is in .*/f\. Try"):
        fit(Breaking(5)).reconstruct(target, checkpoint=checkpoint)
    snapshot = checkpoint.load()
    assert snapshot.iteration == 5
    assert all(bool(tensor.isfinite().all()) for tensor in snapshot.tensors.values())


@pytest.mark.parametrize("options", [{}, {"starts": 2, "scouting": 2}, {"result": "last"}], ids=str)
def test_a_fit_without_any_contractive_state_says_so(target, options):
    class Expanding(Naive):
        def initial(self, maps, generator):
            return {name: 3 * value for name, value in super().initial(maps, generator).items()}

    with pytest.raises(FitDiverged, match="no contractive state was met"):
        fit(parameterization=Expanding(), iterations=2, **options).reconstruct(target)


def test_best_states_keep_the_lowest_apart_from_each_other():
    best = BestStates(2, spacing=3)
    for iteration, loss in enumerate([5.0, 4.0, 4.5, 9.0, 3.0, 2.0, 8.0, 1.0, 7.0]):
        best.offer(loss, iteration, {"x": torch.tensor(float(iteration))})
    assert best.iterations == [7, 1] and best.losses == [1.0, 4.0]
    chosen = best.choose(lambda state, draw: -float(state["x"]) + draw, 2)
    assert float(chosen["x"]) == 7
    assert float(best.choose(lambda state, draw: float(state["x"]), 1)["x"]) == 1


GOOD = torch.rand(32, 32, generator=torch.Generator().manual_seed(0))


@pytest.mark.parametrize(("image", "message"), [
    (torch.zeros(32, 32), "constant"), (torch.ones(32, 32), "constant"), (GOOD[:20], "must be square"),
    (GOOD[None], "must be square"), (GOOD * 255, r"must lie in \[0, 1\]"), (GOOD.sqrt().log(), r"lie in|infinity"),
    (GOOD / 0, "NaN or infinity"), (torch.rand(64, 64), "the model draws 32²"),
])
def test_unusable_targets_are_refused_before_any_work(image, message):
    with pytest.raises(InputError, match=message):
        fit().reconstruct(image)


@pytest.mark.parametrize(("options", "message"), [
    ({"iterations": 0}, "iterations must be at least 1, got 0"), ({"seconds": 0}, "seconds must be above 0"),
    ({"kept": 0}, "kept must be at least 1"), ({"starts": 0}, "starts must be"), ({"previews": -1}, "previews must be"),
])
def test_settings_out_of_range_are_refused(options, message):
    with pytest.raises(InputError, match=message):
        fit(**options)
