"""Render and judge reconstructions."""

from .scoring import Perceptual, evaluate, score
from .summary import summarize

__all__ = ["Perceptual", "evaluate", "score", "summarize"]
