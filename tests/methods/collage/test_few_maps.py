"""A code of few maps in the place of one of many that draws the same picture."""

from dataclasses import replace

import pytest
import torch
from collage_helpers import pen_camera
from drawn_helpers import SIDE, ended, stage

from fractal_exp.cameras.camera import Camera
from fractal_exp.ifs import affine
from fractal_exp.methods.collage.stages.construction import Construction
from fractal_exp.methods.collage.stages.drawn import DrawnMoves
from fractal_exp.methods.collage.state import Candidate, State

THIRDS = torch.tensor([[1 / 3, 0, 0, 1 / 3, -0.6, 0], [1 / 3, 0, 0, 1 / 3, 0.6, 0]])
WORDS = affine.compositions(affine.compositions(THIRDS, THIRDS)[:2], THIRDS)   # of the left third
MANY = torch.cat([WORDS, affine.compositions(THIRDS, THIRDS)[2:]])


def cantor_set():
    """Cantor's set after four steps, as lines."""
    image, words = torch.zeros(SIDE, SIDE), affine.compositions(*[affine.compositions(THIRDS, THIRDS)] * 2)
    for ratio, *_, x, _ in words.tolist():
        first, last = (round((x + side * 0.9 * ratio + 1) * SIDE / 2) for side in (-1, 1))
        image[SIDE // 2:SIDE // 2 + 2, first:last + 1] = 1
    return image


@pytest.mark.slow
def test_a_simpler_code_takes_the_place_of_a_code_of_many_maps():
    tried = stage(cantor_set())
    state = ended(tried, State(best=Candidate(MANY, None, 1.0, 1.0)), tried.most_moves)
    assert affine.from_code(state.leader.code)[:, [0, 4]].abs() == pytest.approx(THIRDS[:, [0, 4]].abs(), abs=0.02)
    assert state.leader.camera.tile == 0 and not state.stopped
    assert DrawnMoves(tried.problem).is_wanted(state), "the moves go on from it"


@pytest.mark.parametrize("likeness, error, is_simpler", [(0.99, 1.4, True), (0.98, 1.4, False), (0.99, 1.5, False)])
def test_a_simpler_code_must_draw_the_shape_and_be_worth_its_error(likeness, error, is_simpler):
    """Four maps more are worth 1.1 to the fourth power, 1.46."""
    class Alike(Construction):
        def likeness(self, *_):
            return likeness

    tried, pen = Alike(stage(cantor_set()).problem), Camera("coverage", tile=0.0, pen=0.01, blur=0.0)
    few, many = Candidate(THIRDS, None, error, error, pen), Candidate(MANY, None, 1.0, 1.0, pen)
    assert len(MANY) == 6 and tried.is_simpler(few, many) is is_simpler
    assert not tried.is_simpler(many, few)
    for other in pen_camera(0.1, 0.01, 0.0), Camera("strokes", depth=5.0, thinning=0.0, pen=0.01, blur=0.0):
        assert not tried.is_simpler(replace(few, camera=other), many), "tiles and strokes have limits of their own"
