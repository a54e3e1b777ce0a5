"""Where an attractor lies: a disc and a box that are certain, the box that is seen, and the frame that follows."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .ifs import IFS
from .ops.address_tree import farthest_word, lowered

FRAME_SIDE = 1.5          # the longer side of a normalised attractor: 25% padding of the canvas [-1,1]²
BOX_TOLERANCE = 1e-7      # of the box's longer side
MAX_WORDS = 50_000        # words kept per level of the address tree,
MAX_VISITS = 1_000_000    # and looked at in all
DIRECTIONS = 1024         # of the support function's table
MAX_SWEEPS = 5_000        # of the support function's fixed-point iteration
VISIBLE_CHANCE = 1e-6     # of a word that is seen
LETTERS = 2000            # of a random address


def bounding_disc(code: IFS) -> tuple[np.ndarray, float]:
    """A disc (center (2,), radius) that is certain to hold the attractor: every map sends it into itself.

    With |f_i(c) - c| = d_i and largest singular value s_i, any radius r >= d_i / (1 - s_i) will do (Hutchinson 1981).
    Raises `InputError` if the code is not contractive.
    """
    code.check_contractive()
    linear, offset = _float64(code)
    fixed = np.linalg.solve(np.eye(2) - linear, offset[..., None])[..., 0]
    scale = np.linalg.norm(linear, ord=2, axis=(1, 2))
    center = np.average(fixed, axis=0, weights=1 / (1 - scale))
    moved = np.linalg.norm(np.einsum("nij,j->ni", linear, center) + offset - center, axis=1)
    return center, float((moved / (1 - scale)).max())


def support_function(code: IFS) -> np.ndarray:
    """Certain upper bounds (K,) of max over the attractor of u_k·x, at K = 1024 directions of angle 2 pi k / K.

    The half planes u_k·x <= h_k hold the attractor. A support function obeys h(u) = max_i h(M_i^T u) + b_i·u and is
    sublinear, so interpolating between two directions never underestimates; iterating from the disc's values keeps
    every bound certain while they contract. Raises `InputError` if the code is not contractive.
    """
    linear, offset = _float64(code)
    center, radius = bounding_disc(code)
    units = _unit_vectors()
    first, weights = _interpolation(np.einsum("nij,ki->nkj", linear, units))
    shift = offset @ units.T
    table = units @ center + radius
    slack = 1 - np.linalg.norm(linear, ord=2, axis=(1, 2)).max()
    return lowered(table, first, weights, shift, 1e-7 * slack * radius, MAX_SWEEPS)


def bounding_box(code: IFS) -> np.ndarray:
    """The attractor's axis-aligned box (x_min, y_min, x_max, y_max), float64, certain and tight.

    Each side is the support function in one direction, found by branch and bound over the address tree; the box is
    never too small, and too large by at most 1e-7 of its longer side (more only where very many words nearly tie).
    Raises `InputError` if the code is not contractive.
    """
    linear, offset = _float64(code)
    table = support_function(code)
    quarter = DIRECTIONS // 4
    width, height = table[0] + table[2 * quarter], table[quarter] + table[3 * quarter]
    tolerance = max(BOX_TOLERANCE * max(width, height), 1e-12)
    directions = _unit_vectors()[::quarter]
    right, top, left, bottom = (_support(u, linear, offset, table, tolerance) for u in directions)
    return np.array([-left, -bottom, right, top])


def visible_box(code: IFS) -> np.ndarray:
    """The box (x_min, y_min, x_max, y_max), float64, of the words that a million points would visit.

    It holds f_w(c) for every word w of chance p_w >= 1e-6, c the mean of the invariant measure. This is the kind of
    box that the paper normalises by, that of many sampled points, without their luck: it depends neither on a seed nor
    on the order of the maps. It lies inside `bounding_box`, at times far inside: a map with a singular value near 1
    stretches the attractor into tails of chance 1e-8 that no picture ever shows (over the random suite the two differ
    by more than 1% of the side for a quarter of the codes). Raises `InputError` if the code is not contractive.
    """
    (right, _), (top, _), (left, _), (bottom, _) = visible_tips(code)
    return np.array([-left, -bottom, right, top])


def visible_tips(code: IFS) -> list[tuple[float, np.ndarray]]:
    """How far the `visible_box` reaches to the right, the top, the left and the bottom, and the words that reach there,
    each an array (L,) of maps, the outermost first. Raises `InputError` if the code is not contractive."""
    table = support_function(code)
    linear, offset = _float64(code)
    chance = code.sampling_probabilities().cpu().double().numpy()
    mean = np.linalg.solve(np.eye(2) - np.einsum("n,nij->ij", chance, linear), chance @ offset)
    tolerance = BOX_TOLERANCE * max(table[0] + table[DIRECTIONS // 2], table[DIRECTIONS // 4] + table[-DIRECTIONS // 4])
    return [farthest_word(u, linear, offset, chance, mean, table, VISIBLE_CHANCE, tolerance)
            for u in _unit_vectors()[:: DIRECTIONS // 4]]


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

    The maps of a random address of 2000 letters are applied to a point of the attractor. Raises `InputError` if the
    code is not contractive.
    """
    code.check_contractive()
    linear, offset = _float64(code)
    p = code.sampling_probabilities().cpu().double().numpy()
    # A fixed point is on the attractor, and so are all its images.
    x, y = np.linalg.solve(np.eye(2) - linear[p.argmax()], offset[p.argmax()]).tolist()
    letters = np.random.Generator(np.random.PCG64(seed)).choice(len(p), LETTERS, p=p / p.sum())
    for a, b, c, d, e, f in np.hstack([linear.reshape(-1, 4), offset])[letters].tolist():
        x, y = a * x + b * y + e, c * x + d * y + f
    return x, y


