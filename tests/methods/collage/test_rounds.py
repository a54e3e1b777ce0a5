"""Rounds of collage search: when another begins, what it may find, and how it goes on after an interruption."""

import math
from dataclasses import replace

import pytest
import torch
from collage_helpers import UNPOLISHED, check_it_goes_on, measure_search, objective, problem, tied, unpolished
from collage_helpers import small as few

from fractal_exp import suite
from fractal_exp.ifs import affine
from fractal_exp.methods.collage.stages import plan_of
from fractal_exp.methods.collage.stages.image import ImageMoves
from fractal_exp.methods.collage.stages.measure import FromMixture, Restart
from fractal_exp.methods.collage.state import State

TURN = torch.tensor([[0.0, -0.97, 0.98, 0, 0.1, 0]])  # of a square, say, about its middle


@pytest.fixture(scope="module")
def triangle(triangle):
    """Smaller than the usual one."""
    return triangle[0], suite.target(triangle[0], 64)


def small(**options):
    return few(search={"restarts": 1, "moves": 3, "detail_moves": 2}, **options)


@pytest.mark.parametrize(("number", "ratio", "angle", "another"), [
    (1, 1.5, 0.1, False), (0, 1, 0.1, False), (0, 10, 0.5, False), (0, 1.5, 0.1, True), (2, 10, 0.1, False),
    pytest.param(1, 2.5, 0.1, True, marks=pytest.mark.slow)])
def test_another_round_begins_only_where_the_image_is_far_off(triangle, number, ratio, angle, another):
    code, image = triangle
    given, maps = unpolished(image, rounds=3), affine.from_code(code)
    stage, state = ImageMoves(given, number), State(best=tied(maps), pool=maps)
    state = stage.open(state)
    assert stage.search.noise_ratio(state.current) < 2, "the true code"
    stage.search.finish, stage.search.noise_ratio = lambda now: now, lambda now: ratio
    stage.search.objective.angle = lambda error: angle
    after = stage.close(state)
    assert (after.best is None) == another and len(after.result.maps) == 3
    if another:
        assert len(after.pool) == 6 and after.scores == ()
        kept = State.of(after.snapshot(), "cpu")
        assert torch.equal(kept.before.maps, after.before.maps) and kept.best is None
        again = Restart(given, number + 1)
        assert again.close(again.open(after)).best is not None


@pytest.mark.parametrize(("pixels", "searches"), [(0.05, [False, False]), (0.13, [False, True]), (0.3, [True, True])])
def test_a_near_set_ends_the_restarts_and_a_nearer_one_needs_no_search_from_the_mixture(triangle, pixels, searches):
    code, image = triangle
    given, maps = unpolished(image), affine.from_code(code)
    maps[0, 4] += 2 * pixels / len(image)
    state = State(best=replace(tied(maps), score=0.5), scores=(0.5,))
    stages = Restart(given, 0, 1), FromMixture(given, 0)
    assert [stage.is_wanted(state) for stage in stages] == searches
    many = replace(state, best=replace(tied(maps), score=1.5), scores=(1.5,))
    assert [stage.is_wanted(many) for stage in stages] == [True, True], "the number of maps is wrong"


def test_the_stages_of_a_round_come_in_order(triangle):
    given = problem(triangle[1], rounds=3, search={"restarts": 3})
    later = ["search"] * 3 + ["detail", "image"]
    plan = plan_of(given)
    assert [[stage.name for stage in stages] for stages in plan.rounds] == [["search", *later], later, later]
    stages = plan.stages
    places = [stage.key.place for stage in stages]
    assert places == sorted(set(places))
    assert stages[-1].name == "rounding"


def test_every_other_round_after_an_isometry_does_without(triangle):
    code, image = triangle
    right = affine.from_code(code)

    def limits(maps, **options):
        before = tied(maps, 1.0)
        for number, stages in enumerate(plan_of(problem(image, rounds=4, **options)).rounds):
            stages[0].open(State(best=before, before=before if number else None, current=before))
            yield stages[0].search.smaller_limit

    assert list(limits(torch.cat([right, TURN]))) == [1, 0.9, 1, 0.9]
    assert list(limits(right)) == [1, 1, 1, 1]
    assert list(limits(torch.cat([right, TURN]), stages={"avoid_isometries": False})) == [1, 1, 1, 1]


def test_a_search_without_isometries_finds_and_takes_none():
    """A turn of a square explains its measure as well as the identity does."""
    masses = torch.zeros(64, 64)
    masses[16:48, 16:48] = 1
    pool = torch.cat([TURN, torch.tensor([[0.3, 0, 0, 0.3, 0.2, 0.2], [0.3, 0, 0, 0.3, -0.2, -0.2]])])
    most = {}
    for smaller in (1.0, 0.9):
        some = measure_search(masses, 32, smaller=smaller)
        begun = some.start()
        most[smaller] = [float(affine.smaller_singular(each.maps).max()) for each in
                         (some.mixed(pool, begun), some.resume(tied(pool)), begun, some.step(begun, 0))]
    assert max(most[0.9]) < 0.9 + 1e-4 and min(most[1.0][:2]) > 0.9


def test_how_many_rounds_there_are_depends_on_what_the_greys_mean(triangle):
    _, image = triangle
    assert [problem(image, **({"rounds": None} | options)).rounds
            for options in ({}, {"levels": "coverage"}, {"levels": "binary"}, {"rounds": 2})] == [2, 3, 4, 2]
    assert problem(image, rounds=None, levels="binary", stages={"independent_rounds": 0}).rounds == 2


def test_later_rounds_go_on_where_they_were_interrupted_and_progress_never_falls(triangle, tmp_path):
    """Two maps draw no triangle, so there is another round."""
    (_, image), parts = triangle, []

    def search():
        return small(rounds=2, at_most=2, **UNPOLISHED)

    def is_in_second_round(told):
        return told[-1].stage == "detail" and "image" in {each.stage for each in told}

    whole = search().reconstruct(image, on_step=lambda p: parts.append(p.fraction)).code
    assert parts == sorted(parts) and parts[-1] == 1 and len(set(parts)) > 10
    check_it_goes_on(search, image, is_in_second_round, tmp_path / "checkpoint", whole)


def test_the_angle_of_an_error_is_what_all_pixels_are_off_by():
    target = torch.full((32, 32), 0.5)
    picture = objective(target)
    darker = torch.sin(torch.full_like(target, math.pi / 4 - 0.2)) ** 2
    assert picture.angle(picture.error(darker)) == pytest.approx(0.2, rel=0.01)
