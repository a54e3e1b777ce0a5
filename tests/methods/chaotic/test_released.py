"""What the program released with the paper does otherwise than the text, one alternative at a time."""

import math

import pytest
import torch
from chaotic_helpers import fit, random

from fractal_exp import InputError, codes
from fractal_exp.methods.chaotic.losses import regularizer
from fractal_exp.methods.chaotic.model import SVD, ForwardModel
from fractal_exp.methods.chaotic.optimizers import Alternating, Annealing
from fractal_exp.methods.chaotic.released import QR, FixedCentre, MeanCondition, householder
from fractal_exp.methods.chaotic.rendering import Rendering
from fractal_exp.runtime.seeds import derive


def turned(angle: float) -> torch.Tensor:
    cos, sin = math.cos(angle), math.sin(angle)
    return torch.tensor([[cos, -sin], [sin, cos]])


def test_householder_is_the_q_of_a_qr_decomposition_with_its_gradient():
    matrix = torch.randn(200, 2, 2, generator=random(), dtype=torch.float64, requires_grad=True)
    cotangent = torch.randn(200, 2, 2, generator=random(1), dtype=torch.float64)
    mine, theirs = householder(matrix), torch.linalg.qr(matrix).Q
    torch.testing.assert_close(mine, theirs)
    torch.testing.assert_close(torch.autograd.grad(mine, matrix, cotangent)[0],
                               torch.autograd.grad(theirs, matrix, cotangent)[0])


def test_qr_decodes_as_the_product_of_both_factors_and_never_projects():
    raw = {name: value * 3 for name, value in QR().initial(50, random()).items()}
    maps = QR().decode(raw)
    left, right = torch.linalg.qr(raw["u"]).Q, torch.linalg.qr(raw["v"]).Q
    torch.testing.assert_close(maps.linear, left @ torch.diag_embed(torch.sigmoid(raw["singular"])) @ right)
    assert all(torch.equal(value, raw[name]) for name, value in QR().project(raw).items())
    assert float(torch.linalg.det(maps.linear).min()) > 0


def test_qr_turns_by_half_a_circle_along_some_axes_only():
    angle = torch.rand(2, 200_000, generator=random()) * 2 * math.pi
    reflections = torch.stack([angle.cos(), -angle.sin(), angle.sin(), angle.cos()], -1).unflatten(-1, (2, 2))
    either = torch.randint(0, 2, (200_000, 1), generator=random(1)).bool()
    sizes = torch.where(either, torch.tensor([.8, .2]), torch.tensor([.2, .8]))
    maps = QR().decode({"singular": sizes.logit(), "u": reflections[0], "v": reflections[1],
                        "offset": torch.zeros(200_000, 2)}).linear
    oblique = turned(.7) @ torch.diag(torch.tensor([.8, .2])) @ turned(-.7)
    near, far = ((maps - wanted).norm(dim=(1, 2)).min() for wanted in (oblique, -oblique))
    assert float(near) < .02 and float(far) > .1


def test_a_fit_with_qr_begins_with_no_code_of_another_method():
    with pytest.raises(InputError, match="take model=svd"):
        fit(parameterization=QR(), init=fit())
    with pytest.raises(InputError, match="take model=svd"):
        QR().encode(codes.known("fern").linear, codes.known("fern").offset)


def test_the_mean_condition_by_hand_and_how_much_weaker_its_gradient_is():
    singular, offset = torch.tensor([[.5, .2], [.9, .9]]), torch.tensor([[.3, -.4], [0, 1.0]])
    rendering = Rendering(image=torch.empty(0), points=torch.empty(0), singular=singular, offset=offset)
    sums = .25 + .04 + .25 + .81 + .81 + 1
    assert float(MeanCondition()(rendering)) == pytest.approx(sums + 10 * ((1.5 / 1.2) ** 2 + 1) / 2, rel=1e-6)
    for c, ratio in ((2.0, .2), (1.05, 2.1)):  # as docs/deviations.md says, of ten maps
        values = torch.tensor([[c - 1, 0.0]]).repeat(10, 1).requires_grad_()
        nothing = torch.zeros(10, 2)
        both = (MeanCondition()(Rendering(torch.empty(0), torch.empty(0), values, nothing)),
                regularizer(values, nothing))
        # By the second singular values, which are 0: their own squares have no gradient.
        released, written = (float(torch.autograd.grad(value, values)[0][0, 1]) for value in both)
        assert released / written == pytest.approx(ratio, rel=1e-3)


class Told:
    """A problem of told energies: of the state before the step, then of each candidate."""

    waits = False

    def __init__(self, *energies):
        self.parameterization, self.energies, self.asked = QR(), list(energies), []

    def loss(self, raw, seed):
        total = sum(value.square().sum() for value in raw.values())
        return total, {"sum": total}

    def energy(self, raw, seed):
        self.asked.append(({name: value.clone() for name, value in raw.items()}, seed))
        count = len(seed) if isinstance(seed, torch.Tensor) else 1
        found, self.energies = self.energies[:count], self.energies[count:]
        return torch.tensor(found) if isinstance(seed, torch.Tensor) else torch.tensor(found[0])


