"""IFS and View: frozen values, their algebra and their plain data."""

from __future__ import annotations

import math
import reprlib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import torch
from torch import Tensor

from ..errors import InputError
from ..runtime.files import write_atomically
from .colours import Colours
from .numbers import exact, floats, only_keys, only_numbers

if TYPE_CHECKING:
    from ..viewer.widget import CodeWidget

FORMAT = "fractal-exp/ifs"
VERSION = 1
PROBABILITY_FLOOR = 0.01  # so that flat maps are drawn too: p_i is proportional to |det M_i| + floor


@dataclass(frozen=True)
class View:
    """A square window on the canvas: `center` (x, y), half-side 1/`zoom`; the default is the whole canvas [-1,1]².

    Raises `InputError` unless the centre is two finite numbers and the zoom is finite and positive.
    """

    center: tuple[float, float] = (0.0, 0.0)
    zoom: float = 1.0

    def __post_init__(self) -> None:
        try:
            x, y = (float(c) for c in self.center)
            zoom = float(self.zoom)
        except (TypeError, ValueError) as error:
            raise InputError(f"a view needs center=(x, y) and a zoom, got {self.center!r} and {self.zoom!r}") from error
        if not (math.isfinite(x) and math.isfinite(y)):
            raise InputError(f"a view's center must be finite, got ({x}, {y})")
        if not (math.isfinite(zoom) and zoom > 0):
            raise InputError(f"a view's zoom must be a finite number above 0 (1 is the whole canvas), got {zoom}")
        object.__setattr__(self, "center", (x, y))
        object.__setattr__(self, "zoom", zoom)

    @property
    def box(self) -> tuple[float, float, float, float]:
        """The window's (x_min, y_min, x_max, y_max)."""
        (x, y), half = self.center, 1.0 / self.zoom
        return x - half, y - half, x + half, y + half


