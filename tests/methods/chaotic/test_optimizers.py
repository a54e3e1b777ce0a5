import math

import pytest
import torch

from fractal_exp import InputError
from fractal_exp.methods.chaotic.model import SVD, Parameterization
from fractal_exp.methods.chaotic.optimizers import (
    Alternating,
    Annealing,
    AnnealingOnly,
    GradientDescent,
    NoisyGradientDescent,
)

OPTIMIZERS = [GradientDescent, NoisyGradientDescent, AnnealingOnly,
              lambda: Alternating(every=5, candidates=3)]


class Plain(Parameterization):
    """Parameters that are what they are."""

    def initial(self, maps, generator):
        return {"x": torch.randn(maps, 2, generator=generator)}

    def encode(self, linear, offset):
        raise AssertionError("the toy problem has no maps")

    def decode(self, raw):
        raise AssertionError("the toy problem draws nothing")


class Bowl:
    """Squared distance from the origin, with a bump of noise per seed that is the same for all parameters."""

    parameterization, waits = Plain(), False

    def __init__(self):
        self.seeds = []

    def loss(self, raw, seed):
        seeds = seed.flatten().tolist() if isinstance(seed, torch.Tensor) else [seed]
        noise = torch.cat([torch.randn(1, generator=torch.Generator().manual_seed(each % 2**31)) for each in seeds])
        noise = 1e-3 * (noise if isinstance(seed, torch.Tensor) else noise[0])
        total = raw["x"].square().sum((-2, -1)) + noise
        return total, {"bowl": total}

    def energy(self, raw, seed):
        self.seeds += seed.tolist() if isinstance(seed, torch.Tensor) else [seed]
        return self.loss(raw, seed)[0]


def run(optimizer, problem, iterations=20, first=0, seed=3):
    if first == 0:
        optimizer.start(problem.parameterization.initial(2, torch.Generator().manual_seed(0)), seed)
    return [optimizer.step(problem, i, 1 - i / 20) for i in range(first, iterations)]


@pytest.mark.parametrize("build", OPTIMIZERS)
def test_every_optimizer_descends_and_reports_what_it_scored(build):
    optimizer, problem = build(), Bowl()
    steps = run(optimizer, problem, 200)
    assert float(steps[-1].loss) < float(steps[0].loss)
    for step in steps:
        assert float(step.loss) == pytest.approx(float(step.raw["x"].square().sum()), abs=5e-3)
        assert set(step.terms) == {"bowl"}


def test_annealing_runs_on_schedule_in_the_first_half_only_and_resets_adam():
    optimizer, problem = Alternating(every=5, candidates=3), Bowl()
    steps = run(optimizer, problem)
    assert [i for i, step in enumerate(steps) if step.accepted is not None] == [4, 9]
    assert len(problem.seeds) == 2 * (1 + 3)
    optimizer = Alternating(every=5, candidates=3)
    run(optimizer, problem, 5)
    assert optimizer.state() == {}


def test_the_centre_moves_with_every_accepted_candidate():
    class Falling(Bowl):
        count = 0

        def energy(self, raw, seed):
            self.count -= 1
            return torch.full((1,) if isinstance(seed, torch.Tensor) else (), float(self.count))

    optimizer = Alternating(lr=1e-9, every=1, candidates=50, annealing=Annealing(spread=0.2))
    start = Bowl.parameterization.initial(2, torch.Generator().manual_seed(0))["x"]
    step = run(optimizer, Falling(), 1)[0]
    walked = (optimizer.raw["x"].detach() - start).square().mean().sqrt()
    assert step.accepted == 1
    assert float(walked) > 0.2 * math.sqrt(50) / 3, "a walk of 50 steps, not one step from the start"


