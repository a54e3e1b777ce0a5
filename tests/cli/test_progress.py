"""The line that a fit shows while it works."""

import sys

from fractal_exp.cli import progress
from fractal_exp.cli.folders import FitFolder
from fractal_exp.cli.progress import Reporter, TimeLeft, describe
from fractal_exp.methods.base import Progress
from fractal_exp.tracking import NoTracker


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


def test_it_does_not_stutter_where_there_is_no_terminal(tmp_path, monkeypatch, capsys):
    times = iter([0.0, *(k / 10 for k in range(1, 1002))])
    monkeypatch.setattr(progress.time, "monotonic", lambda: next(times))
    assert not sys.stdout.isatty()
    folder = FitFolder.open(tmp_path, "fit")
    with Reporter(NoTracker(), folder) as reporter:
        for step in range(1, 1001):
            reporter(Progress(step, step / 1000, {"loss": 1.0}))
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 4 and "\r" not in "".join(lines)
    assert lines[0].startswith("   30% after 30 s, about 70 s left, loss 1↓") and lines[-1].startswith("  100% after")
