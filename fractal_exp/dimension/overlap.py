"""Whether the pieces of a self-similar set overlap."""

from __future__ import annotations

import numpy as np

from ..ifs.attractor import bounding_disc
from ..ifs.code import IFS

MOST_NEIGHBOURS = 4000     # neighbour maps after which the question stays open
MOST_CANDIDATES = 200_000  # of one step, for the memory
CELLS = 2.0**12            # in the attractor's radius: maps that differ by less than one count as one


def overlap(code: IFS) -> bool | None:
    """Whether pieces of similarities overlap more than at their edges: False if the open set condition holds, True if
    two words are one map, None where neither shows.

    A neighbour map f_u⁻¹ f_v tells how two pieces of about one size, f_u(A) and f_v(A), lie to each other. The
    condition fails only if some come arbitrarily near to the identity (Bandt and Graf 1992). If those of pieces that
    may touch are finitely many, they are all found here. Entries are equal up to the rounding of float32. Raises
    `InputError` if the code is not contractive.
    """
    (center, radius), count = bounding_disc(code), len(code)
    maps = np.tile(np.eye(3), (count, 1, 1))
    maps[:, :2, :2] = code.linear.cpu().double().numpy()
    maps[:, :2, 2] = (code.offset.cpu().double().numpy() + maps[:, :2, :2] @ center - center) / (radius or 1.0)
    inverse, seen = np.linalg.inv(maps), set[bytes]()
    if count * count > MOST_CANDIDATES:
        return None
    first, second = np.triu_indices(count, 1)
    found = inverse[first] @ maps[second]
    while len(found):
        ratio = np.sqrt(np.abs(np.linalg.det(found)))
        found = found[np.hypot(found[:, 0, 2], found[:, 1, 2]) <= (1 + ratio) * (1 + 1e-6)]  # whose discs meet
        if (np.abs(found - np.eye(3)).max((1, 2), initial=0) < 1 / CELLS).any():
            return True
        keys = np.floor(found[:, :2].reshape(-1, 6) * CELLS + 0.37).astype(np.int64)
        new = [i for i, key in enumerate(keys) if (told := key.tobytes()) not in seen and not seen.add(told)]
        if len(seen) > MOST_NEIGHBOURS or len(new) * count > MOST_CANDIDATES:
            return None
        found = found[new]
        larger = np.abs(np.linalg.det(found)) > 1  # the second piece is; the larger of two is divided
        found = np.concatenate([(found[larger, None] @ maps).reshape(-1, 3, 3),
                                (inverse @ found[~larger, None]).reshape(-1, 3, 3)])
    return False
