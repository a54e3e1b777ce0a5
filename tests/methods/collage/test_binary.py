"""Collage search on binary images, which hide faint tips: the frame, near-isometries, and the price of a map."""

from dataclasses import replace

import pytest
import torch
from collage_helpers import BINARY, PARAMS, objective, problem, random, tied

from fractal_exp import suite
from fractal_exp.ifs.attractor import normalize
from fractal_exp.methods.collage import maps as affine
from fractal_exp.methods.collage.image.gauss_newton import firmly_framed
from fractal_exp.methods.collage.moves.search import ImageSearch
from fractal_exp.methods.collage.simplify.rounding import Rounding
from fractal_exp.methods.collage.stages.image import FullSize, ImageMoves, Restart
from fractal_exp.methods.collage.state import State
from fractal_exp.runtime.deadline import Deadline


def search(image, **options) -> ImageSearch:
    return ImageSearch(objective(image, BINARY, **options), BINARY.measure(image), noise=1.0)


def test_the_lit_pixels_of_a_binary_image_may_fall_short_of_its_frame():
    image = torch.zeros(128, 128)
    image[40:88, 30:98] = 1  # 68 of the 96 pixels of a frame
    assert objective(image, BINARY).firm_frame() is not None
    assert objective(image, BINARY, frame={"binary_shortest": 0.8}).firm_frame() is None
    assert objective(image, BINARY, frame={"firm": ()}).firm_frame() is None
    assert objective(image).firm_frame() is None, "an image with greys"
    assert objective(image, BINARY).own_frame() is None, "what is nearly right is polished without"


def test_every_other_round_of_a_binary_image_avoids_isometries(triangle):
    right = affine.from_code(triangle[0])
    before = tied(torch.cat([right, torch.tensor([[0.0, -0.97, 0.98, 0, 0.1, 0]])]), 1.0)  # with a turn

    def limit(number, **options):
        stage = Restart(problem((triangle[1] > 0.25).float(), **{"rounds": 2} | options), number)
        stage.open(State(before=before if number else None))
        return stage.search.smaller_limit

    assert [limit(number, rounds=3) for number in range(3)] == [0.9, 1.0, 0.9]
    assert limit(0, rounds=1) == limit(0, stages={"avoid_isometries": False}) == 1.0


def test_a_map_must_save_a_share_of_the_error_in_a_binary_image(triangle):
    image = triangle[1]
    assert search((image > 0.25).float()).price.share == PARAMS.moves.worth
    assert ImageSearch(objective(image), image, noise=1.0).price.share == 0


@pytest.fixture(scope="module")
def pulled():
    """A binary image, its true code, and a code that misses its frame by four pixels."""
    code = normalize(suite.random_suite(10, seed=7)[9])
    maps = affine.from_code(code)
    return suite.target(code, 128, "binary"), maps, maps + 0.004 * torch.randn(maps.shape, generator=random(1))


def misfit(given, found) -> float:
    return float(given.objective.firm_frame().misfit(found.maps, found.probabilities).abs().max())


def test_the_frame_pulls_tips_that_a_binary_image_hides(pulled):
    image, _, maps = pulled
    given = search(image)
    wrong = given.objective.judge(maps)
    fitted = firmly_framed(given.objective, wrong)
    soft = firmly_framed(objective(image, BINARY, frame={"firm": (1.0, 1.0, 1.0)}), wrong)
    assert misfit(given, wrong) > 4 and misfit(given, fitted) < 0.2 and misfit(given, soft) > misfit(given, fitted)
    assert fitted.error == given.objective.error(fitted.image)
    assert given.objective.framed_error(fitted) < given.objective.framed_error(wrong)


def test_the_framed_error_is_that_of_the_code_and_of_the_code_that_fills_the_frame(pulled):
    image, right, maps = pulled
    given = objective(image, BINARY)
    wrong, scaled = given.judge(maps), given.judge(affine.from_code(normalize(affine.to_code(maps))))
    assert given.framed_error(wrong) == pytest.approx((wrong.error * scaled.error) ** 0.5, rel=0.05)
    exact = given.judge(right)
    assert given.framed_error(exact) == pytest.approx(exact.error, rel=0.2) and exact.error < 0.1 * wrong.error
    grey = objective(image)
    assert grey.framed_error(grey.judge(maps)) == grey.judge(maps).error, "no firm frame"


