"""Whether the pieces of a self-similar set overlap."""

from __future__ import annotations

import numpy as np

from ..ifs.attractor import bounding_disc
from ..ifs.code import IFS

MOST_NEIGHBOURS, MOST_CANDIDATES = 1000, 200_000  # in all, and of one step, after which the question stays open
CELLS = 2.0**15  # in the attractor's radius: entries that differ by less than one are equal but for rounding


def overlap(code: IFS) -> bool | None:
    """Whether pieces of similarities overlap more than at their edges: False if the open set condition holds, True if
    two words are one map, None where neither shows.

    A neighbour map f_u⁻¹ f_v tells how two pieces f_u(A), f_v(A) of about one size lie to each other. The condition
    fails only if some come arbitrarily near to the identity (Bandt and Graf 1992). All those whose pieces may touch are
    found here, if they are not too many. Raises `InputError` if the code is not contractive.
    """
    (center, radius), count = bounding_disc(code), len(code)
    maps = np.tile(np.eye(3), (count, 1, 1))
    maps[:, :2, :2] = code.linear.cpu().double().numpy()
    maps[:, :2, 2] = (code.offset.cpu().double().numpy() + maps[:, :2, :2] @ center - center) / (radius or 1.0)
    if count**2 > MOST_CANDIDATES:
        return None
    inverse, seen, (first, second) = np.linalg.inv(maps), set[bytes](), np.triu_indices(count, 1)
    found = inverse[first] @ maps[second]
    while len(found):
        ratio = np.sqrt(np.abs(np.linalg.det(found)))
        found = found[np.hypot(found[:, 0, 2], found[:, 1, 2]) <= (1 + ratio) * (1 + 1e-6)]  # whose discs meet
        if (np.abs(found - np.eye(3)).max((1, 2), initial=0) < 1 / CELLS).any():
            return True
        keys = np.floor(found[:, :2].reshape(-1, 6) * CELLS + 0.37).astype(np.int64)
        new = [i for i, key in enumerate(map(bytes, keys)) if key not in seen and not seen.add(key)]
        if len(seen) > MOST_NEIGHBOURS or len(new) * count > MOST_CANDIDATES:
            return None
        found = found[new]
        larger = np.abs(np.linalg.det(found)) > 1  # the second piece is; the larger of two is divided
        found = np.concatenate([(found[larger, None] @ maps).reshape(-1, 3, 3),
                                (inverse @ found[~larger, None]).reshape(-1, 3, 3)])
    return False
