"""Random numbers of fits: new at every step, other ones for another seed and another parameter."""

from functools import partial

import pytest
import torch

from fractal_exp.methods.chaotic.losses import MipMSE, WeightedSum
from fractal_exp.methods.chaotic.method import Chaotic
from fractal_exp.methods.chaotic.model import SVD, ForwardModel, Parameterization
from fractal_exp.methods.chaotic.optimizers import Alternating, AnnealingOnly, GradientDescent, NoisyGradientDescent

NUMBERS = 2000
UNRELATED = 0.12  # correlation of so many numbers: five standard deviations


class Flat:
    """A problem without slopes, where every proposal is accepted; it keeps the seeds that it is asked with."""

    waits = False

    class parameterization(Parameterization):  # noqa: N801 - an instance is not needed
        initial = encode = decode = None
        project = staticmethod(dict)

    def __init__(self):
        self.loss_seeds, self.energy_seeds = [], []

    def loss(self, raw, seed):
        self.loss_seeds += torch.as_tensor(seed).flatten().tolist()
        total = 0 * sum(value.sum((-2, -1)) for value in raw.values())
        return total, {"flat": total}

    def energy(self, raw, seed):
        self.energy_seeds.append(tuple(torch.as_tensor(seed).flatten().tolist()))
        return 0 * raw["x"].sum((-2, -1))


def moved(optimizer, step):
    """What a step changed, by parameter."""
    before = {name: value.detach().clone() for name, value in optimizer.raw.items()}
    step()
    return {name: (value.detach() - before[name]).flatten() for name, value in optimizer.raw.items()}


def noise(optimizer, step):
    """What was added to the gradients of a step, which are zero."""
    step()
    return {name: value.grad.flatten().clone() for name, value in optimizer.raw.items()}


DRAWS = {
    "annealing only": (AnnealingOnly, moved),
    "phases of annealing": (lambda: Alternating(every=1, candidates=1, until=1), moved),
    "noisy gradients": (NoisyGradientDescent, noise),
}


def drawn(name, seed, steps=4):
    """The random numbers (parameter, NUMBERS) of each step."""
    build, look = DRAWS[name]
    optimizer, problem = build(), Flat()
    optimizer.start({"x": torch.zeros(NUMBERS // 2, 2), "y": torch.zeros(NUMBERS // 2, 2)}, seed)
    found = [look(optimizer, lambda i=i: optimizer.step(problem, i, 0.9)) for i in range(steps)]
    return [each[name] for each in found for name in ("x", "y")]


@pytest.mark.parametrize("name", DRAWS)
def test_every_step_every_parameter_and_every_seed_has_random_numbers_of_its_own(name):
    streams = torch.stack([*drawn(name, seed=1), *drawn(name, seed=2)])
    assert float(streams.std(1).min()) > 0.05, "there is noise"
    related = torch.corrcoef(streams) - torch.eye(len(streams))
    assert float(related.abs().max()) < UNRELATED
    assert all(torch.equal(a, b) for a, b in zip(drawn(name, seed=1), drawn(name, seed=1), strict=True))


@pytest.mark.parametrize(("build", "each"), [
    (GradientDescent, 1), (NoisyGradientDescent, 1), (AnnealingOnly, 1),
    (partial(AnnealingOnly, common_random_numbers=False), 2)], ids=["descent", "noisy", "annealing", "apart"])
def test_every_iteration_and_every_seed_plays_other_points(build, each):
    seeds = set()
    for seed in (1, 2):
        optimizer, problem = build(), Flat()
        optimizer.start({"x": torch.zeros(2, 2)}, seed)
        for i in range(5):
            optimizer.step(problem, i, 0.9)
        seeds |= set(problem.loss_seeds)
    assert len(seeds) == 10 * each


@pytest.mark.parametrize("common", [True, False])
def test_every_phase_of_annealing_and_every_seed_plays_other_points(common):
    phases = []
    for seed in (1, 2):
        for i in range(3):
            optimizer, problem = Alternating(every=1, candidates=2, until=1, common_random_numbers=common), Flat()
            optimizer.start({"x": torch.zeros(2, 2)}, seed)
            optimizer.step(problem, i, 0.9)
            phases.append({each for seeds in problem.energy_seeds for each in seeds})
    assert len(set.union(*phases)) == sum(map(len, phases)) == len(phases) * (1 if common else 3)


def test_the_best_states_of_a_fit_are_all_judged_on_the_same_fresh_points():
    class Recorded(ForwardModel):
        seeds = []

        def __call__(self, raw, seed):
            self.seeds.append(int(seed))
            return super().__call__(raw, seed)

    model = Recorded(SVD(), resolution=32, maps=3, trajectories=30, length=30)
    target = model(SVD().initial(3, torch.Generator().manual_seed(5)), 0).image.detach()
    model.seeds.clear()
    objective = WeightedSum({"mse": 1}, {"mse": MipMSE(levels=1)})
    method = Chaotic(model, objective, GradientDescent(), iterations=6, kept=2, rescoring_draws=3, previews=0)
    method.reconstruct(target)
    fitted, judged = model.seeds[:6], model.seeds[6:]
    assert judged[:3] == judged[3:] and len(set(judged)) == 3 and len(set(fitted)) == 6
    assert not set(judged) & set(fitted)
