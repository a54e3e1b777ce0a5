"""The orbits of codes, played and binned at once, and the searches of pictures that no code draws."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch

from fractal_exp import ops
from fractal_exp.errors import InputError
from fractal_exp.methods.collage import picture_search
from fractal_exp.methods.collage.measure import LEVELS
from fractal_exp.methods.collage.picture import Picture
from fractal_exp.methods.collage.picture_search import PictureSearch
from fractal_exp.methods.collage.search import Tiling
from fractal_exp.ops.collage import orbit_bins, pushforward
from fractal_exp.runtime.seeds import generator


def random_codes(batch: int, maps: int) -> tuple[torch.Tensor, torch.Tensor]:
    g = generator(0, "codes", maps)
    linear, offset = 0.6 * torch.rand(batch, maps, 4, generator=g) - 0.2, torch.rand(batch, maps, 2, generator=g) - 0.5
    chances = torch.rand(maps, generator=g) + 0.05
    return torch.cat([linear, offset], -1), chances / chances.sum()


@pytest.mark.parametrize(("maps", "size"), [(1, 32), (3, 64), (7, 100), (30, 256)])
def test_orbits_are_binned_as_their_points_are_to_a_bit(maps, size):
    batch, chances = random_codes(3, maps)
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
    batch, chances = random_codes(2, 3)
    with pytest.raises(InputError, match="probabilities"):
        orbit_bins(batch, chances[:2], 32, trajectories=2, length=40, warmup=30, seed=0)
    with pytest.raises(InputError, match="maps"):
        orbit_bins(batch[0], chances, 32, trajectories=2, length=40, warmup=30, seed=0)


def searched(image: torch.Tensor, maps: torch.Tensor) -> tuple[PictureSearch, Tiling, list]:
    """A search of the image that begins with the maps (N,6), and what it draws: the number of maps, and whether each
    point was used once, as where several drawings are averaged."""
    drawn = []

    def observe(code, resolution, seed, **how):
        drawn.append((len(code), how.get("reuse") == 1))
        return LEVELS["density"].observe(code, resolution, seed, **how)

    picture = Picture(image, replace(LEVELS["density"], observe=observe))
    start = picture.judge(maps)
    search = PictureSearch(picture, picture.levels.measure(image), noise=picture.noise(start.code))
    drawn.clear()
    return search, Tiling(maps, start.chances, start.error, start.error), drawn


@pytest.fixture
def scribble() -> torch.Tensor:
    """A curve of no code, (64,64)."""
    t = torch.linspace(0, 6.28, 4000)
    column, row = 32 + 24 * (3 * t).sin() * (0.7 * t).cos(), 32 + 24 * (2 * t + 1).cos()
    image = torch.zeros(64, 64)
    image[row.long(), column.long()] = 0.6
    return image


@pytest.mark.parametrize("more", [0, 1])
def test_roots_of_one_of_many_maps_are_not_tried_where_the_picture_may_be_of_no_code(scribble, more, monkeypatch):
    count = picture_search.ROOTS_MAPS + more
    maps = random_codes(1, count)[0][0]
    maps[0, :4] = torch.tensor([0.8, 0.1, -0.1, 0.7])  # has roots
    search, start, drawn = searched(scribble, maps)
    shown = search.picture.judge(maps)
    assert search.is_hopeless(start)

    def most_maps_drawn() -> int:
        drawn.clear()
        search._rooted(shown, 0, 2)
        return max((each for each, _ in drawn), default=0)

    assert most_maps_drawn() == (0 if more else 2 * count - 1)
    monkeypatch.setattr(picture_search, "HOPELESS", torch.pi)
    assert most_maps_drawn() == 2 * count - 1


def test_the_end_of_a_hopeless_search_is_not_polished_on_several_drawings_and_no_worse(scribble):
    search, start, drawn = searched(scribble, random_codes(1, 5)[0][0])
    found = search.finish(start)
    assert search.is_hopeless(found) and found.error <= start.error
    assert not any(once for _, once in drawn)
