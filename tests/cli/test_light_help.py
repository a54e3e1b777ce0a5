"""A command answers --help and wrong options before anything heavy is there, by choices that are the package's own."""

import subprocess
import sys

from fractal_exp.cli import dataset, evaluate, render, suite, view
from fractal_exp.evaluation.scoring import ALIGNMENTS
from fractal_exp.evaluation.views import KINDS
from fractal_exp.perceptual.distances import kinds
from fractal_exp.rendering.still import MODES
from fractal_exp.suite import SUITE_COUNT, SUITE_SEED
from fractal_exp.viewer import page

HELP = """
import contextlib, io, sys
from fractal_exp.cli import start

for name, command in vars(start).items():
    for words in (["--help"], ["--nonsense"]) if isinstance(command, start.partial) else ():
        sys.argv, said, status = [name, *words], io.StringIO(), 0
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            try:
                command()
            except SystemExit as end:
                status = end.code or 0
        assert (status, bool(said.getvalue())) == (0 if words == ["--help"] else 2, True), (name, words, status)
        print(name, *[library for library in ("torch", "numba", "mlflow", "pandas") if library in sys.modules])
"""


def test_no_command_loads_what_is_heavy_for_its_help_or_a_wrong_option():
    done = subprocess.run([sys.executable, "-c", HELP], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert len(done.stdout.splitlines()) == 24 and all(len(line.split()) == 1 for line in done.stdout.splitlines())


def test_the_choices_are_those_of_the_package():
    assert set(render.MODES) == {*MODES, "tone"} - {"tinted"}  # which is no picture, but what one is made of
    assert evaluate.VIEWS == tuple(KINDS) and evaluate.ALIGNMENTS == tuple(ALIGNMENTS)
    assert set(evaluate.DISTANCES) == set(kinds())
    assert view.MOST_SIDE == page.MOST_SIDE
    assert dataset.SEED == SUITE_SEED
    assert (suite.COUNT, suite.SEED) == (SUITE_COUNT, SUITE_SEED)
