"""A search ends when its time is up, however long a step is."""

from dataclasses import replace

import pytest
import torch

from fractal_exp import IFS, codes, suite
from fractal_exp.cameras.kinds import levels_of
from fractal_exp.cameras.params import CameraParams
from fractal_exp.ifs import attractor
from fractal_exp.images.reading import ReadImage
from fractal_exp.methods.collage import method
from fractal_exp.methods.collage.image.objective import ImageObjective
from fractal_exp.methods.collage.params import CollageParams
from fractal_exp.methods.collage.pipeline import Pipeline
from fractal_exp.methods.collage.stages import plan_of
from fractal_exp.methods.collage.stages.base import SearchProblem
from fractal_exp.methods.collage.state import State
from fractal_exp.runtime.deadline import USUAL, Deadline, TimeIsUp, check_time, ending

TRIANGLE = attractor.normalize(codes.known("sierpinski_triangle"))
SMALL = {"growth": {"enabled": False}, "search": {"restarts": 1, "moves": 4, "detail_moves": 4}}


def ticking(tick: float, seconds: float) -> tuple[SearchProblem, list[IFS]]:
    """A search with so many seconds, in which time stands still but for a tick at each drawing of a code; the codes
    that it draws."""
    drawn = []

    class Ticking(ImageObjective):
        def render(self, code, *path):
            image = super().render(code, *path)
            drawn.append(code)
            return image

    class Timed(SearchProblem):
        def objective(self, *arguments, **options):
            plain = super().objective(*arguments, **options)
            return Ticking(plain.image, plain.levels, plain.params, plain.seed, plain.renderings)

    image, params = suite.target(TRIANGLE, 64, "binary"), CollageParams().updated(**SMALL)
    deadline = Deadline(seconds, lambda: tick * len(drawn))
    return Timed(image, levels_of(image, "binary", params.camera), params, deadline=deadline), drawn


def test_a_picture_from_elsewhere_has_the_usual_limit_unless_its_maps_are_grown_at_once():
    drawn, exact = ReadImage.of_drawing(suite.target(TRIANGLE, 64), "drawn"), suite.target(TRIANGLE, 64, "binary")
    usual = method.Collage().deadline(drawn)
    assert usual.seconds == USUAL and usual.words == "60 s of a core"
    assert method.Collage(seconds=7).deadline(drawn).words == "7 s"
    for search, target in ((method.Collage(), exact), (method.Collage(maps=128), drawn)):
        assert search.deadline(target).seconds is None and search.deadline(target).words == "no limit"


def test_the_camera_of_a_code_is_estimated_once():
    """Another estimate would be another object, and that of another code is."""
    image = suite.target(TRIANGLE, 64)
    problem = SearchProblem(image, levels_of(image, "drawn", CameraParams()), CollageParams())
    found = problem.camera(TRIANGLE)
    assert found is problem.camera(replace(TRIANGLE)) is not problem.levels.camera
    assert problem.camera(codes.known("heighway_dragon")) is not found


def test_time_is_up_where_it_is_looked_at():
    now = [0.0]
    with ending(Deadline(10, lambda: now[0])):
        check_time()
        now[0] = 10.0
        with pytest.raises(TimeIsUp):
            check_time()
    check_time()


@pytest.mark.parametrize("tick", [pytest.param(0.5, marks=pytest.mark.slow), 7.0, 30.0])
def test_nothing_is_drawn_for_a_search_whose_time_is_up(tick):
    problem, drawn = ticking(tick, 20)
    pipeline = Pipeline(plan_of(problem), State(), on_move=lambda *_: None, on_stage=lambda *_: None)
    found = pipeline.run()
    assert pipeline.state.stopped == "the time limit of 20 s was reached"
    assert len(found.maps) >= 1 and torch.isfinite(found.maps).all()
    assert 20 <= tick * len(drawn) < 20 + tick

