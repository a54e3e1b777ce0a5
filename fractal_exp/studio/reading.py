"""The picture of a session: where it was put, and how it was read."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from PIL import Image

from ..errors import InputError, did_you_mean
from ..images.reading import ReadImage, read_colour, read_target
from ..rendering.sheets import png

RESOLUTION = 256        # pixels a side that a picture is brought to
LONGEST_NAME = 80       # characters of a file's name that are kept
SHOWN_SIDE = 480        # pixels of the longer side of the picture as it was given, shown small
SUFFIX = re.compile(r"\.(?:png|jpe?g|gif|bmp|tiff?|webp|ppm|pgm|pbm)$", re.IGNORECASE)


@dataclass(frozen=True)
class Reading:
    """How a picture is read, see `fractal_exp.images.read_target`, which refuses other values."""

    invert: bool | Literal["auto"] = "auto"
    threshold: float | None = None
    clean: bool = True
    frame: Literal["fit", "keep"] = "fit"
    crop: Sequence[int] | None = None

    @classmethod
    def of(cls, given: Mapping[str, Any]) -> Reading:
        """From plain data that a page sent."""
        unknown = sorted(set(given) - set(cls.__dataclass_fields__))
        if unknown:
            raise InputError(f"a picture is not read with {unknown[0]!r}"
                             f"{did_you_mean(unknown[0], list(cls.__dataclass_fields__)) or ';'} choose among "
                             f"{', '.join(cls.__dataclass_fields__)}")
        made = cls(**given)
        level = made.threshold
        if level is not None and not (isinstance(level, int | float) and math.isfinite(level) and 0 < level < 1):
            raise InputError(f"threshold must lie between 0 and 1, or be left empty, got {level!r}")
        return made


@dataclass(frozen=True, eq=False)
class Picture:
    """A picture as it lies in a session's folder, under a name of ours; `name` is that of the file that it came from,
    and `read` what the reader made of it."""

    path: Path
    name: str
    reading: Reading
    read: ReadImage

    @classmethod
    def taken(cls, path: Path, name: str, reading: Reading) -> Picture:
        """The file read as `reading` says. Raises `InputError`, which calls the file by its own name."""
        try:
            return cls(path, name, reading, read_target(path, RESOLUTION, invert=reading.invert, clean=reading.clean,
                                                        threshold=reading.threshold, frame=reading.frame,
                                                        crop=reading.crop))
        except InputError as error:
            raise InputError(str(error).replace(str(path), name)) from error

    def again(self, reading: Reading) -> Picture:
        """The same picture, read otherwise."""
        return self.taken(self.path, self.name, reading)

    def target_png(self) -> bytes:
        """The image that is searched, white on black."""
        return png(self.read.image)

    def given_png(self) -> bytes:
        """The picture as it was given, small."""
        image = Image.fromarray(read_colour(self.path, backdrop=float(self.read.inverted)))
        image.thumbnail((SHOWN_SIDE, SHOWN_SIDE))
        return png(np.asarray(image))

    def facts(self) -> dict[str, Any]:
        """What is shown of it: plain data."""
        read, (width, height) = self.read, self.read.source_size
        return {
            "name": self.name, "width": width, "height": height, "square": list(read.crop_box),
            "inverted": read.inverted, "scale": read.scale, "warnings": list(read.warnings),
            "notes": [note for note in read.notes if note not in read.warnings], "reading": {
                "invert": self.reading.invert, "threshold": self.reading.threshold, "clean": self.reading.clean,
                "frame": self.reading.frame, "crop": read.crop and list(read.crop)},
        }


def plain_name(given: str) -> str:
    """The last part of a file's name, printable and short; it is only ever shown."""
    last = re.split(r"[/\\]", given)[-1]
    text = "".join(letter for letter in last if letter.isprintable()).strip()
    return text[-LONGEST_NAME:] or "picture"


def file_name(name: str) -> str:
    """The name under which a picture is put into a folder of ours: of the given one, only a known ending is kept."""
    found = SUFFIX.search(name)
    return f"picture{found[0].lower() if found else ''}"
