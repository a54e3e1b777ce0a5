"""Score a reconstruction on the views of its truth, one row per view."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import torch
from torch import Tensor

from ..errors import InputError
from ..ifs import attractor
from ..ifs.code import IFS, View
from ..perceptual import distances as perceptual
from ..rendering.cache import ImageCache
from ..rendering.still import check_resolution, points_per_view
from ..runtime.checks import check_choice
from ..runtime.extras import need
from . import metrics
from .views import code_of, evaluation_views

if TYPE_CHECKING:
    import pandas as pd

ALIGNMENTS: dict[str, Callable[[IFS], IFS]] = {"bbox": attractor.normalize, "none": lambda code: code}
RESULT_STREAM, TRUTH_STREAM = 0, 1  # so that even a perfect code is drawn with other points than its truth

Distance = Callable[[Tensor, Tensor], Tensor]


class Renderable(Protocol):
    """Anything with an image of every view. An `IFS` is rendered by `render`; anything else renders itself."""

    def render(self, view: View, *, resolution: int, points_in_view: int | None = None, supersample: int = 8,
               seed: int = 0) -> Tensor:
        """The grey image (R,R) in [0,1] of a view."""
        ...


@dataclass(frozen=True)
class Constant:
    """An image of one grey level at every view: what any method must beat."""

    value: float

    def render(self, view: View, *, resolution: int, **_: Any) -> Tensor:
        """(R,R), all `value`."""
        return torch.full((resolution, resolution), self.value)


TRIVIAL: dict[str, Constant] = {"all white": Constant(1.0), "all black": Constant(0.0)}


@dataclass(frozen=True)
class Perceptual:
    """The perceptual distance of a table, or the reason why it has none.

    distance(a (B,H,W), b) -> (B,). `name` is stored in the table's attributes. LPIPS distances are in the column lpips,
    any other distance in NAME_distance. Lower is better in both.
    """

    name: str
    distance: Distance | None = None
    absent: str | None = None

    @classmethod
    def load(cls, kind: str = "none", weights: str | Path | None = None, input_range: str = "correct") -> Perceptual:
        """The distance of `perceptual.distances.load`, or an absent one if weights are missing or none was asked for.

        Raises `InputError` on an unknown kind or a file that does not fit.
        """
        if kind == "none":
            return cls("none", absent="no perceptual distance was asked for")
        try:
            return cls(kind, perceptual.load(kind, weights, input_range))
        except perceptual.WeightsUnavailable as error:
            return cls(kind, absent=str(error))

    @property
    def column(self) -> str:
        """The name of its column. It is not just `fractal`, because that column holds the names of fractals."""
        return "lpips" if self.name == "none" or self.name.startswith("lpips") else f"{self.name}_distance"

    def check(self, side: int, setting: str = "resolution") -> None:
        """Raise `InputError` if SSIM, or a distance that there is, cannot be measured on the inner 75% of pictures with
        `side` >= 1 pixels per side. setting: the name of the option that sets the side, for the message."""
        if side < metrics.SMALLEST:
            raise InputError(f"SSIM needs pictures of at least {metrics.SMALLEST} px a side, got {side}; raise "
                             f"{setting}")
        if self.distance is None:
            return

        def inner(pixels: int) -> int:
            return metrics.inner_crop(torch.empty(pixels, pixels, device="meta")).shape[-1]

        smallest = getattr(self.distance, "smallest_px", 1)
        if inner(side) < smallest:
            enough = next(pixels for pixels in count(smallest) if inner(pixels) >= smallest)
            raise InputError(f"{self.name} needs pictures of at least {smallest} px a side, and is measured on the "
                             f"inner {inner(side)} px of {side}; raise {setting} to {enough} or more, or take no "
                             "perceptual distance (perceptual=none)")

    def measure(self, images: Tensor, truth: Tensor) -> Tensor:
        """(B,), NaN if there is no distance. Takes one pair at a time: features of large images take gigabytes."""
        if self.distance is None:
            return torch.full((len(images),), torch.nan)
        with torch.no_grad():
            return torch.cat([self.distance(a[None], b[None]).reshape(1).cpu()
                              for a, b in zip(images, truth, strict=True)])


@dataclass(frozen=True)
class Scored:
    """A reconstruction and its truth, rendered at the same views: images (V,R,R) each, and the distance to measure.
    left_out: the names of views that the reconstruction cannot show."""

    views: dict[str, View]
    images: Tensor
    truth: Tensor
    perceptual: Perceptual
    left_out: tuple[str, ...] = ()

    @cached_property
    def frame(self) -> pd.DataFrame:
        """One row per view: view, zoom, center_x, center_y, empty, f1, iou, psnr, ssim, lpips (see `evaluate`), and the
        distance if it has another column."""
        import pandas as pd

        measured, empty = metrics.compare(self.images, self.truth), metrics.empty_pairs(self.images, self.truth)
        distance = self.perceptual.measure(metrics.inner_crop(self.images), metrics.inner_crop(self.truth))
        table = pd.DataFrame({
            "view": list(self.views),
            "zoom": [view.zoom for view in self.views.values()],
            "center_x": [view.center[0] for view in self.views.values()],
            "center_y": [view.center[1] for view in self.views.values()],
            "empty": empty.numpy(),
            **{name: values.double().numpy() for name, values in measured.items()},
            "lpips": torch.nan,
        })
        table[self.perceptual.column] = distance.masked_fill(empty, torch.nan).double().numpy()
        table.attrs = {"perceptual": self.perceptual.name, "perceptual_absent": self.perceptual.absent,
                       "left_out": list(self.left_out)}
        return table


def score(reconstruction: IFS | Renderable, truth: IFS | Renderable, *, resolution: int = 1024,
          points_in_view: int | None = None, supersample: int = 8, views: str = "attractor", align: str = "bbox",
          seed: int | None = None, perceptual: Perceptual | str = "none", cache: str | Path | None = None,
          device: str = "cpu") -> Scored:
    """`evaluate`, with the images that were compared."""
    need("kornia", "pandas")
    check_choice("align", align, ALIGNMENTS)
    check_resolution(resolution)
    every, largest = evaluation_views(truth, views, seed=seed), getattr(reconstruction, "largest_zoom", math.inf)
    chosen = {name: view for name, view in every.items() if view.zoom <= largest}
    if not chosen:
        raise InputError(f"there is no view to judge by: the reconstruction only shows zooms up to {largest:g}")
    wanted = points_per_view(resolution) if points_in_view is None else points_in_view
    size = {"resolution": resolution, "points_in_view": wanted, "supersample": supersample}
    if isinstance(perceptual, str):
        perceptual = Perceptual.load(perceptual)
    perceptual.check(resolution)
    images = _draw(_aligned(reconstruction, align), chosen, RESULT_STREAM, size, ImageCache(None, device))
    truths = _draw(_aligned(truth, "bbox"), chosen, TRUTH_STREAM, size, ImageCache(cache, device))
    return Scored(chosen, images, truths, perceptual, tuple(name for name in every if name not in chosen))


def evaluate(reconstruction: IFS | Renderable, truth: IFS | Renderable, *, resolution: int = 1024,
             points_in_view: int | None = None, supersample: int = 8, views: str = "attractor", align: str = "bbox",
             seed: int | None = None, perceptual: Perceptual | str = "none", cache: str | Path | None = None,
             device: str = "cpu") -> pd.DataFrame:
    """Compare a reconstruction with its truth on the seven views of the truth: a table with one row per view.

    The columns are view (its name), zoom, center_x, center_y, empty, and then f1, iou, psnr (dB), ssim and lpips of the
    inner 75% (see `metrics`). A pair of images that are both black there says nothing: `empty` is True and all scores
    are NaN, so means leave it out. Views with a zoom above a reconstruction's `largest_zoom`, if it has one, are
    missing; `attrs["left_out"]` names them. The distance "fractal" is not LPIPS; its column is fractal_distance. The
    `attrs` of the table name the perceptual distance, or say why there is none and its column is NaN.

    - resolution, points_in_view, supersample, device: as in `render`.
    - views: "attractor", "released" or "uniform", see `evaluation_views`. Only "released" is comparable with published
      figures.
    - align: the frame of the reconstruction. "bbox" brings its code to the canvas by the box of its own attractor, as
      in the paper. "none" leaves it in the frame of the input. The truth is always brought to the canvas
      (`attractor.normalize`), as for the input of a method.
    - seed: of the views; by default it depends only on the truth (`views_seed`).
    - perceptual: a loaded `Perceptual`, or the name of a distance.
    - cache: a folder for the images of the truth.

    Raises `InputError` on an unknown choice, a size that cannot be rendered or is too small for the distance, or a code
    that is not contractive.
    """
    return score(reconstruction, truth, resolution=resolution, points_in_view=points_in_view, supersample=supersample,
                 views=views, align=align, seed=seed, perceptual=perceptual, cache=cache, device=device).frame


def _aligned(thing: IFS | Renderable, align: str) -> IFS | Renderable:
    """The thing's code in the frame in which it is judged; or the thing itself if it has no code."""
    code = code_of(thing)
    return thing if code is None else ALIGNMENTS[align](code)


def _draw(thing: IFS | Renderable, views: dict[str, View], stream: int, size: dict[str, int], cache: ImageCache
          ) -> Tensor:
    """The images (V,R,R) of all views, each with its own seed."""
    drawn = []
    for number, view in enumerate(views.values()):
        draw = partial(cache.render, thing) if isinstance(thing, IFS) else thing.render
        drawn.append(draw(view, seed=2 * number + stream, **size))
    return torch.stack(drawn)
