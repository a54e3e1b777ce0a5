"""The likeness of a code to a picture that others drew, whatever the camera."""

from __future__ import annotations

from ....likeness import likeness_of_attractor
from ..image.objective import ImageObjective, Rendered


def likeness_of(shown: Rendered, objective: ImageObjective) -> float:
    """The likeness of a code's drawing (F1 within a pixel), or of its attractor if that is lower and the image shows
    the whole attractor."""
    return min(likenesses(shown, objective)) if objective.levels.is_whole else objective.likeness(shown.image)


def likenesses(shown: Rendered, objective: ImageObjective) -> tuple[float, float]:
    """The likeness of a code's drawing, and that of its attractor."""
    return objective.likeness(shown.image), likeness_of_attractor(shown.code, objective.image, objective.levels)
