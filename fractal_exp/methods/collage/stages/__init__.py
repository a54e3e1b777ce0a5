"""The stages of collage search, and what they share."""

from __future__ import annotations

from .base import SearchProblem
from .plan import Plan


def plan_of(problem: SearchProblem) -> Plan:
    """The stages of a search on this image. What only some images need is imported for them alone."""
    if not problem.levels.is_exact:
        from .drawn import DrawnPlan

        return DrawnPlan(problem)
    if problem.is_crossed:
        from .crossing import CrossedPlan

        return CrossedPlan(problem)
    return Plan(problem)
