"""The commands, each imported when it is started: one whose libraries are missing says in a line what to install."""

import sys
from functools import partial
from importlib import import_module

from ..runtime.extras import EXTRAS, remedy
from . import interruption


def start(program: str, module: str) -> None:
    """Import a command and run it; if a library of an extra is missing, say so in one line and exit with status 2.
    Ctrl-C ends it in a line from the first moment on, also while libraries load."""
    interruption.listen()
    try:
        with interruption.not_lost():
            import_module(module).main()
    except ModuleNotFoundError as error:
        library = (error.name or "").partition(".")[0]
        if library not in EXTRAS:
            raise
        print(f"{program}: error: {library} is not installed; {remedy(library)}", file=sys.stderr)
        raise SystemExit(2) from None
    except KeyboardInterrupt:
        print(f"\n{program}: interrupted", file=sys.stderr)
        raise SystemExit(130) from None


train = partial(start, "fractal-train", "fractal_exp.cli.composed")
sweep = partial(start, "fractal-sweep", "fractal_exp.cli.sweep")
report = partial(start, "fractal-report", "fractal_exp.cli.report")
evaluate = partial(start, "fractal-evaluate", "fractal_exp.cli.evaluate")
invert = partial(start, "fractal-invert", "fractal_exp.cli.invert")
render = partial(start, "fractal-render", "fractal_exp.cli.render")
convert = partial(start, "fractal-convert", "fractal_exp.cli.convert")
measure = partial(start, "fractal-measure", "fractal_exp.cli.measure")
view = partial(start, "fractal-view", "fractal_exp.cli.view")
studio = partial(start, "fractal-studio", "fractal_exp.cli.studio")
suite = partial(start, "fractal-suite", "fractal_exp.cli.suite")
dataset = partial(start, "fractal-dataset", "fractal_exp.cli.dataset")
