"""The counts of points in pixels, beside their twin."""

from __future__ import annotations

import pytest
import torch

from fractal_exp.errors import InputError
from fractal_exp.ops.counts import point_counts


@pytest.mark.parametrize("side", [1, 7, 256])
def test_points_are_counted_as_by_the_twin(side):
    points = 3 * torch.rand(5000, 2, generator=torch.Generator().manual_seed(side)) - 1.5
    points[:6] = torch.tensor([[torch.nan, 0], [0, torch.inf], [-1, 1], [1, 0], [0, -1], [-torch.inf, 0]])
    counts = point_counts(points, side)
    assert torch.equal(counts, point_counts(points, side, backend="torch"))
    assert 0 < int(counts.sum()) < len(points)


def test_a_pixel_holds_its_left_and_upper_edge():
    points = torch.tensor([[-1.0, 1.0], [0.0, 0.0], [0.9, -0.9], [1.0, 0.0], [0.0, -1.0]])
    assert point_counts(points, 2).tolist() == [[1, 0], [0, 2]]


@pytest.mark.parametrize(("points", "side"), [(torch.zeros(3), 4), (torch.zeros(3, 3), 4), (torch.zeros(3, 2), 0)])
def test_what_cannot_be_counted_is_refused(points, side):
    with pytest.raises(InputError):
        point_counts(points, side)
