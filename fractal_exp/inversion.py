"""What `invert` returns: the code, how like the input it is, and how it was found."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from torch import Tensor

from .errors import InputError
from .evaluation import metrics
from .ifs.code import IFS, View
from .images.placement import Placement
from .images.reading import ReadImage, read_colour, write_image
from .methods.base import CurvePoint
from .methods.collage.image.objective import ImageObjective
from .methods.collage.measure.levels import levels_of
from .methods.collage.params import CollageParams
from .methods.history import StageRecord
from .rendering import sheets
from .rendering.still import points_per_view, render_with_info
from .runtime.seeds import derive

if TYPE_CHECKING:
    from PIL.Image import Image

VERSION = 1  # of the facts in inversion.json
COLOUR = (255, 96, 0)
OVERLAY_SUPERSAMPLE = 4
OVERLAY_POINTS = points_per_view(2048)  # at most; larger overlays are thinner, not slower
WITHIN_NOISE = 1.2  # a noise ratio below which a code cannot be told from the true one
VERDICTS = (  # of an F1 from there on
    (0.97, "the code has nearly the shape of the input"),
    (0.8, "the code has roughly the shape of the input"),
    (0.0, "the code is far from the input, which may be of no code with so few maps"),
)
FAR = VERDICTS[1][0]



@dataclass(frozen=True)
class Likeness:
    """How like the input a code's rendering is, both (R,R), the rendering made as the input was drawn (its grey levels
    a density of points, a coverage of pixels, or black and white).

    f1, iou: of the masks I > 0 on the whole canvas, in [0,1]. noise_ratio: the error of the rendering over the error
    between two renderings of the code with other random points: about 1 for the true code. The error compares both at
    several scales, see `methods.collage`.
    """

    f1: float
    iou: float
    noise_ratio: float

    @classmethod
    def of(cls, code: IFS, image: Tensor, *, levels: str = "auto", seed: int = 0) -> Likeness:
        """The likeness of a contractive code to an image (R,R) in [0,1]; levels: what its grey levels mean, "density",
        "coverage", "binary" or "auto"."""
        params = CollageParams()
        objective = ImageObjective(image, levels_of(image, levels, params.camera), params, derive(seed, "likeness"))
        rendering = objective.render(code)
        return cls(float(metrics.f1(rendering[None], image[None])), float(metrics.iou(rendering[None], image[None])),
                   objective.error(rendering) / objective.noise(code))

    @property
    def verdict(self) -> str:
        """What the figures mean, in words."""
        if self.noise_ratio < WITHIN_NOISE:
            return "the code renders the input to within a rendering's own noise"
        return next(words for least, words in VERDICTS if self.f1 >= least)

    def __str__(self) -> str:
        return f"F1 {self.f1:.3f}, IoU {self.iou:.3f}, error {self.noise_ratio:.3g} × noise"


@dataclass(frozen=True, eq=False)
class Inversion:
    """A code that was recovered from a picture, and what is to be known of it.

    code: in the frame of the canvas [-1,1]²; target: the picture as the method saw it (white on black, (R,R)), with
    its `placement`; source: the picture as it was given, a path or an array; likeness: of the code's rendering to the
    target; history: a record of every stage; stopped: why the method ended; seconds: that it took; options: of the
    method; notes: what was done to the picture and what the method says; warnings: what may spoil the result; curve:
    codes of more and more maps and their likeness, where the picture showed no code and maps were grown.
    """

    code: IFS
    target: ReadImage
    source: Path | np.ndarray | Tensor
    likeness: Likeness
    history: tuple[StageRecord, ...]
    stopped: str
    seconds: float
    method: str
    options: Mapping[str, Any] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    curve: tuple[CurvePoint, ...] = ()

    @property
    def placement(self) -> Placement:
        """What takes pixels of the picture to the canvas and back."""
        return self.target.placement

    def render(self, view: View | None = None, *, resolution: int = 1024, points_in_view: int | None = None,
               supersample: int = 8, seed: int = 0) -> Tensor:
        """A view (default: the canvas) of the code as an image (resolution, resolution); see `fractal_exp.render`."""
        image, _ = render_with_info(self.code, view, resolution=resolution, points_in_view=points_in_view,
                                    supersample=supersample, seed=seed)
        return image

    def overlay(self, path: str | Path | None = None, *, colour: tuple[int, int, int] = COLOUR,
                opacity: float = 0.8) -> Image:
        """The code's rendering in `colour` (red, green, blue up to 255) over the picture as it was given, at its own
        resolution, as a Pillow image; written as PNG to `path`, if there is one.

        opacity: of a fully lit pixel, in (0,1]. A path that was given to `invert` is read again. Raises `InputError`
        on a colour or opacity out of range, and where the picture cannot be read or the file cannot be written.
        """
        from PIL import Image

        if len(colour) != 3 or not all(0 <= part <= 255 for part in colour):
            raise InputError(f"colour must be (red, green, blue) from 0 to 255 each, got {colour!r}")
        if not 0 < opacity <= 1:
            raise InputError(f"opacity must be above 0 and at most 1, got {opacity!r}")
        below = read_colour(self.source, backdrop=float(self.target.inverted))
        height, width = below.shape[:2]
        if (width, height) != self.placement.size:
            raise InputError(f"the picture {self.source} has {width}×{height} pixels now, and had "
                             f"{self.placement.size[0]}×{self.placement.size[1]}; give `invert` the new one")
        longer = max(width, height)
        lit = self.render(self.placement.view(), resolution=longer, supersample=OVERLAY_SUPERSAMPLE,
                          points_in_view=min(points_per_view(longer), OVERLAY_POINTS))
        cover = opacity * lit.numpy()[:height, :width, None]
        pixels = np.rint((1 - cover) * below + cover * np.array(colour, np.float32)).astype(np.uint8)
        if path is not None:
            write_image(path, pixels)
        return Image.fromarray(pixels)

    def facts(self) -> dict[str, Any]:
        """All but the code as plain JSON data: version, method, options, source (a path or null), resolution, inverted,
        placement {size, crop_box}, likeness {f1, iou, noise_ratio}, verdict, stopped, seconds, stages [{name, seconds,
        score, error, maps}], notes, warnings, curve [{maps, likeness, bytes}]."""
        return {
            "version": VERSION, "method": self.method, "options": _plain(self.options),
            "source": str(self.source) if isinstance(self.source, Path) else None,
            "resolution": self.target.image.shape[-1], "inverted": self.target.inverted,
            "placement": {name: list(value) for name, value in asdict(self.placement).items()},
            "likeness": asdict(self.likeness), "verdict": self.likeness.verdict,
            "stopped": self.stopped, "seconds": self.seconds, "stages": [asdict(stage) for stage in self.history],
            "notes": list(self.notes), "warnings": list(self.warnings),
            "curve": [{"maps": each.maps, "likeness": each.likeness, "bytes": each.bytes} for each in self.curve],
        }

    def save(self, path: str | Path) -> Path:
        """Write the code and all facts, and return the absolute path.

        A path that ends in .json becomes one file: the code in this package's format, with `facts` under "inversion"
        in its `meta`. Any other path is a folder, made if need be, of code.json (the code alone) and inversion.json
        (such a file). `IFS.load` reads each of them. Raises `InputError` where a file cannot be written.
        """
        path = Path(path).absolute()
        whole = replace(self.code, meta={**self.code.meta, "inversion": self.facts()})
        if path.suffix == ".json":
            return whole.save(path)
        try:
            path.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"cannot make the folder {path}: {error.strerror}") from error
        self.code.save(path / "code.json")
        whole.save(path / "inversion.json")
        return path

    def __str__(self) -> str:
        count = len(self.code)
        return f"{self.likeness}, {count} map{'s' * (count > 1)}, {self.seconds:.0f} s, {self.stopped}"

    def __repr__(self) -> str:
        return f"<Inversion: {self}>"

    def _repr_png_(self) -> bytes:
        """What a notebook shows: the input, the code's rendering and their difference."""
        image = self.target.image
        drawn = self.render(resolution=image.shape[-1])
        return sheets.png(sheets.comparison_strip(drawn[None], image[None], [f"F1 {self.likeness.f1:.3f}"], side=256))


def warnings_of(target: ReadImage, likeness: Likeness, stopped: str) -> tuple[str, ...]:
    """What a user should know before trusting a code: doubts about the picture, and a code that is far from it."""
    far = likeness.noise_ratio >= WITHIN_NOISE and likeness.f1 < FAR
    return (*target.warnings, *([f"{likeness.verdict} ({stopped})"] if far else []))


def _plain(value: Any) -> Any:
    """Options as JSON data."""
    return json.loads(json.dumps(dict(value), default=lambda thing: thing.item() if hasattr(thing, "item")
                                 else repr(thing)))
