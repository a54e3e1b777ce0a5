"""Collage search on binary images, which hide faint tips: the frame, near-isometries, and the price of a map."""

import math
from dataclasses import replace

import pytest
import torch
from collage_helpers import BINARY, PARAMS, objective, params, problem, random, tied, unpolished

from fractal_exp import suite
from fractal_exp.ifs import affine
from fractal_exp.ifs.attractor import normalize
from fractal_exp.methods.collage.image.gauss_newton import firmly_framed
from fractal_exp.methods.collage.image.objective import ImageObjective
from fractal_exp.methods.collage.moves.search import ImageSearch
from fractal_exp.methods.collage.moves.tools import MISSING
from fractal_exp.methods.collage.simplify.rounding import begun, rounded
from fractal_exp.methods.collage.stages.image import FullSize, ImageMoves
from fractal_exp.methods.collage.stages.measure import Restart
from fractal_exp.methods.collage.state import State
from fractal_exp.runtime.deadline import Deadline


def search(image, **options) -> ImageSearch:
    return ImageSearch(objective(image, BINARY, **options), BINARY.measure(image), noise=1.0)


def test_the_lit_pixels_of_a_binary_image_may_fall_short_of_its_frame():
    image = torch.zeros(128, 128)
    image[40:88, 30:98] = 1  # 68 of the 96 pixels of a frame
    assert objective(image, BINARY).firm_frame() is not None
    assert objective(image[:, 60:], BINARY).firm_frame() is None, "less than a half"
    assert objective(image, BINARY, frame={"firm": ()}).firm_frame() is None
    assert objective(image).firm_frame() is None, "an image with greys"
    assert objective(image, BINARY).own_frame() is None, "what is nearly right is polished without"


def test_every_other_round_of_a_binary_image_avoids_isometries(triangle):
    right = affine.from_code(triangle[0])
    before = tied(torch.cat([right, torch.tensor([[0.0, -0.97, 0.98, 0, 0.1, 0]])]), 1.0)  # with a turn

    def limit(number, **options):
        stage = Restart(problem((triangle[1] > 0.25).float(), **{"rounds": 2} | options), number)
        stage.open(State(current=before, before=before if number else None))
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
    image, right, _ = pulled
    given = objective(image, BINARY)
    exact = given.judge(right)
    assert firmly_framed(given, exact) is exact


class Solved(ImageObjective):
    """An objective of which polishes in a frame find this code at once; it counts them."""

    def __init__(self, image, right):
        super().__init__(image, BINARY, params(gauss_newton={"enabled": False}))
        self.right, self.polishes = right, []

    def within(self, frame):
        self.polishes.append(frame)
        return super().within(frame)

    def judge(self, maps, weights=None):
        return super().judge(maps if self.frame is None else self.right, weights)


def test_firm_polishes_end_once_the_code_is_nearly_right(pulled):
    image, right, maps = pulled
    given = Solved(image, right)
    found = firmly_framed(given, given.judge(maps))
    assert len(given.polishes) == 1 and torch.equal(found.maps, right)


def test_a_firm_polish_keeps_the_code_of_least_framed_error(pulled):
    image, _, maps = pulled
    given = objective(image, BINARY, gauss_newton={"enabled": False})
    wrong = given.judge(maps)
    judged = []
    given.framed_error = lambda shown: judged.append(shown) or (4.0, 1.0, 2.0, 5.0)[len(judged) - 1]
    assert firmly_framed(given, wrong) is judged[1]
    given.framed_error = lambda shown: 1.0 + (shown is not wrong)
    assert firmly_framed(given, wrong) is wrong


def test_a_firm_polish_that_comes_too_late_is_not_made(pulled):
    image, _, maps = pulled
    given = objective(image, BINARY)
    wrong = given.judge(maps)
    assert firmly_framed(given, wrong, Deadline(0)) is wrong


def test_rounds_on_a_binary_image_are_compared_by_the_framed_score(pulled):
    """Those on other images by the score, which says nothing here."""
    image, right, wrong = pulled

    def is_better(firm, *near):
        stage = ImageMoves(problem(image, frame={"firm": firm}), 1)
        stage.search = search(image)
        stage.search.noise_ratio = lambda now: 1.1 if now.score in near else 10.0
        exact, other = (replace(stage.search.judged(tied(maps)), score=score)
                        for maps, score in ((right, 2.0), (wrong, 1.0)))
        return stage.is_better(exact, other), stage.is_better(other, exact)

    assert is_better(PARAMS.frame.firm) == (True, False) and is_better(()) == (False, True)
    for near in (1.0, 2.0):
        assert is_better(PARAMS.frame.firm, near) == (False, True), "what is nearly right need not fill the frame"


def test_missing_maps_cost_as_much_in_the_framed_score_as_in_the_score(pulled):
    image, right, wrong = pulled
    given = ImageSearch(objective(image, BINARY, maps=len(right)), BINARY.measure(image), noise=1.0)
    few, full = (given.judged(tied(maps)) for maps in (right[:-1], wrong))
    assert given.framed_score(few) > MISSING > given.framed_score(full)


