"""The classic codes by name, each in the coordinates of its publication, with its source."""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass

import torch

from .errors import InputError, did_you_mean
from .ifs.code import IFS

Row = tuple[float, float, float, float, float, float]  # a b c d e f: x' = a x + b y + e, y' = c x + d y + f


@dataclass(frozen=True)
class _Classic:
    title: str
    source: str
    rows: tuple[Row, ...]
    probabilities: tuple[float, ...] | None = None


def names() -> list[str]:
    """The names that `known` accepts, sorted."""
    return sorted(_CLASSICS)


def known(name: str) -> IFS:
    """The classic code of this name, with name, title and source in its `meta`.

    It is in the coordinates of its source (the unit segment, the unit square …); `attractor.normalize` brings it to the
    canvas. Raises `InputError` on an unknown name and lists the close ones and all.
    """
    if name not in _CLASSICS:
        near = did_you_mean(str(name), names())
        raise InputError(f"no classic code is called {name!r}{near or ';'} known names: {', '.join(names())}")
    classic = _CLASSICS[name]
    rows = classic.rows
    return IFS(
        linear=torch.tensor([[[a, b], [c, d]] for a, b, c, d, _, _ in rows]),
        offset=torch.tensor([[e, f] for *_, e, f in rows]),
        probabilities=None if classic.probabilities is None else torch.tensor(classic.probabilities),
        meta={"name": name, "title": classic.title, "source": classic.source},
    )


def _similarities(*maps: tuple[complex, complex]) -> tuple[Row, ...]:
    """Direct similarities of the complex plane, z' = a z + b, as rows."""
    return tuple((a.real, -a.imag, a.imag, a.real, b.real, b.imag)
                 for a, b in ((complex(a), complex(b)) for a, b in maps))


def _copies(ratio: float, *places: complex) -> tuple[Row, ...]:
    """Unrotated copies of one ratio, moved to the given places."""
    return _similarities(*((ratio, place) for place in places))


def _on_circle(count: int, radius: float = 1, start: float = 0) -> list[complex]:
    """`count` points evenly on a circle about the origin, the first at the angle `start`."""
    return [cmath.rect(radius, start + 2 * math.pi * k / count) for k in range(count)]


_UP = math.pi / 2
_DRAGON = (1 + 1j) / 2                 # shrink by sqrt 2 and turn by 45°: the step of all dragons on squares
_TERDRAGON = cmath.rect(1 / math.sqrt(3), math.pi / 6)  # shrink by sqrt 3 and turn by 30°
_GOSPER = 1 / (2 + cmath.rect(1, math.pi / 3))          # shrink by sqrt 7, base of the hexagonal lattice
_PENTAGON = (3 - math.sqrt(5)) / 2     # 1 / golden ratio squared
# The contracting root of x³ = x² + x + 1; its modulus squared is the inverse of the tribonacci constant.
_TRIBONACCI = complex(-0.41964337760708056, 0.6062907292071993)

