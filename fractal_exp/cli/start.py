"""The commands, each imported when it is started: one whose libraries are missing says in a line what to install."""

from functools import partial

from ..runtime.extras import start

train = partial(start, "fractal-train", "fractal_exp.cli.composed")
sweep = partial(start, "fractal-sweep", "fractal_exp.cli.sweep")
report = partial(start, "fractal-report", "fractal_exp.cli.report")
evaluate = partial(start, "fractal-evaluate", "fractal_exp.cli.evaluate")
invert = partial(start, "fractal-invert", "fractal_exp.cli.invert")
render = partial(start, "fractal-render", "fractal_exp.cli.render")
convert = partial(start, "fractal-convert", "fractal_exp.cli.convert")
view = partial(start, "fractal-view", "fractal_exp.cli.view")
studio = partial(start, "fractal-studio", "fractal_exp.cli.studio")
suite = partial(start, "fractal-suite", "fractal_exp.cli.suite")
