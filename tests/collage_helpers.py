"""What the tests of collage search share: parts of it with few parameters given."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
import torch
from torch import Tensor

from fractal_exp.cameras.camera import Camera
from fractal_exp.cameras.kinds import kind_of, levels_of
from fractal_exp.ifs import affine
from fractal_exp.ifs.code import IFS
from fractal_exp.images.levels import meaning_of
from fractal_exp.methods.base import Progress
from fractal_exp.methods.collage.image.objective import ImageObjective
from fractal_exp.methods.collage.measure.search import MeasureSearch, Regime
from fractal_exp.methods.collage.method import Collage
from fractal_exp.methods.collage.moves.search import ImageSearch
from fractal_exp.methods.collage.params import CollageParams
from fractal_exp.methods.collage.stages.base import SearchProblem
from fractal_exp.methods.collage.state import Candidate
from fractal_exp.ops.collage import BinnedMeasure
from fractal_exp.ops.collage.reference import displacement_squared
from fractal_exp.runtime.checkpoint import Checkpoint

IDENTITY = torch.tensor([1.0, 0, 0, 1, 0, 0])
PARAMS = CollageParams()
CAMERA = PARAMS.camera
DENSITY, BINARY = (kind_of(name)(CAMERA) for name in ("density", "binary"))
FEW = {"search": {"restarts": 1, "moves": 1, "detail_moves": 1}, "moves": {"count": 0}, "rounds": 1,   # moves
       "growth": {"enabled": False}}
BRIEF = {  # a search goes through all its steps, but does not polish what it has found for long
    "image": {"last_renderings": 1, "reduced_renderings": 1}, "refine": {"steps": 30},
    "moves": {"polish_ends": 1, "polish_starts": 0}, "saturation": {"trajectories": 500},
    "gauss_newton": {"rendered_steps": 1, "strides": [1.0, 2.0], "last_patience": 1},
    "rounding": {"polish": 1, "lines_tried": 1}, "growth": {"enabled": False}}

UNPOLISHED = {  # searches by renderings judge a code as it is
    "gauss_newton": {"enabled": False}, "refine": {"steps": 0}, "moves": {"pruning": False, "root": 0.0}}


def merged(first: dict, second: dict) -> dict:
    """Nested parameters, those of the second over those of the first."""
    both = dict(first)
    for name, value in second.items():
        before = both.get(name)
        both[name] = merged(before, value) if isinstance(before, dict) and isinstance(value, dict) else value
    return both


def params(**options) -> CollageParams:
    return PARAMS.updated(**options)


def objective(image: Tensor, levels=DENSITY, seed: int = 0, renderings: int = 1, **options) -> ImageObjective:
    return ImageObjective(image, levels, params(**options), seed, renderings)


def image_search(image: Tensor, **options) -> ImageSearch:
    return ImageSearch(objective(image, **options), DENSITY.measure(image), noise=0.1)


def measure_search(masses: Tensor, grid: int = 64, seed: int = 0, smaller: float = 1.0, **options) -> MeasureSearch:
    options = merged({"search": {"proposals": 1, "grid": grid}}, options)
    return MeasureSearch(masses, Regime.whole(params(**options)), params(**options), seed, smaller)


def problem(image: Tensor, **options) -> SearchProblem:
    meaning = options.pop("levels", meaning_of(image))
    given = params(**merged(FEW, options))
    return SearchProblem(image, levels_of(image, meaning, given.camera), given)


def unpolished(image: Tensor, **options) -> SearchProblem:
    return problem(image, **merged(UNPOLISHED, options))


def small(**options) -> Collage:
    """A brief search of two restarts and few moves on coarse grids."""
    few = {"search": {"restarts": 2, "moves": 3, "detail_moves": 2, "grid": 32, "detail_grid": 32},
           "moves": {"count": 2}, "rounds": 1, "previews": 1}
    return Collage(**merged(merged(BRIEF, few), options))


def interrupted(search: Collage, image: Tensor, stops: Callable[[list[Progress]], bool],
                checkpoint: Checkpoint | None = None) -> list[Progress]:
    """What a search tells which is interrupted whenever `stops` holds for what was told."""
    told = []

    def listen(progress: Progress) -> None:
        told.append(progress)
        if stops(told):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        search.reconstruct(image, on_step=listen, checkpoint=checkpoint)
    return told


def check_it_goes_on(search: Callable[[], Collage], image: Tensor, stops: Callable[[list[Progress]], bool],
                     path: Path, whole: IFS) -> None:
    """An interrupted search that goes on from its checkpoint ends with the code `whole`, bit for bit."""
    interrupted(search(), image, stops, Checkpoint(path))
    resumed = search().reconstruct(image, checkpoint=Checkpoint(path, resume=True)).code
    for part in ("linear", "offset"):
        assert torch.equal(getattr(resumed, part), getattr(whole, part)), f"{part} is another than without interruption"


def tied(maps: Tensor, error: float = 0.0) -> Candidate:
    """A candidate whose weights are its own, and those of |det| + 0.01."""
    return Candidate(maps, affine.volumes(maps), error)


def distances(a: Tensor, b: Tensor, measure: BinnedMeasure) -> Tensor:
    """Root mean square over the measure of |f(x) - g(x)|, canvas units: maps (n,6) and (m,6) -> (n,m)."""
    difference = a[:, None] - b[None]
    return displacement_squared(difference + IDENTITY, measure.mean, measure.covariance).sqrt()


def random(seed: int = 0) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def pen_camera(tile: float, radius: float, blur: float) -> Camera:
    """The camera of lines and areas; tile: 0 for the attractor itself."""
    return Camera("coverage", tile=tile, pen=radius, blur=blur)


def dot_camera(gain: float, blur: float) -> Camera:
    return Camera("dots", gain=gain, blur=blur)


def stroke_camera(depth: float, thinning: float, radius: float, blur: float) -> Camera:
    return Camera("strokes", depth=depth, thinning=thinning, pen=radius, blur=blur)