def test_a_candidate_is_compared_with_the_one_that_was_accepted_last():
    class Told(Bowl):
        energies = iter([10.0, 5.0, 8.0, 8.0])  # of the start, then of each candidate

        def energy(self, raw, seed):
            return torch.full((1,) if isinstance(seed, torch.Tensor) else (), next(self.energies))

    optimizer = Alternating(lr=1e-9, every=1, candidates=3, annealing=Annealing(sharpness=1000.0))
    assert run(optimizer, Told(), 1)[0].accepted == pytest.approx(1 / 3), "8 is less than 10, and more than 5"


@pytest.mark.parametrize("common", [True, False])
@pytest.mark.parametrize("together", [3, 8, 50])
def test_candidates_rendered_together_lead_to_where_single_ones_do(together, common):
    outcomes = []
    for count in 1, together:
        optimizer = Alternating(every=5, candidates=8, together=count, common_random_numbers=common)
        steps = run(optimizer, Bowl())
        outcomes.append((optimizer.raw["x"], [step.accepted for step in steps]))
    assert torch.equal(outcomes[0][0], outcomes[1][0]) and outcomes[0][1] == outcomes[1][1]
    rates = [rate for rate in outcomes[0][1] if rate is not None]
    assert min(rates) < 1 and max(rates) > 0, "some must be accepted and some not, or nothing is shown"


def test_acceptance_follows_equation_7():
    annealing, random = Annealing(sharpness=10), torch.Generator().manual_seed(0)
    taken = sum(annealing.accepts(0.05, 0.5, float(u)) for u in torch.rand(4000, generator=random)) / 4000
    assert taken == pytest.approx(math.exp(-1), abs=0.03)
    assert annealing.accepts(-0.1, 0.5, 0.99) and annealing.accepts(0, 0, 0.99)
    assert not annealing.accepts(0.1, 0, 0.0) and not annealing.accepts(math.nan, 1, 0.0)


def test_proposals_have_the_stated_spread_and_are_projected():
    raw = SVD().initial(500, torch.Generator().manual_seed(0))
    annealing = Annealing(spread=0.2)
    move = annealing.draw(raw, torch.Generator().manual_seed(1))
    candidate = annealing.propose(raw, SVD(), 0.5, move.noise)
    assert float((candidate["offset"] - raw["offset"]).std()) == pytest.approx(0.1, rel=0.1)
    torch.testing.assert_close(candidate["u"].mT @ candidate["u"], torch.eye(2).expand(500, 2, 2))


@pytest.mark.parametrize(("kind", "options"), [(GradientDescent, {}), (Alternating, {"every": 5, "candidates": 3})])
def test_a_step_is_the_same_in_the_form_that_is_recorded(kind, options):
    """With a stand-in that runs what a CUDA graph would replay."""
    class Plainly:
        def __init__(self, work, device):
            self.work = work

        def __call__(self, seed):
            return self.work(torch.tensor(seed)).clone()

    class Seeded(Bowl):
        def loss(self, raw, seed):
            return super().loss(raw, int(seed))

    class Recording(kind):
        recorder = Plainly

        def records(self, problem):
            return True

    plain, recorded = kind(**options), Recording(**options)
    expected = run(plain, Seeded())
    for step, other in zip(run(recorded, Seeded()), expected, strict=True):
        assert torch.equal(step.raw["x"], other.raw["x"]) and torch.equal(step.loss, other.loss)
        assert step.terms == other.terms and step.accepted == other.accepted
    assert torch.equal(recorded.raw["x"], plain.raw["x"])


@pytest.mark.parametrize(("build", "message"), [
    (lambda: GradientDescent(lr=0), "learning rate must be above 0, got 0"),
    (lambda: NoisyGradientDescent(noise=-1), "at least 0, got -1"),
    (lambda: Annealing(spread=0), "spread > 0"),
    (lambda: Alternating(every=0), "every >= 1"),
    (lambda: Alternating(until=2), r"until in \[0, 1\]"),
])
def test_settings_out_of_range_are_refused(build, message):
    with pytest.raises(InputError, match=message):
        build()
