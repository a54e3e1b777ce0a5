"""The occupancy of many codes: against its torch twin, against the chaos game, and what it refuses."""

import pytest
import torch

from fractal_exp import InputError, ops
from fractal_exp.ops.occupancy import occupancy

RANDOM = torch.Generator().manual_seed(0)
LINEAR = .4 * torch.randn(3, 2, 4, 2, 2, generator=RANDOM)
OFFSET = 2 * torch.rand(3, 2, 4, 2, generator=RANDOM) - 1


@pytest.mark.parametrize("frame", [None, 1.5])
@pytest.mark.parametrize("resolution, points, trajectories", [(1, 1, 1), (33, 700, 7), (64, 4000, 64)])
def test_the_kernel_lights_the_pixels_of_its_twin(frame, resolution, points, trajectories):
    seed = torch.arange(6).view(3, 2)
    kernel, twin = (occupancy(LINEAR, OFFSET, resolution, points=points, trajectories=trajectories, warmup=5,
                              frame=frame, seed=seed, backend=backend) for backend in ("cpu", "torch"))
    assert kernel.shape == (3, 2, resolution, resolution) and kernel.dtype == torch.uint8
    assert (kernel != twin).sum() <= 2, "points on an edge may fall on either side of it"


def test_it_marks_the_points_of_the_chaos_game():
    points = ops.chaos_game(LINEAR, OFFSET, trajectories=10, length=120, warmup=20, seed=4)
    lit = occupancy(LINEAR, OFFSET, 16, points=1000, trajectories=10, warmup=20, seed=4)
    row, column = ((1 - points[..., 1]) * 8).floor().long(), ((points[..., 0] + 1) * 8).floor().long()
    inside = (row >= 0) & (row < 16) & (column >= 0) & (column < 16)
    for i in range(3):
        for j in range(2):
            expected = torch.zeros(16, 16, dtype=torch.uint8)
            expected[row[i, j][inside[i, j]], column[i, j][inside[i, j]]] = 1
            assert (expected != lit[i, j]).sum() <= 1


def test_in_a_frame_the_box_is_centred_and_three_quarters_of_the_canvas():
    square = torch.tensor([[.5, 0], [0, .5]]).expand(4, 2, 2)
    corners = torch.tensor([[9., 9.], [9., 10.], [10., 9.], [10., 10.]]) / 2  # fills [9,10]², beside the canvas
    assert occupancy(square, corners, 32, points=20_000).sum() == 0
    lit = occupancy(square, corners, 32, points=20_000, frame=1.5)
    expected = torch.zeros(32, 32, dtype=torch.uint8)
    expected[4:28, 4:28] = 1
    assert (lit != expected).sum() <= 4


@pytest.mark.parametrize("options, message", [
    ({"points": 0}, "points must be an integer of at least 1"),
    ({"frame": 0.0}, "frame must be a finite number above 0"),
    ({"warmup": -1}, "warmup must be an integer of at least 0"),
    ({"probabilities": torch.tensor([.5, .4, 0, 0])}, "must sum to 1"),
])
def test_bad_settings_are_refused(options, message):
    with pytest.raises(InputError, match=message):
        occupancy(LINEAR, OFFSET, 8, **options)
