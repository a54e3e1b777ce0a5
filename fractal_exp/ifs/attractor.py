"""Where an attractor lies: a disc and half planes that certainly contain it, its visible box, and its frame.

Nothing is known to contain the attractor of a code that contracts on average only: it may be unbounded. The disc and
the half planes are then those of a box that reaches half as far again from its middle as 100 000 points do. Less than
about 3e-5 of the measure lies beyond it, and next to nothing unless its tails are long. A larger box is no better: each
word counts as meeting a view if its image of the box does, so deep views would get fewer points for the same work.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from ..errors import InputError
from .address_tree import chosen, farthest_word, lowered, raised, visited
from .code import IFS
from .contraction import AVERAGE

FRAME_SIDE = 1.5          # the longer side of a normalised attractor: 25% padding of the canvas [-1,1]²
BOX_TOLERANCE = 1e-7      # of the box's longer side
DIRECTIONS = 1024         # of the support function's table
TOLERANCE = 1e-7          # of its bounds, relative to the radius of the disc
MAX_SWEEPS = 5_000        # of the support function's fixed-point iteration
MAX_LETTERS = 20_000      # maximum length of words whose reach is also bounded by their length
VISIBLE_CHANCE = 1e-6     # minimum probability of a visible word
LETTERS = 2000            # of a random address
TRAJECTORIES = 1000       # chaos games that run in parallel
WARM_UP = 200             # steps after which their common start no longer matters
SAMPLE = 100_000          # points that show where a measure without a certain bound lies
BEYOND = 1.5              # times as far as they reach it is taken to lie
TAIL = 1e-3               # share of them beyond each side of its visible box


def bounding_disc(code: IFS) -> tuple[np.ndarray, float]:
    """A disc (center (2,), radius) that certainly contains the attractor.

    Let words w, with which every infinite word begins, contract by s_w in the norm |L x| of `IFS.contraction`: the maps
    themselves, where they do. With |L (f_w(c) - c)| = d_w, they send the ellipse |L (x - c)| <= r into itself for any
    r >= max d_w / (1 - s_w) (Hutchinson 1981), so the attractor lies in it. Raises `InputError` if the code is not
    contractive.
    """
    how = code.check_contractive().contraction
    if how.kind == AVERAGE:
        low, high = _likely_box(code)
        return (low + high) / 2, float(np.linalg.norm(high - low)) / 2
    (linear, offset), inverse = how.words, np.linalg.inv(how.axes)
    fixed = np.linalg.solve(np.eye(2) - linear, offset[..., None])[..., 0]
    scale = np.linalg.norm(how.axes @ linear @ inverse, ord=2, axis=(1, 2))
    center = np.average(fixed, axis=0, weights=1 / (1 - scale))
    moved = np.linalg.norm((np.einsum("nij,j->ni", linear, center) + offset - center) @ how.axes.T, axis=1)
    return center, float((moved / (1 - scale)).max() * np.linalg.norm(inverse, ord=2))


@lru_cache(maxsize=32)
def _sampled(code: IFS) -> np.ndarray:
    return random_points(code, SAMPLE)[0]


@lru_cache(maxsize=32)
def _likely_box(code: IFS) -> tuple[np.ndarray, np.ndarray]:
    """The lower left and upper right corner (2,) of a box beyond which a code hardly has a point."""
    x, y = _sampled(code).T  # one column at a time: numpy is slow along the short side of both
    low, high = np.array([x.min(), y.min()]), np.array([x.max(), y.max()])
    return (low + high - BEYOND * (high - low)) / 2, (low + high + BEYOND * (high - low)) / 2


def support_function(code: IFS, directions: int = DIRECTIONS, tolerance: float = TOLERANCE) -> np.ndarray:
    """Certain upper bounds (K,) of max over the attractor of u_k·x, at K directions of angle 2 pi k / K.

    The half planes u_k·x <= h_k contain the attractor. A support function obeys h(u) = max_i h(M_i^T u) + b_i·u and is
    sublinear, so interpolation between two directions never underestimates it. The iteration starts from the disc's
    values; every bound stays certain while it shrinks. It ends where further sweeps would lower no bound by more than
    about `tolerance` radii of the disc. Raises `InputError` if the code is not contractive.
    """
    center, radius = bounding_disc(code)
    units = _unit_vectors(directions)
    if code.contraction.kind == AVERAGE:
        low, high = _likely_box(code)
        return units @ center + np.abs(units) @ (high - low) / 2
    linear, offset = (values[_chances(code) > 0] for values in _float64(code))
    slack = 1 - code.contraction.factor
    return lowered(units @ center + radius, *_one_letter(linear, offset, units), tolerance * slack * radius, MAX_SWEEPS)


def visible_box(code: IFS) -> np.ndarray:
    """The box (x_min, y_min, x_max, y_max), float64, around the words that a million points would visit.

    It contains f_w(c) for every word w of probability p_w >= 1e-6, where c is the mean of the invariant measure. The
    paper normalises by the box of many sampled points; this box is like it, but depends neither on a seed nor on the
    order of the maps. The box of the whole attractor may be far larger: a map with a singular value near 1 stretches
    the attractor into tails of probability 1e-8 that no image ever shows. For a quarter of the codes of the random
    suite the two boxes differ by more than 1% of the side.

    Where a code contracts on average only, rare words reach far beyond what is seen. There the box is one of quantiles:
    a thousandth of 100 000 points lies beyond each side. Raises `InputError` if the code is not contractive.
    """
    if code.check_contractive().contraction.kind == AVERAGE:
        return np.quantile(_sampled(code), (TAIL, 1 - TAIL), axis=0).ravel()
    (right, _), (top, _), (left, _), (bottom, _) = visible_tips(code)
    return np.array([-left, -bottom, right, top])


def visible_tips(code: IFS) -> list[tuple[float, np.ndarray]]:
    """The reach of the `visible_box` to the right, top, left and bottom, each with the word that reaches there, an
    array (L,) of maps, the outermost first. Raises `InputError` if the code does not contract in a norm."""
    if code.check_contractive().contraction.kind == AVERAGE:
        raise InputError("the code contracts on average only, so no word reaches farthest; take a code that contracts "
                         "in a norm (see IFS.contraction), or the visible_box, which leaves out a thousandth a side")
    linear, offset = _float64(code)
    chance = _chances(code)
    mean = np.linalg.solve(np.eye(2) - np.einsum("n,nij->ij", chance, linear), chance @ offset)
    table = _reach_of_visible_words(code, linear, offset, chance, mean)
    tolerance = BOX_TOLERANCE * max(table[0] + table[DIRECTIONS // 2], table[DIRECTIONS // 4] + table[-DIRECTIONS // 4])
    return [farthest_word(u, linear, offset, chance, mean, table, VISIBLE_CHANCE, tolerance)
            for u in _unit_vectors(4)]


def _reach_of_visible_words(code: IFS, linear: np.ndarray, offset: np.ndarray, chance: np.ndarray,
                            mean: np.ndarray) -> np.ndarray:
    """Certain upper bounds (K,) of u_k·f_w(mean) over all words w of probability 1e-6 or more.

    Such words lie in the attractor's half planes, and they are short. If a map hardly contracts, the half planes may be
    a million times too far away, so a search would end early; but the bound by length is tight.
    """
    table = support_function(code)
    likeliest = chance.max()
    letters = math.log(VISIBLE_CHANCE) / math.log(likeliest) if likeliest < 1 else math.inf
    if letters > MAX_LETTERS:
        return table
    units = _unit_vectors(DIRECTIONS)
    return np.minimum(table, raised(units @ mean, *_one_letter(linear, offset, units), math.floor(letters) + 1))


def normalize(code: IFS) -> IFS:
    """The similar code whose visible box is centred on the canvas with its longer side spanning [-0.75, 0.75].

    An attractor that is a single point is only centred. Raises `InputError` if the code is not contractive.
    """
    x0, y0, x1, y1 = (float(side) for side in visible_box(code))
    side = max(x1 - x0, y1 - y0)
    scale = FRAME_SIDE / side if side > 1e-5 else 1.0
    return code.similar(scale, (-scale * (x0 + x1) / 2, -scale * (y0 + y1) / 2))


def random_point(code: IFS, seed: int | Sequence[int] = 0) -> tuple[float, float]:
    """A point (x, y) of the attractor, drawn by the invariant measure, to double precision.

    The maps of a random address of 2000 letters are applied to a point of the attractor, or to the origin if the code
    contracts on average only, which so many letters forget. Raises `InputError` if the code is not contractive.
    """
    code.check_contractive()
    linear, offset = _float64(code)
    p, x, y = _chances(code), 0.0, 0.0
    if code.contraction.kind != AVERAGE:  # a fixed point lies on the attractor, and so do all its images
        x, y = np.linalg.solve(np.eye(2) - linear[p.argmax()], offset[p.argmax()]).tolist()
    letters = _chosen(p, (LETTERS, 1), seed)
    return tuple(visited(linear, offset, letters, np.array([x, y]), LETTERS - 1)[0, 0].tolist())


def random_letters(code: IFS, count: int, seed: int | Sequence[int] = 0) -> np.ndarray:
    """The maps (200 + T, 1000) of each step of a thousand chaos games. The last T steps give at least `count` points.

    `random_points` with the same seed plays these games.
    """
    steps = WARM_UP - (-count // TRAJECTORIES)
    return _chosen(_chances(code), (steps, TRAJECTORIES), seed)


def _chosen(chances: np.ndarray, shape: tuple[int, int], seed: int | Sequence[int]) -> np.ndarray:
    """Random maps (shape), as numpy's `choice` would take them."""
    cumulative = np.cumsum(chances / chances.sum())
    return chosen(cumulative / cumulative[-1], np.random.Generator(np.random.PCG64(seed)).random(shape))