def _float64(code: IFS) -> tuple[np.ndarray, np.ndarray]:
    return code.linear.cpu().double().numpy(), code.offset.cpu().double().numpy()


def _unit_vectors() -> np.ndarray:
    angle = np.arange(DIRECTIONS) * (2 * np.pi / DIRECTIONS)
    return np.column_stack([np.cos(angle), np.sin(angle)])


def _interpolation(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Write each row (…,2) as alpha u_k + beta u_k+1 with alpha, beta >= 0: k (…) and the pair (…,2)."""
    delta = 2 * np.pi / DIRECTIONS
    angle = np.mod(np.arctan2(rows[..., 1], rows[..., 0]), 2 * np.pi)
    first = np.minimum((angle / delta).astype(np.int64), DIRECTIONS - 1)
    phi = angle - first * delta
    length = np.linalg.norm(rows, axis=-1)[..., None]
    weights = length * np.stack([np.sin(delta - phi), np.sin(phi)], -1) / np.sin(delta)
    return first, np.maximum(weights, 0)


def _interpolate(table: np.ndarray, first: np.ndarray, weights: np.ndarray) -> np.ndarray:
    return weights[..., 0] * table[first] + weights[..., 1] * table[(first + 1) % DIRECTIONS]


def _support(u: np.ndarray, linear: np.ndarray, offset: np.ndarray, table: np.ndarray, tolerance: float) -> float:
    """An upper bound, within `tolerance`, of max over the attractor of u·x.

    A word w is kept as the row v = u^T M_w and the number s = u·b_w, since u·f_w(x) = v·x + s; its value on the
    attractor is at most h(v) + s.
    """
    fixed = np.linalg.solve(np.eye(2) - linear, offset[..., None])[..., 0]
    rows, shifts = u[None], np.zeros(1)
    best, visits = -np.inf, 0
    while True:
        upper = _interpolate(table, *_interpolation(rows)) + shifts
        best = max(best, float((rows @ fixed.T + shifts[:, None]).max()),
                   _descend(rows[upper.argmax()], shifts[upper.argmax()], linear, offset, table, fixed))
        keep = upper > best + tolerance
        if not keep.any():
            return best + tolerance
        visits += len(rows)
        if keep.sum() * len(linear) > MAX_WORDS or visits > MAX_VISITS:
            return float(upper.max())
        rows, shifts = rows[keep], shifts[keep]
        shifts = (shifts[:, None] + rows @ offset.T).reshape(-1)
        rows = np.einsum("ki,nij->knj", rows, linear).reshape(-1, 2)
        # Words that agree here agree for ever: the whole lower edge of Sierpinski's carpet is one state.
        state = np.round(np.column_stack([rows, shifts]) / (1e-2 * tolerance))
        _, first = np.unique(state, axis=0, return_index=True)
        rows, shifts = rows[first], shifts[first]


def _descend(row: np.ndarray, shift: float, linear: np.ndarray, offset: np.ndarray, table: np.ndarray,
             fixed: np.ndarray, depth: int = 64) -> float:
    """The value u·x of an attractor point, reached by taking the most promising map `depth` times."""
    for _ in range(depth):
        rows, shifts = row @ linear, shift + offset @ row
        i = int((_interpolate(table, *_interpolation(rows)) + shifts).argmax())
        row, shift = rows[i], shifts[i]
    return float((fixed @ row).max() + shift)
