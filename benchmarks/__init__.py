"""Timings, each beside a plain-torch twin in the same run. `python -m benchmarks.NAME --help` tells what one measures."""
