"""Plain data of a right form with one wrong value."""

import copy

HUGE = "a number of 400 digits"  # stands for it until the file is written
EXTREMES = [None, True, -1, 0, 0.5, 60_000, 10**20, 1e308, float("inf"), float("nan"), HUGE, "", "x", "a\nb" * 2000,
            "\0", "\ud800", [], {}, [[]], [0], {"a": 0}, {"x\ny" * 500: 1}]
GONE = object()


def paths(data, path=()):
    """Where every value of plain data stands."""
    yield path
    for key, value in data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ():
        yield from paths(value, (*path, key))


def crafted(data, below=()):
    """Every way to replace one value of plain data, or to leave it out."""
    for path in paths(data):
        if len(path) <= len(below) or path[:len(below)] != below:
            continue
        for value in [*EXTREMES, GONE]:
            other = copy.deepcopy(data)
            place = other
            for key in path[:-1]:
                place = place[key]
            if value is GONE:
                del place[path[-1]]
            else:
                place[path[-1]] = value
            yield path, value, other