def phase(*energies, together=None, sharpness=1000.0):
    """A phase of annealing after the first step; the optimiser, the problem and the parameters before that step."""
    optimizer, problem = FixedCentre(every=1, candidates=4, annealing=Annealing(sharpness=sharpness), together=together,
                                     common_random_numbers=False, energy_before_step=True), Told(*energies)
    start = QR().initial(2, random())
    optimizer.start(start, 3)
    return optimizer, problem, start, optimizer.step(problem, 0, 1.0)


@pytest.mark.parametrize("together", [1, 3, 4])
def test_the_candidate_accepted_last_wins_of_those_about_one_centre(together):
    optimizer, problem, start, step = phase(10.0, 5.0, 8.0, 4.0, 9.0, together=together)
    assert step.accepted == .5, "5 is below 10, 8 above 5, 4 below 5, 9 above 4"
    (before, seed), *candidates = problem.asked
    assert all(torch.equal(before[name], start[name]) for name in start), "from before Adam's step"
    assert seed == derive(3, "gradient", 0), "with the points of the gradient: the same image"
    proposed = {name: torch.cat([raw[name] for raw, _ in candidates]) for name in start}
    assert all(torch.equal(optimizer.raw[name], proposed[name][2]) for name in start)
    moves, _ = optimizer.draws(0)
    centres = [there - .2 * move.noise["offset"] for there, move in zip(proposed["offset"], moves, strict=True)]
    torch.testing.assert_close(torch.stack(centres), centres[0].expand(4, 2, 2))
    assert len({int(number) for _, seeds in candidates for number in seeds}) == 4, "new points for every image"


def test_nothing_moves_where_no_candidate_is_accepted():
    optimizer, _, start, step = phase(1.0, 5.0, 8.0, 4.0, 9.0)
    assert step.accepted == 0
    assert float((optimizer.raw["offset"].detach() - start["offset"]).abs().max()) < .0101, "but for Adam's step"


@pytest.mark.parametrize("before", [True, False])
def test_the_appendix_compares_the_first_candidate_with_the_image_from_before_the_step(before):
    optimizer, problem = Alternating(every=1, candidates=1, energy_before_step=before,
                                     common_random_numbers=False), Told(4.0, 5.0)
    start = QR().initial(2, random())
    optimizer.start(start, 3)
    optimizer.step(problem, 0, 1.0)
    (asked, seed), _ = problem.asked
    assert torch.equal(asked["offset"], start["offset"]) == before
    assert (seed == derive(3, "gradient", 0)) == before


TARGET = ForwardModel(SVD(), resolution=32, maps=3, trajectories=400, length=60)


def test_the_last_state_is_the_result_where_it_is_asked_for():
    target = TARGET(SVD().initial(3, random(5)), 0)
    method = fit(iterations=4, result="last")
    found = method.reconstruct(target.image).code
    expected = method.model.code(method.optimizer.raw, derive(0, "frame"))
    assert torch.equal(found.linear, expected.linear)
    assert not torch.equal(found.linear, fit(iterations=4).reconstruct(target.image).code.linear)
    with pytest.raises(InputError, match="result must be one of best, after_step, last"):
        fit(result="first")


def test_the_result_is_what_the_best_step_led_to():
    target = TARGET(SVD().initial(3, random(5)), 0)
    scored, reached = (fit(iterations=1, kept=1, result=result) for result in ("best", "after_step"))
    one, other = (method.reconstruct(target.image).code for method in (scored, reached))
    expected = reached.model.code(reached.optimizer.raw, derive(0, "frame"))
    assert torch.equal(other.linear, expected.linear) and not torch.equal(one.linear, other.linear)


def test_starts_lie_in_the_range_and_leave_image_and_code_alone():
    raw = SVD().initial(3, random(2))
    near, wide = (ForwardModel(SVD(), resolution=32, maps=3, trajectories=300, length=40, warmup=20, start_range=size)
                  for size in (1.0, 5.0))
    torch.testing.assert_close(near(raw, 1).image, wide(raw, 1).image, atol=.02, rtol=0)
    one, other = near.code(raw, 1), wide.code(raw, 1)
    torch.testing.assert_close(one.offset, other.offset, atol=.02, rtol=0)
    first = ForwardModel(SVD(), maps=1, trajectories=4000, length=1, warmup=0, start_range=5.0)
    half = {"singular": torch.zeros(1, 2), "u": torch.eye(2)[None], "v": torch.eye(2)[None],
            "offset": torch.zeros(1, 2)}
    points = 5 * first.play(SVD().decode(half), 0)
    assert 2.45 < float(points.max()) <= 2.5 and -2.5 <= float(points.min()) < -2.45


def test_maps_are_played_by_their_area_where_asked():
    raw = SVD().initial(2, random())
    raw["singular"] = torch.tensor([[2.0, 2.0], [-4.0, -4.0]], requires_grad=True)
    model = ForwardModel(SVD(), resolution=32, maps=2, trajectories=500, length=40, probabilities="area")
    linear, offset = (getattr(SVD().decode(raw), name)[1].detach() for name in ("linear", "offset"))
    rendering = model(raw, 0)
    points = model.play(SVD().decode(raw), 0)
    share = float(((points - offset).norm(dim=-1) <= 2 * linear.norm()).float().mean())
    assert share < .1, "the small map has a hundredth of the area and of the points, not half of them"
    rendering.image.sum().backward()
    assert bool(raw["singular"].grad.isfinite().all()) and model.waits(rendering.image)
    with pytest.raises(InputError, match="uniform or area"):
        ForwardModel(SVD(), probabilities="det")
