"""What the forward model hands on and the losses judge."""

from __future__ import annotations

from dataclasses import dataclass

from torch import Tensor


@dataclass(frozen=True)
class Rendering:
    """An image and what it was made of; `…` is an optional leading batch of codes.

    image (…,R,R) in [0,1]; points (…,P,2), those that were splatted, in the frame of the image; singular (…,N,2) and
    offset (…,N,2), the singular values and offsets of the maps before normalisation, as the regulariser reads them.
    """

    image: Tensor
    points: Tensor
    singular: Tensor
    offset: Tensor