@dataclass(frozen=True, eq=False)
class IFS:
    """An iterated function system of N affine maps f_i(x) = `linear`[i] x + `offset`[i].

    - linear (N,2,2) and offset (N,2): finite, kept as float32 tensors.
    - probabilities (N,): of the chaos game, at least 0, with sum 1. None makes p_i proportional to |det M_i| + 0.01.
    - meta: free notes that JSON can hold, such as a name and a source.
    - colours: a colour and a blend of each map, or None for a code without colours.

    Raises `InputError` on other shapes, N < 1, numbers that are not finite, wrong probabilities, or colours of another
    number of maps. Maps need not be contractive here; `check_contractive` is called where they must be.
    """

    linear: Tensor
    offset: Tensor
    probabilities: Tensor | None = None
    meta: Mapping[str, Any] = field(default_factory=dict)
    colours: Colours | None = None

    def __post_init__(self) -> None:
        linear, offset = floats("linear", self.linear), floats("offset", self.offset)
        if linear.ndim != 3 or linear.shape[1:] != (2, 2) or linear.shape[0] < 1:
            raise InputError(f"linear must have shape (N, 2, 2) with N >= 1, got {tuple(linear.shape)}")
        if offset.shape != (linear.shape[0], 2):
            raise InputError(f"offset must have shape ({linear.shape[0]}, 2) as there are {linear.shape[0]} matrices, "
                             f"got {tuple(offset.shape)}")
        object.__setattr__(self, "linear", linear)
        object.__setattr__(self, "offset", offset)
        if self.probabilities is not None:
            object.__setattr__(self, "probabilities", _probabilities(self.probabilities, linear.shape[0]))
        if not isinstance(self.meta, Mapping):
            raise InputError(f"meta holds free notes by name (a mapping), got {type(self.meta).__name__}")
        if self.colours is not None:
            _check_colours(self.colours, linear.shape[0])

    def __len__(self) -> int:
        """The number of maps N."""
        return self.linear.shape[0]

    def __repr__(self) -> str:
        name = f"{self.meta['name']!r}, " if isinstance(self.meta.get("name"), str) else ""
        return f"IFS({name}{len(self)} map{'s' * (len(self) > 1)})"

    def _repr_png_(self) -> bytes | None:
        """What a notebook shows: the attractor on its canvas, as PNG. None if the code is not contractive."""
        from ..rendering.sheets import portrait

        return portrait(self)

    def _repr_html_(self) -> str | None:
        """What a notebook that may run scripts shows: a page for flying into the attractor, in its own frame. None if
        no page can be made of the code."""
        from ..viewer import frame

        try:
            return frame(self._page())
        except InputError:
            return None

    def widget(self, *, view: View | None = None, height: int = 480) -> CodeWidget:
        """The page as a widget of a notebook: maps that are dragged in it change its `code`, and its `code` can be set.

        It opens on `view`, or on the whole attractor; height is in pixels. Raises `InputError` where `save_html` does,
        on meta that is no JSON, and without the extra `notebook`.
        """
        from ..viewer.widget import CodeWidget

        return CodeWidget(self, view=view, height=height)

    def _page(self, view: View | None = None, live: bool = False) -> str:
        from ..rendering.sheets import portrait
        from ..viewer import check, page

        check(self)  # before the picture is drawn
        return page(self, view=view, still=portrait(self), live=live)

    def to(self, device: torch.device | str) -> IFS:
        """The same code on another device."""
        p = None if self.probabilities is None else self.probabilities.to(device)
        colours = None if self.colours is None else self.colours.to(device)
        return replace(self, linear=self.linear.to(device), offset=self.offset.to(device), probabilities=p,
                       colours=colours)

    def singular_values(self) -> Tensor:
        """Singular values of every map, (N,2), the larger first."""
        return torch.linalg.svdvals(self.linear)

    def sampling_probabilities(self) -> Tensor:
        """Probabilities (N,) of the chaos game: the code's own, or |det M_i| + 0.01 normalised (Anderson and
        Farrell 2022)."""
        if self.probabilities is not None:
            return self.probabilities
        return sampling_probabilities(self.linear)

    def check_contractive(self) -> IFS:
        """Return self, or raise `InputError` naming the first map whose larger singular value is not below 1."""
        largest = self.singular_values()[:, 0]
        if bool((largest >= 1).any()):
            i = int((largest >= 1).nonzero()[0])
            raise InputError(
                f"every map must be contractive (singular values below 1), but map {i} has singular value "
                f"{float(largest[i]):.6g}; shrink its matrix or drop the map"
            )
        return self

    def similar(self, scale: float, shift: tuple[float, float]) -> IFS:
        """The code whose attractor is scale · A + shift: matrices stay, offsets change by conjugation.

        It is computed in float64, because float32 would blur deep zooms.
        """
        t = torch.tensor(shift, dtype=torch.float64, device=self.offset.device)
        offset = scale * self.offset.double() + t - self.linear.double() @ t
        return replace(self, offset=offset.float())

    def to_json(self) -> dict[str, Any]:
        """The code as the plain data of this package's JSON format. Colours are under a key of their own, which a code
        without colours does not have."""
        p = self.probabilities
        colours = {} if self.colours is None else {"colours": self.colours.to_json()}
        return {
            "format": FORMAT, "version": VERSION,
            "linear": exact(self.linear), "offset": exact(self.offset),
            "probabilities": None if p is None else exact(p), **colours, "meta": dict(self.meta),
        }

    def save(self, path: str | Path, format: str | None = None) -> Path:
        """Write the code to a file, whole or not at all, and return the absolute path.

        The suffix chooses the format: `.json` (the complete code, bit for bit; also without a suffix), `.ifs`
        (Fractint), `.flame` (flam3), `.svg` (a drawing of the maps), `.ply` (points). format: its key instead: "json",
        "lists", "rows", "fractint", "flame", "svg" or "ply". `fractal_exp.ifs.formats` says what each format loses.
        Raises `InputError` on another suffix or format, if the file cannot be written, or if the format cannot hold the
        code.
        """
        from .formats import save

        return save([self], path, format)

    def save_html(self, path: str | Path, *, view: View | None = None) -> Path:
        """Write a single, self-contained HTML file in which a browser flies into the attractor; return the absolute
        path. It opens on `view`, or on the whole attractor.

        The page uses the code's own coordinates, so its views are views of `fractal_exp.render`. Raises `InputError`,
        before anything is written, on a name that does not end in .html, or a code that is not contractive or has more
        than 1000 maps; and if the file cannot be written.
        """
        path = Path(path).absolute()
        if path.suffix.lower() not in (".html", ".htm"):
            raise InputError(f"a page is written as HTML, got {path.name!r}; end the name in .html")
        write_atomically(path, self._page(view))
        return path

    @classmethod
    def from_json(cls, data: Any) -> IFS:
        """A contractive code from plain data in this package's format or one of the two public spellings.

        The public spellings are a mapping with `ifs_m` (N,2,2) or (N,4), `ifs_t` (N,2) and optionally `ifs_p` (N,),
        and a list of rows `a b c d e f [p]` meaning x' = a x + b y + e, y' = c x + d y + f. Raises `InputError` on
        anything else.
        """
        if isinstance(data, list):
            code = _from_rows(data)
        elif isinstance(data, Mapping) and "ifs_m" in data:
            code = _from_lists(data)
        elif isinstance(data, Mapping):
            code = _from_own(data)
        else:
            raise InputError(f"a code is a JSON object or a list of rows of six numbers, got {type(data).__name__}")
        return code.check_contractive()

    @classmethod
    def load(cls, path: str | Path, name: str | None = None) -> IFS:
        """Read a code from a JSON (see `from_json`), Fractint (`.ifs`) or flam3 (`.flame`) file.

        name: which code of a file with several, or "#2" for the second. Raises `InputError` naming the file.
        """
        from .formats import load

        return load(path, name)


