"""Collage search on binary images, which hide faint tips: the frame, near-isometries, and the price of a map."""

from dataclasses import replace

import pytest
import torch
from collage_helpers import BINARY, PARAMS, objective, problem, random, tied

from fractal_exp import suite
from fractal_exp.ifs.attractor import normalize
from fractal_exp.methods.collage import maps as affine
from fractal_exp.methods.collage.image import search as search_module
from fractal_exp.methods.collage.image.gauss_newton import firmly_framed
from fractal_exp.methods.collage.image.search import ImageSearch
from fractal_exp.methods.collage.stages import ImageMoves, Restart
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


def test_the_first_of_several_rounds_of_a_binary_image_avoids_isometries(triangle):
    right = affine.from_code(triangle[0])
    before = tied(torch.cat([right, torch.tensor([[0.0, -0.97, 0.98, 0, 0.1, 0]])]), 1.0)  # with a turn

    def limit(number, **options):
        stage = Restart(problem((triangle[1] > 0.25).float(), **{"rounds": 2} | options), number)
        stage.open(State(before=before if number else None))
        return stage.search.smaller_limit

    assert [limit(0), limit(1)] == [0.9, 1.0]
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
    wrong, frame = given.objective.judge(maps), given.objective.firm_frame()
    fitted = firmly_framed(given.objective, wrong, frame)
    soft = firmly_framed(objective(image, BINARY, frame={"firm": (1.0, 1.0, 1.0)}), wrong, frame)
    assert misfit(given, wrong) > 4 and misfit(given, fitted) < 0.2 and misfit(given, soft) > misfit(given, fitted)
    assert fitted.error == given.objective.error(fitted.image) < 1.4 * wrong.error


@pytest.mark.parametrize("options", [{"firm_worse": 0.01}, {"firm": ()}])
def test_a_polish_that_the_image_refuses_is_undone(pulled, options):
    image, _, maps = pulled
    given = objective(image, BINARY, frame=options)
    wrong = given.judge(maps)
    assert firmly_framed(given, wrong, objective(image, BINARY).firm_frame()) is wrong


def test_a_fit_into_the_frame_does_not_make_a_code_hopeless(pulled):
    image, _, maps = pulled
    given = objective(image, BINARY)
    wrong = given.judge(maps)
    given.is_hopeless = lambda error: error != wrong.error
    assert firmly_framed(given, wrong, given.firm_frame()) is wrong


@pytest.mark.parametrize(("ratio", "steps"), [(10.0, ["firm"]), (1.5, ["firm", "clean", "firm"]), (1.0, ["clean"])])
def test_a_round_on_a_binary_image_ends_in_the_frame(pulled, monkeypatch, ratio, steps):
    image, right, _ = pulled
    given, told = search(image), []
    monkeypatch.setattr(given, "noise_ratio", lambda now: ratio)
    monkeypatch.setattr(given, "_polished_last", lambda now: told.append("clean") or now)
    monkeypatch.setattr(search_module, "firmly_framed", lambda objective, found, *_, **__: told.append("firm") or found)
    given.finish(given.candidate(given.objective.judge(right)))
    assert told == steps


def test_a_fit_that_finds_the_true_code_is_not_the_end_of_its_round(pulled, monkeypatch):
    image, right, wrong = pulled
    given, told = search(image), []
    monkeypatch.setattr(given, "_polished_last", lambda now: told.append(given.noise_ratio(now)) or now)
    monkeypatch.setattr(search_module, "firmly_framed", lambda objective, *_, **__: objective.judge(right))
    given.finish(given.candidate(given.objective.judge(wrong)))
    assert len(told) == 1 and told[0] < 2


def test_time_is_left_for_the_frame_of_a_binary_image(triangle):
    for image, share in ((triangle[1], 0.95), ((triangle[1] > 0.25).float(), 0.85)):
        given = replace(problem(image), deadline=Deadline(1000))
        for stage in (ImageMoves(given), Restart(given, 1)):
            assert stage.deadline.seconds == pytest.approx(1000 * share, abs=5)
        assert Restart(given).deadline.seconds == pytest.approx(350, abs=5)
    given = replace(problem(image, frame={"enabled": False}), deadline=Deadline(1000))
    assert ImageMoves(given).deadline.seconds == pytest.approx(950, abs=5)