_CLASSICS: dict[str, _Classic] = {
    "fern": _Classic(
        "Barnsley's fern (black spleenwort)", "M. Barnsley, Fractals Everywhere (1988), table III.3",
        ((0, 0, 0, .16, 0, 0), (.85, .04, -.04, .85, 0, 1.6), (.2, -.26, .23, .22, 0, 1.6),
         (-.15, .28, .26, .24, 0, .44)),
        (.01, .85, .07, .07)),
    "cyclosorus": _Classic(
        "Cyclosorus fern (Thelypteridaceae)", "table of mutant varieties in the Wikipedia article 'Barnsley fern'",
        ((0, 0, 0, .25, 0, -.4), (.95, .005, -.005, .93, -.002, .5), (.035, -.2, .16, .04, -.09, .02),
         (-.04, .2, .16, .04, .083, .12)),
        (.02, .84, .07, .07)),
    "culcita": _Classic(
        "Culcita dubia fern", "parameters for FRACTINT on the web page 'Fractal Ferns' (1990s, author not stated)",
        ((0, 0, 0, .25, 0, -.14), (.85, .02, -.02, .83, 0, 1), (.09, -.28, .3, .11, 0, .6),
         (-.09, .28, .3, .09, 0, .7)),
        (.02, .84, .07, .07)),
    "tree": _Classic(
        "Barnsley's fractal tree", "M. Barnsley, Fractals Everywhere (1988), table III.4",
        ((0, 0, 0, .5, 0, 0), (.42, -.42, .42, .42, 0, .2), (.42, .42, -.42, .42, 0, .2), (.1, 0, 0, .1, 0, .2)),
        (.05, .4, .4, .15)),
    "maple_leaf": _Classic(
        "Maple leaf", "widely reproduced; first publication unknown",
        ((.14, .01, 0, .51, -.08, -1.31), (.43, .52, -.45, .5, 1.49, -.75), (.45, -.49, .47, .47, -1.62, -.74),
         (.49, 0, 0, .51, .02, 1.62)),
        (.1, .35, .35, .2)),
    "spiral": _Classic(
        "Spiral", "FRACTINT (Stone Soup Group), fractint.ifs, entry 'spiral'",
        ((.787879, -.424242, .242424, .859848, 1.758647, 1.408065),
         (-.121212, .257576, .151515, .053030, -6.721654, 1.377236),
         (.181818, -.136364, .090909, .181818, 6.086107, 1.568035)),
        (.895652, .052174, .052174)),
    "sierpinski_triangle": _Classic(
        "Sierpinski triangle", "W. Sierpinski, C. R. Acad. Sci. Paris 160 (1915), 302-305",
        _copies(1 / 2, 0, 1 / 2, cmath.rect(1 / 2, math.pi / 3))),
    "sierpinski_carpet": _Classic(
        "Sierpinski carpet", "W. Sierpinski, C. R. Acad. Sci. Paris 162 (1916), 629-632",
        _copies(1 / 3, *(complex(x, y) / 3 for y in range(3) for x in range(3) if (x, y) != (1, 1)))),
    "vicsek": _Classic(
        "Vicsek fractal (box fractal)", "T. Vicsek, J. Phys. A 16 (1983), L647-L652",
        _copies(1 / 3, *(complex(x, y) / 3 for x, y in ((1, 0), (0, 1), (1, 1), (2, 1), (1, 2))))),
    "cantor_dust": _Classic(
        "Cantor dust: the middle-third set times itself", "B. Mandelbrot, The Fractal Geometry of Nature (1982)",
        _copies(1 / 3, *(complex(x, y) / 3 for y in (0, 2) for x in (0, 2)))),
    "hexaflake": _Classic(
        "Hexaflake", "L. Riddle, Classic Iterated Function Systems: Sierpinski n-gons",
        _copies(1 / 3, 0, *_on_circle(6, 2 / 3))),
    "pentaflake": _Classic(
        "Pentaflake, its middle upside down", "L. Riddle, Classic Iterated Function Systems: Sierpinski n-gons",
        _similarities((-_PENTAGON, 0), *((_PENTAGON, place) for place in _on_circle(5, 1 - _PENTAGON, _UP)))),
    "koch_curve": _Classic(
        "Koch curve", "H. von Koch, Arkiv för Matematik 1 (1904), 681-704",
        _similarities((1 / 3, 0), (cmath.rect(1 / 3, math.pi / 3), 1 / 3),
                      (cmath.rect(1 / 3, -math.pi / 3), 1 / 2 + 1j * math.sqrt(3) / 6), (1 / 3, 2 / 3))),
    "koch_snowflake": _Classic(
        "Koch snowflake, solid, by seven maps", "L. Riddle, Classic Iterated Function Systems: Koch Snowflake",
        _similarities((cmath.rect(1 / math.sqrt(3), math.pi / 6), 0),
                      *((1 / 3, place) for place in _on_circle(6, 2 / 3, _UP)))),
    "heighway_dragon": _Classic(
        "Heighway dragon", "C. Davis and D. Knuth, J. Recreational Math. 3 (1970), 66-81 and 133-149",
        _similarities((_DRAGON, 0), (1j * _DRAGON, 1))),
    "twindragon": _Classic(
        "Twindragon", "C. Davis and D. Knuth, J. Recreational Math. 3 (1970), 66-81 and 133-149",
        _similarities((_DRAGON, 0), (-_DRAGON, 1))),
    "terdragon": _Classic(
        "Terdragon", "C. Davis and D. Knuth, J. Recreational Math. 3 (1970), 66-81 and 133-149",
        _similarities((_TERDRAGON, 0), (-1j / math.sqrt(3), _TERDRAGON), (_TERDRAGON, 1 - _TERDRAGON))),
    "levy_c_curve": _Classic(
        "Lévy C curve", "P. Lévy, Journal de l'École Polytechnique (1938), 227-247 and 249-291",
        _similarities((_DRAGON, 0), (_DRAGON.conjugate(), _DRAGON))),
    "gosper_island": _Classic(
        "Gosper island (flowsnake)", "B. Mandelbrot, The Fractal Geometry of Nature (1982), after W. Gosper",
        _similarities((_GOSPER, 0), *((_GOSPER, _GOSPER * unit) for unit in _on_circle(6)))),
    "rauzy": _Classic(
        "Rauzy fractal: tribonacci words cut into blocks 0, 10 and 110",
        "G. Rauzy, Bull. Soc. Math. France 110 (1982), 147-178",
        _similarities((_TRIBONACCI, 0), (_TRIBONACCI**2, 1), (_TRIBONACCI**3, 1 + _TRIBONACCI))),
}
