"""The CUDA backend of `sequence` and `blob_error`: the torch twins, which a GPU computes well enough."""

from .reference import blob_error, sequence

__all__ = ["blob_error", "sequence"]
