"""A search ends when its time is up, however long a step is."""

from dataclasses import replace

import pytest
import torch

from fractal_exp import codes, suite
from fractal_exp.cameras.comparison import Comparison
from fractal_exp.cameras.estimate import estimated
from fractal_exp.cameras.kinds import levels_of
from fractal_exp.cameras.params import CameraParams
from fractal_exp.ifs import attractor
from fractal_exp.images.reading import ReadImage
from fractal_exp.methods.collage import method
from fractal_exp.methods.collage.params import CollageParams
from fractal_exp.methods.collage.stages.base import SearchProblem
from fractal_exp.runtime.deadline import USUAL, Deadline, TimeIsUp, check_time, ending

TRIANGLE = attractor.normalize(codes.known("sierpinski_triangle"))
SMALL = {"growth": {"enabled": False}, "search": {"restarts": 1, "moves": 4, "detail_moves": 4}}


class Ticking:
    """A clock that stands still, but for so many seconds for each drawing of a code."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, tick: float):
        self.now, self.drawn, draw = 0.0, [], Comparison.render

        def render(comparison, *arguments):
            drawn = draw(comparison, *arguments)
            self.now += tick
            self.drawn.append(self.now)
            return drawn

        monkeypatch.setattr(Comparison, "render", render)
        monkeypatch.setattr(method.Collage, "deadline", lambda search, _: Deadline(search.seconds, lambda: self.now))


def test_a_picture_from_elsewhere_has_the_usual_limit_unless_its_maps_are_grown_at_once():
    drawn, exact = ReadImage.of_drawing(suite.target(TRIANGLE, 64), "drawn"), suite.target(TRIANGLE, 64, "binary")
    usual = method.Collage().deadline(drawn)
    assert usual.seconds == USUAL and usual.words == "60 s of a core"
    assert method.Collage(seconds=7).deadline(drawn).words == "7 s"
    for search, target in ((method.Collage(), exact), (method.Collage(maps=128), drawn)):
        assert search.deadline(target).seconds is None and search.deadline(target).words == "no limit"


def test_the_camera_of_a_code_is_estimated_once(monkeypatch):
    calls, estimate = [], estimated
    monkeypatch.setattr("fractal_exp.cameras.estimate.estimated", lambda *each: calls.append(each) or estimate(*each))
    image = suite.target(TRIANGLE, 64)
    problem = SearchProblem(image, levels_of(image, "drawn", CameraParams()), CollageParams())
    assert problem.camera(TRIANGLE) is problem.camera(replace(TRIANGLE))
    assert len(calls) == 1
    problem.camera(codes.known("heighway_dragon"))
    assert len(calls) == 2


def test_time_is_up_where_it_is_looked_at():
    now = [0.0]
    with ending(Deadline(10, lambda: now[0])):
        check_time()
        now[0] = 10.0
        with pytest.raises(TimeIsUp):
            check_time()
    check_time()


@pytest.mark.parametrize("tick", [pytest.param(0.5, marks=pytest.mark.slow), 30.0])
def test_nothing_is_drawn_for_a_search_whose_time_is_up(tick, monkeypatch):
    image = suite.target(TRIANGLE, 64, "binary")
    clock = Ticking(monkeypatch, tick)
    found = method.laptop(resolution=64, seconds=20, **SMALL).reconstruct(image)
    assert found.stopped == "the time limit of 20 s was reached"
    assert len(found.code) >= 1 and torch.isfinite(found.code.linear).all()
    assert clock.now - tick < 20, clock.drawn

