"""How exactly a GPU computes."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import torch


@contextmanager
def full_precision() -> Iterator[None]:
    """cuDNN's convolutions in float32 throughout: blurs, pyramids and perceptual features with their gradients.

    By default torch allows TF32, whose 11 significant bits leave relative errors of a thousandth.
    """
    allowed = torch.backends.cudnn.allow_tf32
    torch.backends.cudnn.allow_tf32 = False
    try:
        yield
    finally:
        torch.backends.cudnn.allow_tf32 = allowed
