"""Lines of a landscape, from grids of heights."""

from __future__ import annotations

import heapq
import math

import numpy as np

NEIGHBOURS = [(r, c) for r in (-1, 0, 1) for c in (-1, 0, 1) if (r, c) != (0, 0)]


def drainage(height: np.ndarray, least: int) -> np.ndarray:
    """Where a stream drains at least so many cells of a grid (H,W) of heights: a mask (H,W).

    Hollows are filled from the edge inwards (priority flood, Barnes et al. 2014), which gives every cell a way out;
    each cell then drains to the steepest of its eight neighbours (D8, O'Callaghan and Mark 1984), or by that way.
    """
    filled, way, order = _flood(height)
    area = np.ones(height.size)
    for cell in order[::-1]:
        target = _steepest(filled, cell, way)
        if target is not None:
            area[target] += area[cell]
    return area.reshape(height.shape) >= least


def _flood(height: np.ndarray) -> tuple[np.ndarray, dict[int, int], list[int]]:
    """Heights without hollows, the way out of each cell but those at the edge, and the cells from low to high."""
    rows, columns = height.shape
    filled, way, order, seen = height.astype(float).copy(), {}, [], np.zeros(height.shape, bool)
    edge = [(r, c) for r in range(rows) for c in range(columns) if r in (0, rows - 1) or c in (0, columns - 1)]
    heap = []
    for r, c in edge:
        seen[r, c] = True
        heap.append((filled[r, c], r * columns + c))
    heapq.heapify(heap)
    while heap:
        level, cell = heapq.heappop(heap)
        order.append(cell)
        r, c = divmod(cell, columns)
        for dr, dc in NEIGHBOURS:
            i, j = r + dr, c + dc
            if 0 <= i < rows and 0 <= j < columns and not seen[i, j]:
                seen[i, j] = True
                filled[i, j] = max(filled[i, j], level)
                way[i * columns + j] = cell
                heapq.heappush(heap, (filled[i, j], i * columns + j))
    return filled, way, order


def _steepest(filled: np.ndarray, cell: int, way: dict[int, int]) -> int | None:
    """The cell that `cell` drains to; none at the edge."""
    if cell not in way:
        return None
    columns = filled.shape[1]
    r, c = divmod(cell, columns)
    falls = [((filled[r, c] - filled[r + dr, c + dc]) / math.hypot(dr, dc), (r + dr) * columns + c + dc)
             for dr, dc in NEIGHBOURS]
    fall, target = max(falls)
    return target if fall > 0 else way[cell]