def test_a_firm_polish_that_the_code_does_not_need_is_left_out(pulled):
    image, _, maps = pulled
    given = objective(image, BINARY, frame={"firm_above": 1000.0, "firm_only": 1000.0})
    wrong = given.judge(maps)
    assert firmly_framed(given, wrong) is wrong


def test_a_firm_polish_that_the_image_refuses_or_that_comes_too_late_is_not_kept(pulled):
    image, _, maps = pulled
    given = objective(image, BINARY, frame={"firm_worse": 0.01})
    wrong = given.judge(maps)
    assert firmly_framed(given, wrong) is wrong
    given = objective(image, BINARY)
    assert firmly_framed(given, wrong, Deadline(0)) is wrong


def test_missing_maps_cost_as_much_in_the_framed_score_as_in_the_score(pulled):
    image, right, wrong = pulled
    given = ImageSearch(objective(image, BINARY, maps=len(right)), BINARY.measure(image), noise=1.0)
    few, full = (given.judged(tied(maps)) for maps in (right[:-1], wrong))
    assert given.framed_score(few) > PARAMS.moves.missing > given.framed_score(full)


def ends(image, seconds, **options):
    """The share of a limit at which the restarts and the moves of both rounds end, with a clock that stands still."""
    given = replace(problem(image, **{"rounds": 2} | options), deadline=Deadline(seconds, lambda: 0.0))
    return [stage(given, number).deadline.seconds / seconds for number in (0, 1) for stage in (Restart, ImageMoves)]


def test_time_is_left_for_the_frame_of_a_binary_image(triangle):
    grey, binary = triangle[1], (triangle[1] > 0.25).float()
    assert ends(grey, 40) == pytest.approx([0.35, 0.95, 0.95, 0.95])
    assert ends(binary, 40) == pytest.approx([0.35, 0.85, 0.85, 0.85])
    for options in ({"enabled": False}, {"firm": ()}, {"binary_shortest": 1.0, "shortest": 1.0}):
        assert ends(binary, 40, frame=options) == pytest.approx([0.35, 0.95, 0.95, 0.95])


def test_rounds_of_a_binary_image_have_equal_parts_of_the_time(triangle):
    grey, binary = triangle[1], (triangle[1] > 0.25).float()
    assert ends(binary, 80) == pytest.approx([0.175, 0.425, 0.675, 0.925])
    assert ends(grey, 80) == pytest.approx([0.35, 0.95, 0.95, 0.95])
    for options in ({"round_seconds": 50}, {"independent_rounds": 0}):
        assert ends(binary, 80, stages=options) == pytest.approx([0.35, 0.85, 0.85, 0.85])
    given = replace(problem(binary, rounds=3), deadline=Deadline(80, lambda: 0.0))
    stage, begun = ImageMoves(given, 0), State(best=tied(affine.from_code(triangle[0])))
    stage.open(begun)
    assert stage.search.deadline.seconds == 40 and given.full_rounds == 2
    assert [problem(binary, rounds=3).full_rounds, problem(grey, rounds=3).full_rounds] == [3, 1]
    assert [replace(given, deadline=Deadline(seconds)).full_rounds for seconds in (0, 59, 60, 1e9, float("inf"))] == [
        1, 1, 2, 3, 3]
    large = replace(problem(torch.ones(512, 512), levels="binary", rounds=3), deadline=Deadline(239))
    assert large.full_rounds == 1 and replace(large, deadline=Deadline(240)).full_rounds == 2
    assert [replace(given, deadline=Deadline(80), params=PARAMS).restarts(number) for number in range(3)] == [5, 5, 3]


def test_a_firm_polish_follows_at_full_size(pulled):
    image, _, maps = pulled
    stage = FullSize(problem(image, stages={"largest_side": 64}))
    begun = State(best=tied(maps))
    stage.open(begun)
    after = stage.begin(begun)
    assert misfit(search(image), tied(maps)) > 4 and misfit(search(image), after) < 0.3


def test_simple_numbers_keep_a_code_in_the_frame_of_a_binary_image(pulled):
    image, right, wrong = pulled
    given = objective(image, BINARY, frame={"shortest": 1.1})
    assert given.own_frame() is None

    def rounded(maps):
        return misfit(search(image), tied(Rounding(given)(given.judge(maps)).maps))

    assert rounded(right * 1.001) < 0.05 < misfit(search(image), tied(right * 1.001)) and rounded(wrong) > 0.5
