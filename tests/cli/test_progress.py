"""The line that a fit shows while it works."""


from fractal_exp.cli.progress import TimeLeft, describe
from fractal_exp.methods.base import Progress


def test_it_says_what_is_better_and_how_long_it_will_take():
    step = Progress(3, 0.25, {"score": 2.0, "error": 1.324, "maps": 4.0, "stage": 1.0}, stage="grid 64²")
    assert describe(step, 130.0) == "about 2 min left, grid 64², error 1.32↓, maps 4"
    assert describe(Progress(3, 0.25, {"loss": 0.5, "temperature": 0.3}), None) == "loss 0.5↓, temperature 0.3"


def test_time_left_at_a_steady_speed_is_right():
    left = TimeLeft()
    told = [left(second, second / 200) for second in range(1, 150)]
    assert told[3] is None and abs(told[-1] - 51) < 1e-6


def test_time_left_follows_the_speed_of_late():
    left = TimeLeft()
    for second in range(1, 11):
        left(second, second * 0.05)  # a quick half,
    for second in range(11, 400):
        told = left(second, 0.5 + (second - 10) / 1000)  # and a slow one
    assert abs(told - 1000 * (1 - 0.889)) < 15
