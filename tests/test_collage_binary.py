"""Collage search on binary images, which hide faint tips: the frame, near-isometries, and the price of a map."""

from dataclasses import replace

import pytest
import torch
from collage_helpers import BINARY, PARAMS, objective, params, problem, random, tied

from fractal_exp import suite
from fractal_exp.ifs.attractor import normalize
from fractal_exp.methods.collage import maps as affine
from fractal_exp.methods.collage.image.frame import Frame
from fractal_exp.methods.collage.image.search import ImageSearch
from fractal_exp.methods.collage.stages import ImageMoves, Restart
from fractal_exp.methods.collage.state import State
from fractal_exp.runtime.deadline import Deadline


def search(image, **options) -> ImageSearch:
    return ImageSearch(objective(image, BINARY, **options), BINARY.measure(image), noise=1.0)


def test_the_lit_pixels_of_a_binary_image_may_fall_short_of_its_frame():
    image = torch.zeros(128, 128)
    image[40:88, 30:98] = 1  # 68 of the 96 pixels of a frame
    assert Frame.of(image, PARAMS.frame) is None
    assert Frame.of(image, PARAMS.frame, is_graded=False) is not None
    assert Frame.of(image, params(frame={"binary_shortest": 0.8}).frame, is_graded=False) is None
    assert objective(image, BINARY).own_frame() is not None and objective(image).own_frame() is None


def test_the_first_round_of_a_binary_image_avoids_isometries(triangle):
    image = (triangle[1] > 0.25).float()
    for number, limit in enumerate((0.9, 1.0)):
        for avoided in (True, False):
            stage = Restart(problem(image, stages={"avoid_isometries": avoided}), number)
            stage.open(State(before=tied(affine.from_code(triangle[0])) if number else None))
            assert stage.search.smaller_limit == (limit if avoided else 1.0)


def test_a_map_must_save_a_share_of_the_error_in_a_binary_image(triangle):
    image = triangle[1]
    assert search((image > 0.25).float()).price.share == PARAMS.moves.worth
    assert ImageSearch(objective(image), image, noise=1.0).price.share == 0


def test_the_frame_pulls_tips_that_a_binary_image_hides():
    code = normalize(suite.random_suite(10, seed=7)[9])
    image = suite.target(code, 128, "binary")
    frame, given = objective(image, BINARY).own_frame(), search(image)
    maps = affine.from_code(code)
    wrong = given.objective.judge(maps + 0.004 * torch.randn(maps.shape, generator=random(1)))

    def misfit(found):
        return float(frame.misfit(found.maps, found.probabilities).abs().max())

    pulled = given._firmly_framed(wrong, frame)
    soft = search(image, frame={"firm": (1.0,)})._firmly_framed(wrong, frame)
    assert misfit(wrong) > 4 and misfit(pulled) < 0.2 and misfit(soft) > misfit(pulled)
    assert given.objective.error(pulled.image) < 1.2 * wrong.error
    right = given.objective.judge(maps)
    assert given._firmly_framed(right, frame) is right, "it is explained to its noise"


def test_time_is_left_for_the_frame_of_a_binary_image(triangle):
    for image, share in ((triangle[1], 0.95), ((triangle[1] > 0.25).float(), 0.85)):
        given = replace(problem(image), deadline=Deadline(1000))
        for stage in (ImageMoves(given), Restart(given, 1)):
            assert stage.deadline.seconds == pytest.approx(1000 * share, abs=5)
        assert Restart(given).deadline.seconds == pytest.approx(350, abs=5)


def test_a_fit_into_the_frame_does_not_make_a_code_hopeless():
    code = normalize(suite.random_suite(10, seed=7)[9])
    image = suite.target(code, 128, "binary")
    given, frame = search(image), objective(image, BINARY).own_frame()
    wrong = given.objective.judge(affine.from_code(code) + 0.004 * torch.randn(len(code), 6, generator=random(1)))
    given.objective.is_hopeless = lambda error: error != wrong.error
    assert given._firmly_framed(wrong, frame) is wrong
