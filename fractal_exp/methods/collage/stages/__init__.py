"""The stages of collage search, and what they share."""

from __future__ import annotations

from collections.abc import Callable

from .base import SearchProblem
from .plan import Plan


def plan_of(problem: SearchProblem) -> Plan:
    """The stages of a search on this image."""
    return PLANS[problem.kind](problem)


def _crossed(problem: SearchProblem) -> Plan:
    from .crossing import CrossedPlan

    return CrossedPlan(problem)


def _drawn(problem: SearchProblem) -> Plan:
    from .drawn import DrawnPlan

    return DrawnPlan(problem)


# By the kind of the image. What only some images need is imported for them alone.
PLANS: dict[str, Callable[[SearchProblem], Plan]] = {"rendered": Plan, "crossed": _crossed, "drawn": _drawn}
