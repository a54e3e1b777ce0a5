"""IFS and View: frozen values, their algebra and their plain data."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from torch import Tensor

from ..errors import InputError
from ..runtime.checks import check_number
from .colours import Colours
from .contraction import LEAST_SHRINKING, NEITHER, Contraction, largest
from .numbers import exact, floats, same

FORMAT = "fractal-exp/ifs"
VERSION = 1
CONTRACTED = 0.999  # largest singular value that `IFS.contracted` leaves; nearer to 1, an attractor is hard to draw
PROBABILITY_FLOOR = 0.01  # so that flat maps are drawn too: p_i is proportional to |det M_i| + floor


@dataclass(frozen=True)
class View:
    """A square window on the canvas: `center` (x, y), half-side 1/`zoom`; the default is the whole canvas [-1,1]². A
    picture that is not square shows all of it, and more along its longer side.

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

    `len(code)` is N, and `for linear, offset in code` goes through the maps, (2,2) and (2,) each. Codes are equal if
    all of their values are, wherever their tensors lie, and equal codes have one hash. Messages count maps from 1.

    - linear (N,2,2) and offset (N,2): finite, kept as float32 tensors.
    - probabilities (N,): of the chaos game, at least 0, with sum 1. None makes p_i proportional to |det M_i| + 0.01.
    - meta: free notes that JSON can hold, such as a name and a source.
    - colours: a colour and a blend of each map, or None for a code without colours.

    Raises `InputError` on other shapes, N < 1, numbers that are not finite, wrong probabilities, or colours of another
    number of maps. A code need not be contractive here; `check_contractive` is called where it must be.
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

    def __iter__(self) -> Iterator[tuple[Tensor, Tensor]]:
        """The maps, each its matrix (2,2) and its offset (2,)."""
        return zip(self.linear, self.offset, strict=True)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, IFS):
            return NotImplemented
        return (same(self.linear, other.linear) and same(self.offset, other.offset)
                and same(self.probabilities, other.probabilities) and self.colours == other.colours
                and dict(self.meta) == dict(other.meta))

    def __hash__(self) -> int:
        return hash((tuple(self.linear.flatten().tolist()), tuple(self.offset.flatten().tolist())))

    def __repr__(self) -> str:
        name = f"{self.meta['name']!r}, " if isinstance(self.meta.get("name"), str) else ""
        return f"IFS({name}{len(self)} map{'s' * (len(self) > 1)})"

    if TYPE_CHECKING:  # files, dimensions and pages stand on codes; fractal_exp/__init__.py gives a code these methods
        def save(self, path: str | Path, format: str | None = None) -> Path: ...
        def save_html(self, path: str | Path, *, view: View | None = None,
                      resolution: int | tuple[int, int] | None = None) -> Path: ...
        def widget(self, *, view: View | None = None, height: int = 480) -> Any: ...
        def dimension(self, kind: str | None = None, *, seed: int = 0) -> Any: ...
        @staticmethod
        def load(path: str | Path, name: str | None = None, order: str | None = None) -> IFS: ...
        @staticmethod
        def from_json(data: Any) -> IFS: ...

    def to(self, device: torch.device | str) -> IFS:
        """The same code on another device."""
        if self.linear.device == torch.device(device):
            return self
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

    @cached_property
    def contraction(self) -> Contraction:
        """Whether the maps that are ever chosen contract in a norm, on average only or neither, with the numbers."""
        return Contraction.of(*(values.cpu().double().numpy()
                                for values in (self.linear, self.offset, self.sampling_probabilities())))

    def check_contractive(self) -> IFS:
        """Return self if the code contracts in a norm or on average (see `contraction`), so that it can be drawn.

        Raises `InputError` otherwise, naming the Lyapunov exponent and the map that stretches most.
        """
        if self.contraction.kind == NEITHER:
            sizes = np.where(self.sampling_probabilities().cpu() > 0, largest(self.linear.cpu().double().numpy()), 0)
            i = int(sizes.argmax())
            raise InputError(
                f"the maps must be contractive, at least on average: their Lyapunov exponent must be below "
                f"{-LEAST_SHRINKING:g} and is {self.contraction.exponent:.3g}, since map {i + 1} has singular value "
                f"{sizes[i]:.6g}; shrink its matrix or drop the map"
            )
        return self

    def contracted(self, most: float = CONTRACTED) -> IFS:
        """The code with the nearest matrices (in the Frobenius norm) whose singular values are at most `most`.

        `most` is above 0 and at most 0.999. Larger singular values are lowered to it. Offsets, and matrices that
        contract enough, stay bit for bit. Raises `InputError` if `most` is out of range.
        """
        check_number("most", most, f"a number above 0 and at most {CONTRACTED}", 1e-6, CONTRACTED)
        u, singular, vt = torch.linalg.svd(self.linear.double())
        nearest = (u * singular.clamp(max=most)[:, None, :]) @ vt
        return replace(self, linear=torch.where((singular[:, :1, None] > most), nearest.float(), self.linear))

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


def sampling_probabilities(linear: Tensor) -> Tensor:
    """|det M_i| + 0.01, normalised over the maps: (…,N,2,2) -> (…,N)."""
    a, b, c, d = linear.double().flatten(-2).unbind(-1)
    p = (a * d - b * c).abs() + PROBABILITY_FLOOR
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