def test_a_fit_into_the_frame_does_not_make_a_code_hopeless(pulled):
    image, right, maps = pulled
    given = Solved(image, right)
    wrong = given.judge(maps)
    given.is_hopeless = lambda error: error != wrong.error
    assert firmly_framed(given, wrong) is wrong


class Ending(ImageSearch):
    """A search that tells the steps of its end, in which a firm polish finds the code `right`, if there is one, and
    nothing else changes. ratios: the noise ratios that it sees; else they are those of its codes."""

    def __init__(self, image, right=None, ratios=()):
        super().__init__(objective(image, BINARY), BINARY.measure(image), noise=1.0)
        self.right, self.ratios, self.told = right, iter(ratios), []

    def noise_ratio(self, now):
        return next(self.ratios, None) or super().noise_ratio(now)

    def last_polished(self, now):
        self.told.append("clean" if self.right is None else self.noise_ratio(now))
        return now

    def firmly_polished(self, shown):
        self.told.append("firm")
        return self.candidate(shown if self.right is None else self.objective.judge(self.right))


@pytest.mark.parametrize(("ratios", "steps"), [
    ((10.0, 10.0), ["firm"]), ((1.5, 2.5), ["firm", "clean", "firm"]), ((2.5, 1.5), ["firm", "clean", "firm"]),
    ((1.1, 1.1), ["clean"])])
def test_a_round_on_a_binary_image_ends_in_the_frame(pulled, ratios, steps):
    image, right, _ = pulled
    given = Ending(image, ratios=ratios)
    given.finish(given.candidate(given.objective.judge(right)))
    assert given.told == steps


def test_a_fit_that_finds_the_true_code_is_not_the_end_of_its_round(pulled):
    image, right, wrong = pulled
    given = Ending(image, right)
    given.finish(given.candidate(given.objective.judge(wrong)))
    before, near, after = given.told
    assert before == after == "firm" and near < 2


def test_another_round_of_a_binary_image_begins_from_nothing(pulled):
    """Even after a hopeless one. With greys, a round continues from the rounds before."""
    image, right, wrong = pulled

    def after(levels, image, maps):
        given = unpolished(image, levels=levels, rounds=2, search={"restarts": 3, "mixture": True})
        stage = ImageMoves(given, 0)
        state = stage.open(State(best=tied(maps), pool=maps))
        assert stage.search.objective.is_hopeless(state.now.error) == (levels == "binary")
        state, again = stage.close(state), Restart(given, 1)
        again.open(replace(state, before=tied(right), current=tied(right)))
        return state, again, given

    state, again, given = after("binary", image, wrong)
    assert state.best is None and state.before is not None and state.pool is None
    first = Restart(given, 0)
    first.open(State(current=tied(right)))
    assert given.restarts(1) == 3 and torch.equal(again.search.measure.bins, first.search.measure.bins)
    found = tied(wrong)
    assert found.score == math.inf, "any mixture would be better"
    assert again.close(replace(state, current=found)).best is found
    state, again, given = after("density", suite.target(affine.to_code(right), 128), 0.9 * right + 0.1 * wrong)
    assert state.pool is not None and given.restarts(1) == 2
    assert not torch.equal(again.search.measure.bins, first.search.measure.bins)


@pytest.mark.parametrize(("levels", "growth", "share", "another"), [
    ("binary", True, 0.5, True), ("binary", True, 0.8, False), ("binary", False, 0.8, True),
    ("density", True, 0.5, False)])
def test_a_round_follows_a_hopeless_code_of_a_binary_image_if_growth_has_time_left(pulled, levels, growth, share,
                                                                                   another):
    (image, _, wrong), seconds = pulled, [0.0]
    given = replace(unpolished(image, levels=levels, rounds=2, growth={"enabled": growth}),
                    deadline=Deadline(1000, lambda: seconds[0]))
    stage = ImageMoves(given, 0)
    state = stage.open(State(best=tied(wrong)))
    assert stage.search.objective.is_hopeless(state.now.error)
    seconds[0] = share * 1000
    assert (stage.close(state).best is None) == another


def test_a_firm_polish_follows_at_full_size(pulled):
    image, _, maps = pulled
    stage = FullSize(problem(image, stages={"largest_side": 64}))
    after = stage.open(State(best=tied(maps))).now
    assert misfit(search(image), tied(maps)) > 4 and misfit(search(image), after) < 0.3


def test_simple_numbers_keep_a_code_in_the_frame_of_a_binary_image():
    code = normalize(suite.random_suite(5, seed=7)[4])   # whose lit pixels fall far short of its frame
    right, given = affine.from_code(code), objective(suite.target(code, 128, "binary"), BINARY)
    wrong = right + 0.004 * torch.randn(right.shape, generator=random(1))
    assert given.own_frame() is None

    def off(maps):
        return misfit(search(given.image), tied(maps))

    near, far = (rounded(begun(given, given.judge(maps))).shown.maps for maps in (right * 1.001, wrong))
    assert off(near) < 0.3 * off(right * 1.001) and off(far) > 0.5
