"""Timings and qualities, each beside its twin in one run. `python -m benchmarks.NAME --help` tells what it measures."""
