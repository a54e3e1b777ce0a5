"""Evolutionary programming and cuckoo search: their formulas by hand, their course, and what they refuse."""

import math

import pytest
import torch
from rivals_helpers import TARGET, check_it_resumes_bit_for_bit, told

from fractal_exp import IFS, InputError, codes
from fractal_exp.ifs.code import View
from fractal_exp.methods.population.cuckoo import (
    Cuckoo,
    CuckooParams,
    CuckooWalk,
    levy_steps,
    mantegna_sigma,
    mismatch,
)
from fractal_exp.methods.population.evolutionary import (
    Evolutionary,
    EvolutionaryParams,
    EvolutionaryWalk,
    fitness,
    tournament,
)
from fractal_exp.methods.population.search import Canvas, Overlap, PopulationParams
from fractal_exp.rendering.still import render

SMALL = {"population": 8, "maps": 3, "generations": 6}
METHODS = [Evolutionary, Cuckoo]
both_methods = pytest.mark.parametrize("method", METHODS, ids=lambda method: method.__name__.lower())


def overlap(shape: list[list[int]], *drawn: list[list[int]]) -> Overlap:
    a, b = torch.tensor(shape).bool(), torch.tensor(drawn).bool()
    return Overlap((a & b).sum((1, 2)), b.sum((1, 2)), int(a.sum()), a.numel())


SHAPE = [[1, 1, 0], [1, 1, 0], [0, 0, 0]]
SAME, EMPTY, FULL = SHAPE, [[0] * 3] * 3, [[1] * 3] * 3
HALF = [[1, 1, 1], [0, 0, 0], [0, 0, 0]]  # two of the shape's pixels and one beside it


def test_fitness_is_hits_less_mismatches_over_the_shape():
    assert fitness(overlap(SHAPE, SAME, EMPTY, FULL, HALF)).tolist() == [1, -1, -.25, -.25]
    assert fitness(overlap(SHAPE, SAME, HALF), as_released=True).tolist() == pytest.approx([4 / 9, -1 / 9])


def test_mismatch_is_a_share_of_all_pixels_and_as_released_its_rest():
    assert mismatch(overlap(SHAPE, SAME, EMPTY, FULL, HALF)).tolist() == pytest.approx([0, 4 / 9, 5 / 9, 1 / 3])
    assert mismatch(overlap(SHAPE, SAME, FULL), as_released=True).tolist() == pytest.approx([1, 4 / 9])


def test_a_tournament_keeps_those_that_beat_most_of_their_opponents():
    cost = torch.tensor([.4, .1, .3, .2])
    opponents = torch.tensor([[1, 2, 3], [0, 2, 3], [0, 1, 0], [0, 1, 2]])  # scores 0, 3, 2, 2
    assert tournament(cost, opponents, 2).tolist() == [1, 2], "of equal scores the earlier one"
    assert tournament(cost, opponents, 3).tolist() == [1, 2, 3]
    assert tournament(torch.zeros(4), opponents, 2).tolist() == [0, 1], "who is as fit is no fitter"


def test_mantegnas_steps_have_the_stated_width_and_tails():
    assert mantegna_sigma(1.5) == pytest.approx(.6965745, abs=1e-6), "the figure that Yang and Deb's program has"
    steps = levy_steps((400_000,), 1.5, torch.Generator().manual_seed(0))
    assert abs(float(steps.median())) < .01 and abs(float(steps.sign().mean())) < .01
    beyond = [float((steps.abs() > size).double().mean()) for size in (10., 40.)]
    assert math.log(beyond[0] / beyond[1]) / math.log(4) == pytest.approx(1.5, abs=.15), "tails fall by the exponent"


def rows(code: IFS) -> torch.Tensor:
    return torch.cat([code.linear.flatten(1), code.offset], -1)


@pytest.mark.parametrize("normalize", [True, False])
def test_a_code_is_seen_where_it_is_returned(normalize):
    canvas = Canvas(TARGET, PopulationParams(normalize=normalize, points_per_pixel=30.0), 0)
    maps = rows(codes.known("sierpinski_triangle").similar(.8, (.1, -.2)))
    seen = canvas.draw(maps[None])[0].float()
    drawn = (render(canvas.code(maps), View(), resolution=32, points_in_view=60_000) > 0).float()
    assert (drawn - seen).abs().mean() < .02
    assert canvas.overlap(maps[None]).drawn == seen.sum()


def test_the_true_code_is_the_fittest():
    walk = EvolutionaryWalk(TARGET, EvolutionaryParams(points_per_pixel=8.0, **SMALL), 0)
    truth = rows(codes.known("sierpinski_triangle").similar(.5, (0., 0.)))
    seen = Canvas(TARGET, PopulationParams(points_per_pixel=8.0), 0).overlap(truth[None])
    assert fitness(seen) > .4 > 0 > 1 - float(walk.start()["least"])


