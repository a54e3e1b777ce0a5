"""A search ends when its time is up, however long a step is."""

import pytest
import torch

from fractal_exp import codes, suite
from fractal_exp.cameras.comparison import Comparison
from fractal_exp.ifs import attractor
from fractal_exp.methods.collage import method
from fractal_exp.runtime.deadline import Deadline, TimeIsUp, check_time, ending

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
        monkeypatch.setattr(method.Collage, "deadline", lambda search: Deadline(search.seconds, lambda: self.now))


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