def random_points(code: IFS, count: int, seed: int | Sequence[int] = 0) -> tuple[np.ndarray, np.ndarray]:
    """Points (count,2), float64, of the attractor, drawn by the invariant measure, and the map (count,) that produced
    each.

    Trajectories begin at a `random_point`, so all their points lie on the attractor. Raises `InputError` if the code is
    not contractive.
    """
    start = random_point(code, seed)
    linear, offset = _float64(code)
    letters = random_letters(code, count, seed)
    points = visited(linear, offset, letters, np.array(start), WARM_UP)
    return points.reshape(-1, 2)[:count], letters[WARM_UP:].reshape(-1)[:count]


def _chances(code: IFS) -> np.ndarray:
    return code.sampling_probabilities().cpu().double().numpy()


def _float64(code: IFS) -> tuple[np.ndarray, np.ndarray]:
    return code.linear.cpu().double().numpy(), code.offset.cpu().double().numpy()


def _one_letter(linear: np.ndarray, offset: np.ndarray, units: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The coefficients that give u_k·f_i(x) from the table of u·x at the unit vectors (K,2), see `lowered`."""
    return *_interpolation(units @ linear, len(units)), offset @ units.T


def _unit_vectors(directions: int) -> np.ndarray:
    angle = np.arange(directions) * (2 * np.pi / directions)
    return np.column_stack([np.cos(angle), np.sin(angle)])


def _interpolation(rows: np.ndarray, directions: int) -> tuple[np.ndarray, np.ndarray]:
    """Write each row (…,2) as alpha u_k + beta u_k+1 with alpha, beta >= 0: k (…) and the pair (…,2)."""
    delta = 2 * np.pi / directions
    angle = np.mod(np.arctan2(rows[..., 1], rows[..., 0]), 2 * np.pi)
    first = np.minimum((angle / delta).astype(np.int64), directions - 1)
    phi = angle - first * delta
    length = np.linalg.norm(rows, axis=-1)[..., None]
    weights = length * np.stack([np.sin(delta - phi), np.sin(phi)], -1) / np.sin(delta)
    return first, np.maximum(weights, 0)