def test_maps_that_do_not_contract_are_shrunk_as_a_whole():
    canvas = Canvas(TARGET, PopulationParams(maps=2), 0)
    maps = torch.tensor([[.7, .7, .7, .7, 0, 0], [.5, 0, 0, .3, .1, .2]])
    linear, offset = canvas.contracted(maps)
    assert float(torch.linalg.svdvals(linear[0])[0]) == pytest.approx(.99)
    assert torch.allclose(linear[0] / linear[0, 0, 0], torch.ones(2, 2))
    assert torch.equal(linear[1].flatten(), maps[1, :4]) and torch.equal(offset, maps[:, 4:])


@both_methods
def test_a_search_gets_better_tells_what_it_does_and_counts_what_it_draws(method):
    seen = told(made := method(**SMALL | {"generations": 60}, previews=3))
    losses = [progress.scalars["loss"] for progress in seen]
    assert losses == sorted(losses, reverse=True) and losses[-1] < losses[0]
    assert [progress.step for progress in seen] == list(range(1, 61)) and seen[-1].fraction == 1
    assert [p.step for p in seen if p.preview is not None] == [20, 40, 60] and seen[-1].preview.shape == TARGET.shape
    per_generation = 8 if method is Evolutionary else 16
    assert seen[-1].scalars["evaluations"] == 8 + 60 * per_generation
    found = made.reconstruct(TARGET)
    assert found.evaluations == 8 + 60 * per_generation and found.stopped == "all 60 generations done"
    assert len(found.code) == 3 and float(found.code.singular_values().max()) < 1


def test_as_released_nests_are_abandoned_for_better_or_worse():
    settings = {**SMALL, "flight": 0.0, "abandoned": 1.0}
    for released in (False, True):
        walk = CuckooWalk(TARGET, CuckooParams(**settings, as_released=released), 0)
        state = walk.start()
        worse = (walk.step(state, 0)["cost"] > state["cost"]).any()
        assert bool(worse) == released


def test_as_released_a_quarter_of_the_nests_is_replaced_as_a_whole():
    settings = {"population": 400, "maps": 3, "side": 16, "flight": 0.0}
    walk = CuckooWalk(TARGET, CuckooParams(**settings, as_released=True), 0)
    before = walk.start()
    moved = walk.step(before, 0)["genome"] - before["genome"]
    changed = (moved != 0).flatten(1).any(1)
    assert float(changed.float().mean()) == pytest.approx(.25, abs=.05)
    assert bool((moved[changed][..., :2] != 0).any(-1).float().mean() > .95), "all maps of a nest, not some numbers"
    sound = CuckooWalk(TARGET, CuckooParams(**settings), 0)
    assert not torch.equal(walk.maps(before["genome"]), before["genome"])
    torch.testing.assert_close(walk.maps(before["genome"])[..., 4:], before["genome"][..., 4:].tanh())
    assert torch.equal(sound.maps(before["genome"]), before["genome"])


def test_as_released_offsets_of_children_stay_within_one_before_tanh():
    reach = {}
    for released in (False, True):
        walk = EvolutionaryWalk(TARGET, EvolutionaryParams(**SMALL, as_released=released, opponents=1), 0)
        state = walk.start()
        for number in range(6):
            state = walk.step(state, number)
        reach[released] = float(state["genome"][..., 4:].abs().max())
    assert reach[True] <= 1 < reach[False]


def test_as_released_all_maps_are_played_alike():
    large, *small = [[.5, 0, 0, .5, -.5, -.5]], [.01, 0, 0, .01, .9, .9], [.01, 0, 0, .01, .9, -.9]
    maps = torch.tensor([large + small * 4])  # by area, the first has three quarters of the points; else a ninth
    drawn = {released: Canvas(TARGET, PopulationParams(maps=9, as_released=released, normalize=False), 0).draw(maps)[0]
             for released in (False, True)}
    inside = {released: float(lit[len(lit) // 2:, :len(lit) // 2].sum()) for released, lit in drawn.items()}
    assert inside[False] > 1.3 * inside[True], "the large map's quarter of the canvas gets more of the points"


@both_methods
def test_a_resumed_search_ends_as_if_it_had_not_been_interrupted(method, tmp_path):
    check_it_resumes_bit_for_bit(lambda: method(**SMALL, seed=3), tmp_path / "checkpoint")


@both_methods
def test_a_limit_of_time_ends_it_with_the_best_so_far(method):
    found = method(**SMALL | {"generations": 10**6}, seconds=.05).reconstruct(TARGET)
    assert found.stopped == "the time limit of 0.05 s was reached" and found.evaluations > 8


@both_methods
def test_an_image_without_a_shape_at_the_threshold_is_refused_before_any_work(method):
    faint, bright = TARGET * .2, TARGET * .5 + .5
    with pytest.raises(InputError, match="no pixel of the target reaches the threshold 0.25.*lower threshold"):
        method(**SMALL).check(faint)
    with pytest.raises(InputError, match="every pixel of the target reaches the threshold 0.25.*raise threshold"):
        method(**SMALL).check(bright)
    with pytest.raises(InputError, match="resolution must be at least 16, got 8"):
        method(**SMALL).check(TARGET[:8, 12:20])
