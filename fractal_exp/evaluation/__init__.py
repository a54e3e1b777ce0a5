"""How reconstructions are drawn and judged."""

from .scoring import Perceptual, evaluate, score
from .summary import summarize

__all__ = ["Perceptual", "evaluate", "score", "summarize"]
