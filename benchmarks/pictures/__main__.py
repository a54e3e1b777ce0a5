"""Fit pictures from elsewhere: `python -m benchmarks.pictures samples`."""

from __future__ import annotations

import sys

from . import samples

if __name__ == "__main__":
    if sys.argv[1:2] != ["samples"]:
        raise SystemExit("say which pictures: python -m benchmarks.pictures samples")
    samples.main(sys.argv[2:])
