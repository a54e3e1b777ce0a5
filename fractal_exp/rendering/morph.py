"""Morphs: the codes between two codes, and the codes and views of a film that passes through several."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from scipy.ndimage import convolve1d, maximum_filter1d
from scipy.optimize import linear_sum_assignment

from ..errors import InputError
from ..ifs import attractor
from ..ifs.code import IFS, View
from ..ifs.colours import Colours
from ..runtime.checks import check_count, check_number, shown
from .tone import NOTE, Tone, own_tone

FLAT = 1e-3          # a map whose smaller singular value is below this share of the larger is flat
BIRTH_POINTS = 4000  # points of an attractor among which a surplus map finds its place
CALM = 0.15          # of a passage, at most: the time over which the camera averages
MANY_MAPS = 10_000   # of the two codes together, whose pairs are all compared


def morph(a: IFS, b: IFS, t: float) -> IFS:
    """The code at time t in [0,1] on the way from code a to code b; the codes themselves at 0 and 1.

    Maps are paired so that the sum of mean squared distances |f_i(x) - g_j(x)|² over the frame [-0.75, 0.75]² is least
    (Kuhn 1955), so bring both codes to the canvas first (`fractal_exp.ifs.attractor.normalize`). The image of the
    middle moves along a straight line. A matrix M = R S, R a rotation and S symmetric (polar decomposition, Shoemake
    and Duff 1992), turns by the shorter way, and log S moves along a straight line. Two exceptions:

    - A reflection cannot be reached by rotation. Where one determinant is positive and the other is negative, the
      matrix itself moves along a straight line, and passes through a flat map, like a leaf that turns over.
    - A flat map has no logarithm, so S itself moves along a straight line.

    Singular values below 1 in both codes stay below 1: norms are convex along a straight line, and so is the logarithm
    of the larger singular value along one of log S. Between codes that stretch in some direction, one may not contract,
    and is refused. If one code has more maps, each of those left over grows from a point of the other's
    attractor, or shrinks to it, and its probability from or to zero. Probabilities move along straight lines,
    and so do colours and tones, if both codes have them; otherwise the codes between have none.

    Raises `InputError` on t outside [0,1], on what is no code, on codes of more than 10 000 pairs of maps, and on codes
    that are not contractive, at the ends or between.
    """
    check_number("t", t, "a number from 0 to 1", 0, 1)
    return _Passage.between(a, b).at(float(t))


def morph_path(codes: Sequence[IFS], frames: int, *, loop: bool = False) -> tuple[list[IFS], list[View]]:
    """The codes and views of a morph of so many frames through two codes or more: what `film.frames` takes.

    loop: return to the first code; the frame after the last would be the first again. Each code is brought to the
    canvas. The morph slows down at each and takes the same time between any two. The camera holds the visible box of
    every frame, and follows it smoothly. Raises `InputError` on fewer than two codes, fewer frames than two for each
    passage, and as `morph`.
    """
    codes = list(codes)
    if len(codes) < 2:
        raise InputError(f"a morph needs at least 2 codes, got {len(codes)}")
    passages = len(codes) if loop else len(codes) - 1
    check_count("frames", frames)
    if frames < 2 * passages:
        raise InputError(f"a morph through {len(codes)} codes has at least {2 * passages} frames, got {frames}")
    stops = [attractor.normalize(_checked(code)) for code in codes]
    ways = [_Passage.between(stops[k], stops[(k + 1) % len(stops)]) for k in range(passages)]
    times = np.linspace(0, passages, frames, endpoint=not loop)
    on_the_way = [ways[k].at(_slowly(time - k)) for time in times for k in [min(int(time), passages - 1)]]
    window = max(1, int(CALM * frames / passages) // 2)
    return on_the_way, _camera([attractor.visible_box(code) for code in on_the_way], window, loop)


@dataclass(frozen=True)
class _Passage:
    """Two codes and their maps in pairs, float64: matrices (N,2,2), offsets (N,2), probabilities (N,), colours (N,4). A
    colour is red, green, blue and the blend; there are none, and no tones, unless both codes have them."""

    ends: tuple[IFS, IFS]
    linear: tuple[np.ndarray, np.ndarray]
    offset: tuple[np.ndarray, np.ndarray]
    chance: tuple[np.ndarray, np.ndarray]
    colour: tuple[np.ndarray, np.ndarray] | None
    tones: tuple[Tone, Tone] | None

    @classmethod
    def between(cls, a: IFS, b: IFS) -> _Passage:
        """Pair the maps of two codes, and give a partner to each that is left over."""
        for code in (a, b):
            _checked(code).check_contractive()
        if len(a) * len(b) > MANY_MAPS:
            raise InputError(f"a morph compares at most {MANY_MAPS} pairs of maps, got {len(a)} and {len(b)} maps; "
                             "remove those of the least probability")
        (m, e, p), (n, f, q) = _numbers(a), _numbers(b)
        # The mean of |D x|² over the square of half side h is h²/3 |D|².
        third = (attractor.FRAME_SIDE / 2)**2 / 3
        cost = (((e[:, None] - f)**2).sum(-1) + third * ((m[:, None] - n)**2).sum((-2, -1)))
        first, second = linear_sum_assignment(cost)
        dying = np.setdiff1d(np.arange(len(a)), first)
        born = np.setdiff1d(np.arange(len(b)), second)
        none, still = np.zeros(len(dying) + len(born)), np.zeros((len(dying) + len(born), 2, 2))
        return cls((a, b),
                   (np.concatenate([m[first], m[dying], still[:len(born)]]),
                    np.concatenate([n[second], still[:len(dying)], n[born]])),
                   (np.concatenate([e[first], e[dying], _nearest(a, f[born])]),
                    np.concatenate([f[second], _nearest(b, e[dying]), f[born]])),
                   (np.concatenate([p[first], p[dying], none[:len(born)]]),
                    np.concatenate([q[second], none[:len(dying)], q[born]])),
                   cls._colours(a, b, first, second, dying, born),
                   (one, other) if (one := own_tone(a)) and (other := own_tone(b)) else None)

    @staticmethod
    def _colours(a: IFS, b: IFS, first: np.ndarray, second: np.ndarray, dying: np.ndarray, born: np.ndarray
                 ) -> tuple[np.ndarray, np.ndarray] | None:
        """The colours of the pairs; a map that is left over keeps its own."""
        if a.colours is None or b.colours is None:
            return None
        one, other = (torch.cat([each.rgb, each.blends[:, None]], 1).cpu().double().numpy()
                      for each in (a.colours, b.colours))
        return (np.concatenate([one[first], one[dying], other[born]]),
                np.concatenate([other[second], one[dying], other[born]]))

    def at(self, t: float) -> IFS:
        """The code at time t."""
        if t in (0, 1):
            return self.ends[int(t)]
        linear = np.stack([_between(m, n, t) for m, n in zip(*self.linear, strict=True)])
        offset, chance = ((1 - t) * start + t * end for start, end in (self.offset, self.chance))
        colours = None
        if self.colour is not None:
            numbers = torch.from_numpy((1 - t) * self.colour[0] + t * self.colour[1])
            colours = Colours(numbers[:, :3], numbers[:, 3])
        meta = {} if self.tones is None else {NOTE: self.tones[0].towards(self.tones[1], t).facts()}
        return IFS(torch.from_numpy(linear), torch.from_numpy(offset), torch.from_numpy(chance / chance.sum()), meta,
                   colours).check_contractive()


def _numbers(code: IFS) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    p = code.sampling_probabilities().cpu().double().numpy()
    return code.linear.cpu().double().numpy(), code.offset.cpu().double().numpy(), p / p.sum()


def _checked(code: IFS) -> IFS:
    if not isinstance(code, IFS):
        raise InputError(f"a morph is made of codes (IFS), got {shown(code)}")
    return code


def _nearest(code: IFS, places: np.ndarray) -> np.ndarray:
    """The points of the attractor nearest to places (K,2), among some thousand: (K,2).

    The map that sends all to such a point adds nothing to the attractor, so nothing pops up."""
    if not len(places):
        return places
    points = attractor.random_points(code, BIRTH_POINTS)[0]
    return points[((places[:, None] - points)**2).sum(-1).argmin(1)]


def _between(m: np.ndarray, n: np.ndarray, t: float) -> np.ndarray:
    """The matrix (2,2) at time t between m and n, see `morph`."""
    full = not (_flat(m) or _flat(n))
    larger = max(m, n, key=lambda each: abs(np.linalg.det(each)))
    if full and np.linalg.det(m) * np.linalg.det(n) < 0:
        return (1 - t) * m + t * n
    # Two reflections are two rotations, seen in a mirror.
    mirror = np.diag([1.0, -1.0 if np.linalg.det(larger) < 0 else 1.0])
    (angle, start), (other, end) = _polar(m @ mirror), _polar(n @ mirror)
    if not n.any():  # a map that shrinks to a point does not turn for it
        other = angle
    elif not m.any():
        angle = other
    turn = angle + t * math.remainder(other - angle, 2 * math.pi)
    stretch = _power(_log(start), _log(end), t) if full else (1 - t) * start + t * end
    return _rotation(turn) @ stretch @ mirror


def _flat(matrix: np.ndarray) -> bool:
    large, small = np.linalg.svd(matrix, compute_uv=False)
    return bool(small <= FLAT * large)


def _polar(matrix: np.ndarray) -> tuple[float, np.ndarray]:
    """The angle of the rotation R nearest to a matrix, and the symmetric S with matrix = R S. S is positive where the
    determinant is; for a flat matrix, its smaller eigenvalue is about 0."""
    (a, b), (c, d) = matrix
    angle = math.atan2(c - b, a + d)
    stretch = _rotation(-angle) @ matrix
    return angle, (stretch + stretch.T) / 2


def _rotation(angle: float) -> np.ndarray:
    return np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])


def _log(stretch: np.ndarray) -> np.ndarray:
    values, axes = np.linalg.eigh(stretch)
    return (axes * np.log(values)) @ axes.T


def _power(start: np.ndarray, end: np.ndarray, t: float) -> np.ndarray:
    values, axes = np.linalg.eigh((1 - t) * start + t * end)
    return (axes * np.exp(values)) @ axes.T


def _slowly(t: float) -> float:
    """The share of a passage behind us at its time t: it leaves a code and reaches one at no speed."""
    return t**3 * (t * (6 * t - 15) + 10)


def _camera(boxes: list[np.ndarray], window: int, loop: bool) -> list[View]:
    """Views that hold boxes (x_min, y_min, x_max, y_max), with the padding of the canvas, and move smoothly.

    The middle is an average over 2 · window + 1 frames. The largest half side that these ask for in as many frames is
    averaged likewise, so that no average is below what its own frame needs.
    """
    low, high = (np.array([box[k:k + 2] for box in boxes]) for k in (0, 2))
    middle = _average((low + high) / 2, window, loop)
    needed = np.maximum(high - middle, middle - low).max(1)
    largest = maximum_filter1d(needed, 2 * window + 1, mode="wrap" if loop else "nearest")
    half = _average(largest, window, loop) / (attractor.FRAME_SIDE / 2)
    return [View((float(x), float(y)), 1 / max(float(h), 1e-6)) for (x, y), h in zip(middle, half, strict=True)]


def _average(values: np.ndarray, window: int, loop: bool) -> np.ndarray:
    """A mean of each column over 2 · window + 1 rows that falls off smoothly to both sides; beyond the ends stand the
    last rows, or those of the other end."""
    weights = 1 + np.cos(np.pi * np.arange(-window, window + 1) / (window + 1))
    return convolve1d(values, weights / weights.sum(), axis=0, mode="wrap" if loop else "nearest")
