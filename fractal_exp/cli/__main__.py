"""`python -m fractal_exp.cli NAME …`: the command fractal-NAME, where its script is not on the path."""

import sys

from . import start

getattr(start, sys.argv.pop(1))()