def sampling_probabilities(linear: Tensor) -> Tensor:
    """|det M_i| + 0.01, normalised over the maps: (…,N,2,2) -> (…,N)."""
    p = torch.linalg.det(linear.double()).abs() + PROBABILITY_FLOOR
    return (p / p.sum(-1, keepdim=True)).to(linear.dtype)


def _probabilities(value: Any, count: int) -> Tensor:
    p = floats("probabilities", value)
    if p.shape != (count,):
        raise InputError(f"probabilities must have shape ({count},), one per map, got {tuple(p.shape)}")
    if bool((p < 0).any()):
        raise InputError(f"probabilities must not be negative, got {float(p.min()):.6g}")
    if abs(float(p.double().sum()) - 1) > 1e-3:
        raise InputError(f"probabilities must sum to 1, got {float(p.sum()):.6g}; divide them by their sum")
    return p


def _check_colours(colours: Any, count: int) -> None:
    if not isinstance(colours, Colours):
        raise InputError(f"colours must be Colours, got {type(colours).__name__}; Colours(rgb, blends) makes them")
    if len(colours) != count:
        raise InputError(f"the code has {count} maps and colours of {len(colours)}; give each map one, or leave "
                         "colours out (colours=None)")


def _from_own(data: Mapping[str, Any]) -> IFS:
    only_keys(data, {"format", "version", "linear", "offset", "probabilities", "colours", "meta"})
    version = data.get("version")
    if data.get("format") != FORMAT or type(version) is not int or version != VERSION:
        found = f"{reprlib.repr(data.get('format'))} version {reprlib.repr(version)}"
        raise InputError(f"expected format {FORMAT!r} version {VERSION}, got {found}; no other version is read")
    missing = [key for key in ("linear", "offset") if key not in data]
    if missing:
        raise InputError(f"the code has no {' and no '.join(missing)}")
    given, meta, colours = data.get("probabilities"), data.get("meta"), data.get("colours")
    return IFS(only_numbers("linear", data["linear"]), only_numbers("offset", data["offset"]),
               None if given is None else only_numbers("probabilities", given), {} if meta is None else meta,
               None if colours is None else Colours.from_json(colours))


def _from_lists(data: Mapping[str, Any]) -> IFS:
    only_keys(data, {"ifs_m", "ifs_t", "ifs_p"})
    if "ifs_t" not in data:
        raise InputError("ifs_m needs ifs_t beside it: one offset (x, y) per matrix")
    linear = floats("ifs_m", only_numbers("ifs_m", data["ifs_m"]))
    if linear.ndim == 2 and linear.shape[1] == 4:
        linear = linear.reshape(-1, 2, 2)
    given = data.get("ifs_p")
    return IFS(linear, only_numbers("ifs_t", data["ifs_t"]), None if given is None else only_numbers("ifs_p", given))


def _from_rows(rows: list[Any]) -> IFS:
    table = floats("rows", only_numbers("rows", rows))
    if table.ndim != 2 or table.shape[1] not in (6, 7):
        raise InputError(f"a list of rows needs six numbers each, a b c d e f, or seven with the probability; "
                         f"got shape {tuple(table.shape)}")
    p = table[:, 6] if table.shape[1] == 7 else None
    return IFS(table[:, :4].reshape(-1, 2, 2), table[:, 4:6], p)
