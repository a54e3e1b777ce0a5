"""The picture of a session: where it was put, and how it was read."""

from __future__ import annotations

import hashlib
import re
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from ..errors import InputError
from ..images.checks import MIN_SIDE, Frame
from ..images.pixels import png, read_small
from ..images.reading import ReadImage, read_target
from ..runtime.files import write_atomically
from ..runtime.params import Params
from ..verdict import LARGEST_SIDE

RESOLUTION = 256        # pixels a side that a picture is brought to
MOST_PIXELS = 100 * 10**6  # of a picture, as many as are decoded: at most 400 MB
LONGEST_NAME = 80       # characters of a file's name that are kept
SHOWN_SIDE = 480        # pixels of the longer side of the picture as it was given, shown small
SUFFIX = re.compile(r"\.(?:png|jpe?g|gif|bmp|tiff?|webp|ppm|pgm|pbm)$", re.IGNORECASE)


class Reading(Params):
    """How a picture is read, see `fractal_exp.images.read_target`; resolution: pixels a side that it is brought to."""

    invert: bool | Literal["auto"] = "auto"
    threshold: Annotated[float, Field(gt=0, lt=1)] | None = None
    clean: bool = True
    frame: Frame = "fit"
    crop: tuple[int, int, int, int] | None = None
    resolution: Annotated[int, Field(ge=MIN_SIDE, le=LARGEST_SIDE)] = Field(default_factory=lambda: RESOLUTION)


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
            return cls(path, name, reading, read_target(path, **dict(reading), most_pixels=MOST_PIXELS))
        except InputError as error:
            raise InputError(str(error).replace(str(path), name)) from error

    @classmethod
    def put(cls, data: bytes, path: Path, name: str) -> Picture:
        """A file of these bytes, read as usual; none is left where that fails. Raises `InputError`."""
        try:
            write_atomically(path, data)
            return cls.taken(path, name, Reading())
        except BaseException:
            path.unlink(missing_ok=True)
            raise

    def again(self, reading: Reading) -> Picture:
        """The same picture, read otherwise."""
        return self.taken(self.path, self.name, reading)

    @cached_property
    def target_png(self) -> bytes:
        """The image that is searched, white on black."""
        return png(self.read.image)

    @cached_property
    def given_png(self) -> bytes:
        """The picture as it was given, small; read once. Raises `InputError` if the file is gone."""
        return png(read_small(self.path, SHOWN_SIDE, backdrop=float(self.read.inverted)))

    @cached_property
    def digest(self) -> str:
        """SHA-256 of the file."""
        with self.path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()

    def facts(self) -> dict[str, Any]:
        """What is shown of it: plain data."""
        read, (width, height) = self.read, self.read.source_size
        return {
            "name": self.name, "digest": self.digest, "width": width, "height": height, "square": list(read.crop_box),
            "inverted": read.inverted, "scale": read.scale, "warnings": list(read.warnings),
            "notes": [note for note in read.notes if note not in read.warnings],
            "reading": self.reading.model_dump(mode="json"),
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
