"""Pictures of no code, and growth on them."""

import numpy as np
import torch
from collage_helpers import merged
from PIL import Image, ImageDraw

from fractal_exp.cameras.kinds import levels_of
from fractal_exp.images.levels import decided
from fractal_exp.methods.collage.growth.exposed import Exposed
from fractal_exp.methods.collage.params import CollageParams
from fractal_exp.methods.collage.stages.base import SearchProblem
from fractal_exp.methods.collage.stages.growing import Grower
from fractal_exp.methods.collage.stages.growth import Growth
from fractal_exp.runtime.deadline import Deadline

FEW = {"counts": (6, 12), "usual": 18, "steps": 60}
BLOB = torch.tensor([[0.0, -0.9, 0.92, 0, 0.1, 0], [0.92, 0, 0, 0.9, 0, 0.01]])   # turns that hardly contract


def drawn(lines: list[tuple], width: int, side: int = 96) -> torch.Tensor:
    image = Image.new("L", (4 * side, 4 * side))
    for line in lines:
        ImageDraw.Draw(image).line([4 * side * each for each in line], 255, 4 * width, joint="curve")
    return torch.from_numpy(np.asarray(image.resize((side, side), Image.Resampling.BOX)).astype(np.float32) / 255)


BRANCH = drawn([(0.5, 0.9, 0.5, 0.5), (0.5, 0.5, 0.2, 0.15), (0.5, 0.55, 0.85, 0.2), (0.35, 0.32, 0.15, 0.4),
                (0.67, 0.4, 0.6, 0.15)], 3)
LETTER = drawn([(0.2, 0.2, 0.8, 0.2), (0.5, 0.2, 0.45, 0.85), (0.3, 0.8, 0.7, 0.8)], 12)


def clouds(side: int = 96) -> torch.Tensor:
    """Grey clouds with a dark gap: a picture that is grey inside."""
    y, x = torch.meshgrid(*2 * [torch.linspace(-1, 1, side)], indexing="ij")
    grey = 0.5 + 0.3 * torch.sin(7 * x + 2 * y) * torch.cos(5 * y)
    return grey * ((x**2 + y**2 < 0.5) & (x.abs() > 0.06))


def target_of(image: torch.Tensor, levels: str = "auto") -> Exposed:
    return Exposed.of(image, levels_of(image, decided(levels, image), CollageParams().camera))


def grower(image: torch.Tensor, **growth) -> Grower:
    return stage(image, growth=growth).grower


def stage(image: torch.Tensor, seconds: float | None = None, levels: str = "auto", **options) -> Growth:
    params = CollageParams().updated(**merged({"growth": FEW}, options))
    seen = levels_of(image, decided(levels, image), params.camera)
    return Growth(SearchProblem(image, seen, params, deadline=Deadline(seconds)), 2)
