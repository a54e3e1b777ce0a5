"""The CUDA backend of `point_counts`: the torch twin, which a GPU computes well enough."""

from .reference import point_counts

__all__ = ["point_counts"]
