"""The orbits of codes, played and binned at once, and the searches of pictures that no code draws."""

from __future__ import annotations

import pytest
import torch

from fractal_exp import ops
from fractal_exp.errors import InputError
from fractal_exp.ops.collage import orbit_bins, pushforward
from fractal_exp.seeds import generator


def codes(batch: int, maps: int) -> tuple[torch.Tensor, torch.Tensor]:
    g = generator(0, "codes", maps)
    linear, offset = 0.6 * torch.rand(batch, maps, 4, generator=g) - 0.2, torch.rand(batch, maps, 2, generator=g) - 0.5
    chances = torch.rand(maps, generator=g) + 0.05
    return torch.cat([linear, offset], -1), chances / chances.sum()


@pytest.mark.parametrize(("maps", "size"), [(1, 32), (3, 64), (7, 100), (30, 256)])
def test_orbits_are_binned_as_their_points_are_to_a_bit(maps, size):
    batch, chances = codes(3, maps)
    played = ops.chaos_game(batch[..., :4].unflatten(-1, (2, 2)), batch[..., 4:], trajectories=20, length=430,
                            warmup=30, probabilities=chances, seed=-7)
    samples = torch.cat([played, torch.full_like(played[..., :1], 1 / played.shape[1])], -1)
    identity = torch.tensor([[[1.0, 0, 0, 1, 0, 0]]])
    expected = torch.cat([pushforward(identity, torch.ones(1, 1), each, size) for each in samples])
    found = orbit_bins(batch, chances, size, trajectories=20, length=430, warmup=30, seed=-7)
    assert torch.equal(found, expected)
    twin = orbit_bins(batch, chances, size, trajectories=20, length=430, warmup=30, seed=-7, backend="torch")
    assert torch.allclose(found, twin, atol=2e-5)


def test_orbits_of_other_shapes_are_refused():
    batch, chances = codes(2, 3)
    with pytest.raises(InputError, match="probabilities"):
        orbit_bins(batch, chances[:2], 32, trajectories=2, length=40, warmup=30, seed=0)
    with pytest.raises(InputError, match="maps"):
        orbit_bins(batch[0], chances, 32, trajectories=2, length=40, warmup=30, seed=0)
