"""What evolutionary programming and cuckoo search share: codes as rows of numbers, and all of them drawn at once.

A population is a tensor (P,N,6), a row `a b c d e f` for each map: x' = a x + b y + e, y' = c x + d y + f.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import Annotated

import torch
from pydantic import Field
from torch import Tensor

from ...errors import InputError
from ...ifs import affine, attractor
from ...ifs.attractor import FRAME_SIDE
from ...ifs.code import IFS, sampling_probabilities
from ...ops.occupancy import occupancy
from ...runtime.params import Params
from ...runtime.seeds import derive
from ..base import resized
from ..stepwise import SMALLEST_INPUT, State, Walk, check_resolution

MAPS = 10          # "a conservative number of functions" for all compared methods (section 5.1 of the paper)


class PopulationParams(Params):
    """The parameters that both methods have."""

    maps: Annotated[int, Field(ge=1, le=64)] = MAPS
    """Number of maps of every code (section 5.1 of the paper: 10)."""
    population: Annotated[int, Field(ge=2, le=100_000)] = 100
    """Codes that are kept at a time (100 for both methods in the paper's comparison)."""
    side: Annotated[int, Field(ge=SMALLEST_INPUT)] | None = None
    """Pixels a side on which codes are compared with the image; null: the image's own."""
    threshold: Annotated[float, Field(gt=0, le=1)] = 0.25
    """Grey level from which a pixel of the image belongs to the shape (0.25 in the paper's comparison)."""
    points_per_pixel: Annotated[float, Field(gt=0, le=1000)] = 1.0
    """Points that a code is drawn with, for each pixel of the whole image. The papers do not tell theirs; this is
    enough to fill most of a shape, and what takes the time."""
    normalize: bool = True
    """Whether the box of a code's points is centred and brought to three quarters of the canvas, as the input's shape
    is, before it is compared (section 4.1 of the paper, for its own method)."""
    bound: Annotated[float, Field(gt=0, lt=1)] = 0.707
    """Largest magnitude of an entry of a matrix (0.707 in the paper's comparison)."""
    largest: Annotated[float, Field(gt=0, lt=1)] = 0.99
    """Largest singular value that a map is drawn with: a matrix above it is shrunk as a whole. The papers allow up to
    1.41, with which a code has no attractor."""
    as_released: bool = False
    """Whether the method works as in the program released with the paper, whose defects docs/comparisons.md tells."""


@dataclass(frozen=True)
class Overlap:
    """How each code's image B lies on the shape A, in pixels: |A ∧ B| and |B|, (P,) each, |A|, and all pixels."""

    both: Tensor
    drawn: Tensor
    shape: int
    pixels: int

    @property
    def mismatched(self) -> Tensor:
        """|A ⊕ B|, (P,)."""
        return self.shape + self.drawn - 2 * self.both


class Canvas:
    """An image (R,R) as a shape, and codes that are drawn beside it with the same random numbers from first to last, so
    that a code's fitness is always the same. Raises `InputError` if no pixel or every pixel belongs to the shape."""

    def __init__(self, image: Tensor, params: PopulationParams, seed: int):
        check_resolution(len(image))
        self.params, self.seed = params, derive(seed, "points")
        self.shape = resized(image, params.side) >= params.threshold
        self.lit = int(self.shape.sum())
        if not 0 < self.lit < self.shape.numel():
            found, remedy = ("no pixel", "lower") if self.lit == 0 else ("every pixel", "raise")
            raise InputError(f"{found} of the target reaches the threshold {params.threshold}, so there is no shape to "
                             f"compare with; {remedy} threshold")

    def draw(self, maps: Tensor) -> Tensor:
        """The pixels (P,S,S) uint8 that codes (P,N,6) light."""
        linear, offset = self.contracted(maps)
        points = max(1, round(self.params.points_per_pixel * self.shape.numel()))
        probabilities = None if self.params.as_released else sampling_probabilities(linear)
        return occupancy(linear, offset, len(self.shape), points=points, probabilities=probabilities,
                         frame=FRAME_SIDE if self.params.normalize else None, seed=self.seed)

    def overlap(self, maps: Tensor) -> Overlap:
        """Of codes (P,N,6)."""
        drawn = self.draw(maps).bool()
        return Overlap((drawn & self.shape).sum((1, 2)), drawn.sum((1, 2)), self.lit, self.shape.numel())

    def code(self, maps: Tensor) -> IFS:
        """The code of rows (N,6), in the frame of the image."""
        linear, offset = self.contracted(maps.cpu())
        code = IFS(linear, offset)
        return attractor.normalize(code) if self.params.normalize else code

    def contracted(self, maps: Tensor) -> tuple[Tensor, Tensor]:
        """Matrices (…,N,2,2), shrunk where they do not contract enough, and offsets (…,N,2)."""
        maps = affine.shrunk(maps, self.params.largest)
        return maps[..., :4].unflatten(-1, (2, 2)), maps[..., 4:]


class PopulationWalk(Walk):
    """A search on one image: the genomes (P,N,6) of its codes, what each costs, and the best one that was met."""

    def __init__(self, image: Tensor, params: PopulationParams, seed: int):
        super().__init__(image, params, seed)
        self.canvas, self.device = Canvas(image, params, seed), image.device

    @abstractmethod
    def initial(self) -> Tensor:
        """The first genomes, on the CPU."""

    @abstractmethod
    def cost(self, genome: Tensor) -> Tensor:
        """What is lowered, of every code, (P,)."""

    def maps(self, genome: Tensor) -> Tensor:
        """The maps (…,6) of genes (…,6): offsets go through tanh."""
        return torch.cat([genome[..., :4], genome[..., 4:].tanh()], -1)

    def start(self) -> State:
        genome = self.initial().to(self.device)
        cost = self.cost(genome)
        return with_best(genome, cost, {"best": genome[0], "least": cost[0]})

    def loss(self, state: State) -> float:
        return float(state["least"])

    def code(self, state: State) -> IFS:
        return self.canvas.code(self.maps(state["best"]))

    def draw(self, state: State) -> Tensor:
        return self.canvas.draw(self.maps(state["best"][None]))[0].float()


def bounded(maps: Tensor, bound: float) -> Tensor:
    """Rows (…,6) with every entry of the matrices within ±bound."""
    return torch.cat([maps[..., :4].clamp(-bound, bound), maps[..., 4:]], -1)


def with_best(genome: Tensor, cost: Tensor, before: State) -> dict[str, Tensor]:
    """The state of genomes (P,N,6) of these costs (P,), with the best one ever: of them, or of the state before."""
    k = cost.argmin()
    best, least = (genome[k], cost[k]) if cost[k] < before["least"] else (before["best"], before["least"])
    return {"genome": genome, "cost": cost, "best": best.clone(), "least": least.clone()}
