"""What `invert` returns: the code, its likeness to the input, and how it was found."""

from __future__ import annotations

import json
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from torch import Tensor

from ..cameras.camera import Camera, parse_camera
from ..colouring import in_colours
from ..dimension import Dimension
from ..dimension.samples import count_boxes
from ..errors import InputError
from ..ifs.code import IFS, View
from ..images.checks import MIN_SIDE
from ..images.levels import decided
from ..images.pixels import png, read_colour, write_image
from ..images.placement import Placement
from ..images.reading import ReadImage, read_target
from ..likeness import Likeness, default_camera, redrawn
from ..methods.base import CurvePoint
from ..methods.history import StageRecord
from ..rendering import sheets
from ..rendering.colour import on_ground, own_ground
from ..rendering.still import render_with_info
from ..rendering.tone import own_tone
from ..runtime.files import checked, make_folder
from ..verdict import Verdict
from . import answers
from .facts import VERSION, Facts, known_camera

if TYPE_CHECKING:
    from PIL.Image import Image

CODE, INVERSION, TARGET = "code.json", "inversion.json", "target.png"  # files in the folder of an inversion
LIT = 0.02    # level of the target above which a pixel counts for its dimension
WARNED = 0.8  # F1 within a pixel below which an approximation comes with a warning


@dataclass(frozen=True, eq=False)
class Inversion:
    """A code recovered from a picture, and all that is known about it.

    code: in the frame of the canvas [-1,1]²; target: the picture as the method saw it (white on black, (R,R)), with
    its `placement`; source: the given picture, a path or an array; likeness: of the code's rendering to the target;
    verdict: what the code is worth, and what may help; history: a record of every stage; stopped: why the method ended;
    seconds: how long it took; options: of the method; notes: what was done to the picture and what the method reports;
    warnings: what may spoil the result; camera: how the picture was drawn, as far as it is known or was found out;
    curve: codes of more and more maps and their likeness, if the picture showed no code and maps were grown.
    """

    code: IFS
    target: ReadImage
    source: Path | np.ndarray | Tensor
    likeness: Likeness
    verdict: Verdict
    camera: Camera
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
        """The mapping between pixels of the picture and the canvas."""
        return self.target.placement

    def render(self, view: View | None = None, *, resolution: int = 1024, points_in_view: int | None = None,
               supersample: int = 8, seed: int = 0, mode: str | None = None, reuse: int = 1,
               path: str | Path | None = None) -> Tensor:
        """A view (default: the canvas) of the code as an image (resolution, resolution); see `fractal_exp.render`.

        mode: by default "tone" if the code has one, else "occupancy"; reuse: under how many words each point is used,
        which draws several times faster (see `AddressTree`); path: a PNG to write, or None. A drawing in colour is
        written on the picture's ground. Raises `InputError` if it cannot be written.
        """
        mode = mode or ("tone" if own_tone(self.code) else "occupancy")
        image, _ = render_with_info(self.code, view, resolution=resolution, points_in_view=points_in_view,
                                    supersample=supersample, seed=seed, mode=mode, reuse=reuse)
        if path is not None:
            write_image(path, on_ground(image, self._ground) if mode == "colour" else image)
        return image

    @property
    def _ground(self) -> tuple[float, float, float]:
        level = float(self.target.inverted)  # for the codes of older versions, which do not tell their ground
        return own_ground(self.code, (level, level, level))

    def redrawn(self, *, seed: int = 0, colour: bool = False) -> Tensor:
        """The code (R,R) drawn like the picture: with its pen, dots, blur and tone, as far as they were found. colour:
        (R,R,3) instead, in the code's colours on the picture's ground. Raises `InputError` if the code has none."""
        levels = self._drawn.clone() if seed == 0 else self._drawn_like_the_picture(seed)
        return in_colours(levels, self.code, self._ground, seed) if colour else levels

    @cached_property
    def _drawn(self) -> Tensor:
        return self._drawn_like_the_picture(0)

    def _drawn_like_the_picture(self, seed: int) -> Tensor:
        return redrawn(self.code, self.target, self.camera, params=known_camera(self.options), seed=seed)

    def overlay(self, path: str | Path | None = None, *, opacity: float = 0.8) -> Image:
        """The given picture in faded greys with the differences of what the code draws: orange where it lacks light of
        the shape, blue where it has too much. A Pillow image as wide as the picture, with a legend below it. It is also
        written to `path` as a PNG, if given.

        opacity: of a full difference, in (0,1]. If `invert` was given a path, the picture is read again. Raises
        `InputError` if the opacity is out of range, or if the picture cannot be read or the file written.
        """
        from PIL import Image

        if not 0 < opacity <= 1:
            raise InputError(f"opacity must be above 0 and at most 1, got {opacity!r}")
        below = read_colour(self.source, backdrop=float(self.target.inverted))
        height, width = below.shape[:2]
        if (width, height) != self.placement.size:
            raise InputError(f"the picture {self.source} now has {width}×{height} pixels, but had "
                             f"{self.placement.size[0]}×{self.placement.size[1]}; give `invert` the new one")
        pixels = sheets.marked(below, self.redrawn(), self.target.image, self.placement.crop_box, opacity)
        if path is not None:
            write_image(path, pixels)
        return Image.fromarray(pixels)

    def answers(self, path: str | Path | None = None) -> Image:
        """What more maps are worth, as a Pillow image of up to four rows: the picture, then the simplest code of the
        `curve` that has more than its outline, one in the middle, and the closest, with their number of maps and
        likeness. Each stands whole on the left and 16 times closer on the right, drawn as `render` does, in greys. It
        is also written to `path` as a PNG, if given.

        Raises `InputError` if no maps were grown, or if the file cannot be written.
        """
        from PIL import Image

        if not self.curve:
            raise InputError("answers need codes of several numbers of maps, but the curve is empty, as no maps were "
                             "grown; invert(..., maps=64) grows some")
        pixels = answers.sheet(self.target.image, answers.offered(self.curve))
        if path is not None:
            write_image(path, pixels)
        return Image.fromarray(pixels)

    @cached_property
    def dimensions(self) -> dict[str, Dimension]:
        """Of the "code" and, by boxes, of the "picture"; without what cannot be measured, as a shape of few pixels."""
        found: dict[str, Dimension] = {}
        with suppress(InputError):
            found["code"] = self.code.dimension()
        with suppress(InputError):
            found["picture"] = count_boxes(self.target.image.numpy() > LIT)
        return found

    @property
    def dimension(self) -> str:
        """The dimensions in words."""
        return "; ".join(f"{name} {each} ({each.kind})" for name, each in self.dimensions.items())

    def facts(self) -> dict[str, Any]:
        """All but the code, as JSON data: version, method, options, source (a path or null), reading {invert,
        threshold, padding, frame, clean, crop, levels} (what `read_target` was asked), resolution, inverted, placement
        {size, crop_box}, known (the box {left, bottom, right, top} of the canvas that the picture shows, or null for
        all of it), scale (target pixels per picture pixel), levels, likeness {f1, iou, noise_ratio, f1_1px, colour,
        ssim, ssim_chance, f1_dark, ssim_share}, verdict {kind, words, remedy, change}, camera, stopped, seconds,
        stages [{name, seconds, score, error, maps}], notes, warnings, curve [{maps, likeness, bytes, code}], dimension
        {code, picture}, each {kind, value, low, high, standing, condition}.
        """
        return {
            "version": VERSION, "method": self.method, "options": _plain(self.options),
            "source": str(self.source) if isinstance(self.source, Path) else None, "reading": _plain(self.target.asked),
            "resolution": self.target.image.shape[-1], "inverted": self.target.inverted,
            "placement": {name: list(value) for name, value in asdict(self.placement).items()},
            "known": self.target.known and asdict(self.target.known),
            "scale": self.target.scale, "likeness": asdict(self.likeness), "verdict": asdict(self.verdict),
            "levels": self.target.levels, "camera": self.camera.facts(self.target.image.shape[-1]),
            "stopped": self.stopped, "seconds": self.seconds, "stages": [asdict(stage) for stage in self.history],
            "notes": list(self.notes), "warnings": list(self.warnings),
            "curve": [{"maps": each.maps, "likeness": each.likeness, "bytes": each.bytes, "code": each.code.to_json()}
                      for each in self.curve],
            "dimension": {name: asdict(each) for name, each in self.dimensions.items()},
        }

    def save(self, path: str | Path) -> Path:
        """Write the code and all facts, and return the absolute path.

        A path that ends in .json becomes one file: the code in this package's format, with `facts` under "inversion"
        in its `meta`. Any other path becomes a folder with code.json (the code alone), inversion.json (a file as above)
        and target.png (the picture as the method saw it, with 16 bits). `IFS.load` reads both JSON files, and
        `Inversion.load` the folder. Raises `InputError` if a file cannot be written.
        """
        path = Path(path).absolute()
        whole = replace(self.code, meta={**self.code.meta, "inversion": self.facts()})
        if path.suffix == ".json":
            return whole.save(path)
        make_folder(path)
        self.code.save(path / CODE)
        whole.save(path / INVERSION)
        write_image(path / TARGET, self.target.image, bits=16)
        return path

    @classmethod
    def load(cls, path: str | Path) -> Inversion:
        """Load what `save` wrote to a folder. path: the folder, or inversion.json in it.

        The target has 16 bits. The source is the path of the picture, or else the target. Older files hold no codes
        of the curve, so `curve` is empty there, and no levels, which are then decided anew. Raises `InputError` if a
        file is missing or damaged.
        """
        path = Path(path).absolute()
        folder = path.parent if path.name == INVERSION else path
        code = IFS.load(folder / INVERSION)
        facts = code.meta.get("inversion")
        if not isinstance(facts, Mapping) or facts.get("version") != VERSION:
            raise InputError(f"{folder / INVERSION} is not an inversion of this version ({VERSION}); IFS.load reads "
                             "its code")
        name = str(folder / INVERSION)
        notes = {key: value for key, value in code.meta.items() if key != "inversion"}
        try:
            return cls._from(checked(facts, Facts, name, "invert the picture again"), replace(code, meta=notes),
                             folder / TARGET)
        except InputError as error:
            raise error if str(error).startswith(name) else InputError(f"{name}: {error}") from None

    @classmethod
    def _from(cls, facts: Facts, code: IFS, target: Path) -> Inversion:
        side = read_target(target, MIN_SIDE, frame="keep", invert=False).source_size[0]
        if side != facts.resolution:
            raise InputError(f"the picture {target} has {side} px a side, expected {facts.resolution}; invert the "
                             "picture again")
        image = read_target(target, side, frame="keep", invert=False).image
        source = Path(facts.source) if facts.source else image
        read = ReadImage(image, facts.inverted, facts.placement.size, facts.placement.crop_box, facts.scale,
                         facts.notes, facts.warnings, source=source, asked=facts.reading,
                         levels=decided(facts.meaning, image), known=facts.known)
        camera = parse_camera(facts.camera, side) if facts.camera else default_camera(read)
        curve = tuple(CurvePoint(each.maps, each.likeness, each.bytes, IFS.from_json(each.code))
                      for each in facts.curve if each.code is not None)
        return cls(code=code, target=read, source=source, likeness=facts.likeness, verdict=facts.verdict,
                   history=facts.stages, stopped=facts.stopped, seconds=facts.seconds, method=facts.method,
                   options=facts.options, notes=facts.notes, warnings=facts.warnings, camera=camera, curve=curve)

    def __str__(self) -> str:
        count = len(self.code)
        return (f"{self.verdict.words}: {self.likeness}, {count} map{'s' * (count > 1)}, {self.seconds:.0f} s, "
                f"{self.stopped}")

    def __repr__(self) -> str:
        return f"<Inversion: {self}>"

    def _repr_png_(self) -> bytes:
        """What a notebook shows: the input, the code's rendering, and their difference."""
        image = self.target.image
        drawn = self.render(resolution=image.shape[-1])
        return png(sheets.comparison_strip(drawn[None], image[None], [f"F1 {self.likeness.f1:.3f}"], side=256))


def warnings_of(target: ReadImage, verdict: Verdict, likeness: Likeness, stopped: str) -> tuple[str, ...]:
    """What a user should know before trusting a code: doubts about the picture, and whether the code is far from it."""
    unlike = likeness.f1_1px < WARNED or likeness.is_outline
    far = verdict.kind == "not recovered" or (verdict.kind == "approximation" and unlike)
    return (*target.warnings, *([f"{verdict} ({stopped})"] if far else []))


def _plain(value: Any) -> Any:
    """Options as JSON data."""
    return json.loads(json.dumps(dict(value), default=lambda thing: thing.item() if hasattr(thing, "item")
                                 else repr(thing)))
