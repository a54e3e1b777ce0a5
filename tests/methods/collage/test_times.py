"""When the rounds and the stages of a search end, and what becomes of those that begin late."""

from dataclasses import replace

import pytest
import torch
from collage_helpers import PARAMS, problem, tied, unpolished

from fractal_exp.ifs import affine
from fractal_exp.methods.collage.pipeline import Pipeline
from fractal_exp.methods.collage.stages import plan_of
from fractal_exp.methods.collage.stages.image import ImageMoves, Rounding
from fractal_exp.methods.collage.stages.measure import Restart
from fractal_exp.methods.collage.state import Key, State
from fractal_exp.runtime.deadline import Deadline


def ends(image, seconds, **options):
    """The share of a limit at which the restarts and the moves of both rounds end, with a clock that stands still."""
    given = replace(problem(image, **{"rounds": 2} | options), deadline=Deadline(seconds, lambda: 0.0))
    assert [stage.deadline.seconds / seconds for stage in plan_of(given).last] == [pytest.approx(0.99)], "last digits"
    return [stage(given, number).deadline.seconds / seconds for number in (0, 1) for stage in (Restart, ImageMoves)]


def test_time_is_left_for_the_frame_of_a_binary_image(triangle):
    grey, binary = triangle[1], (triangle[1] > 0.25).float()
    assert ends(grey, 40) == pytest.approx([0.35, 0.95, 0.95, 0.95])
    assert ends(binary, 40) == pytest.approx([0.35, 0.85, 0.85, 0.85])
    for options in ({"enabled": False}, {"firm": ()}):
        assert ends(binary, 40, frame=options) == pytest.approx([0.35, 0.95, 0.95, 0.95])


def test_time_is_left_for_the_last_stage_of_a_picture_that_others_drew(triangle):
    assert ends(triangle[1], 40, levels="drawn") == pytest.approx([0.35, 0.8, 0.8, 0.8])


def test_rounds_of_a_binary_image_have_equal_parts_of_the_time(triangle):
    grey, binary = triangle[1], (triangle[1] > 0.25).float()
    assert ends(binary, 80) == pytest.approx([0.175, 0.425, 0.675, 0.925])
    assert ends(grey, 80) == pytest.approx([0.35, 0.95, 0.95, 0.95])
    assert ends(binary, 80, stages={"independent_rounds": 0}) == pytest.approx([0.35, 0.85, 0.85, 0.85])
    given = replace(problem(binary, rounds=3), deadline=Deadline(80, lambda: 0.0))
    stage = ImageMoves(given, 0)
    stage.open(State(best=tied(affine.from_code(triangle[0]))))
    assert stage.search.deadline.seconds == 40 and given.full_rounds == 2
    assert [problem(binary, rounds=3).full_rounds, problem(grey, rounds=3).full_rounds] == [3, 1]
    assert [replace(given, deadline=Deadline(seconds)).full_rounds for seconds in (0, 59, 60, 1e9, float("inf"))] == [
        1, 1, 2, 3, 3]
    large = replace(problem(torch.ones(512, 512), levels="binary", rounds=3), deadline=Deadline(239))
    assert large.full_rounds == 1 and replace(large, deadline=Deadline(240)).full_rounds == 2
    assert [replace(given, deadline=Deadline(80), params=PARAMS).restarts(number) for number in range(3)] == [5, 5, 3]


class Enough(Exception):
    pass


def first_stages(given, state, count):
    """The first stages that are done from a state on."""
    done = []

    def on_stage(stage, _):
        done.append(stage.key)
        if len(done) == count:
            raise Enough

    with pytest.raises(Enough):
        Pipeline(plan_of(given), state, on_move=lambda *_: None, on_stage=on_stage).run()
    return [(key.round, key.stage) for key in done]


def test_a_round_that_begins_late_still_makes_a_code(triangle):
    seconds = [0.0]
    given = replace(problem((triangle[1] > 0.25).float(), rounds=2, search={"restarts": 2}),
                    deadline=Deadline(80, lambda: seconds[0]))
    seconds[0] = 60
    assert [Restart(given, 1, number).latest_start.passed for number in (0, 1)] == [False, True]
    begun = State(done=Key(0, "image"), before=tied(affine.from_code(triangle[0]) * 0.9, 10.0))
    assert first_stages(given, begun, 2) == [(1, "restart"), (1, "detail")]


def test_the_code_of_a_round_is_judged_even_if_its_part_of_the_time_is_over(triangle):
    """Otherwise the search would end with this code."""
    seconds = [0.0]
    given = replace(problem((triangle[1] > 0.25).float(), rounds=2), deadline=Deadline(80, lambda: seconds[0]))
    seconds[0] = 41
    begun = State(done=Key(0, "detail"), best=tied(affine.from_code(triangle[0]) * 0.9, 10.0))
    assert first_stages(given, begun, 2) == [(0, "image"), (1, "restart")]
    seconds[0] = 75
    assert ImageMoves(given, 0).latest_start.passed and not Rounding(given, 2).latest_start.passed


def test_moves_that_the_time_limit_ends_say_so(triangle):
    seconds = [0.0]
    for number, late, stopped in ((1, 970, "the time limit of 1000 s was reached"),
                                  (0, 470, "the time of its round was up")):
        given = replace(unpolished((triangle[1] > 0.25).float(), rounds=2), deadline=Deadline(1000, lambda: seconds[0]))
        stage = ImageMoves(given, number)
        begun = stage.open(State(best=tied(affine.from_code(triangle[0]) * 0.9)))
        seconds[0] = late
        assert stage.close(begun).stopped == stopped
        seconds[0] = 0
