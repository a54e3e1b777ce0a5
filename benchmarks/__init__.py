"""Timings and qualities, each beside its twin in one run. `python -m benchmarks.NAME --help` tells what it measures."""

import fractal_exp  # noqa: F401 - before torch, so that idle threads of its pool sleep
