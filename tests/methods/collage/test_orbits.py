"""The orbits of codes, played and binned at once, and the searches of pictures that no code draws."""

from __future__ import annotations

import pytest
import torch
from collage_helpers import CAMERA, PARAMS

from fractal_exp import ops
from fractal_exp.cameras.levels import Density
from fractal_exp.errors import InputError
from fractal_exp.methods.collage.image.objective import ImageObjective
from fractal_exp.methods.collage.moves.search import ImageSearch
from fractal_exp.methods.collage.moves.single import HOPELESS_MAPS, rooted
from fractal_exp.methods.collage.state import Candidate
from fractal_exp.ops.collage import orbit_bins, pushforward
from fractal_exp.runtime.seeds import generator


def random_codes(batch: int, maps: int) -> tuple[torch.Tensor, torch.Tensor]:
    g = generator(0, "codes", maps)
    linear, offset = 0.6 * torch.rand(batch, maps, 4, generator=g) - 0.2, torch.rand(batch, maps, 2, generator=g) - 0.5
    probabilities = torch.rand(maps, generator=g) + 0.05
    return torch.cat([linear, offset], -1), probabilities / probabilities.sum()


@pytest.mark.parametrize(("maps", "size"), [(1, 32), (3, 64), (7, 100), (30, 256)])
def test_orbits_are_binned_as_their_points_are_to_a_bit(maps, size):
    batch, probabilities = random_codes(3, maps)
    played = ops.chaos_game(batch[..., :4].unflatten(-1, (2, 2)), batch[..., 4:], trajectories=20, length=430,
                            warmup=30, probabilities=probabilities, seed=-7)
    samples = torch.cat([played, torch.full_like(played[..., :1], 1 / played.shape[1])], -1)
    identity = torch.tensor([[[1.0, 0, 0, 1, 0, 0]]])
    expected = torch.cat([pushforward(identity, torch.ones(1, 1), each, size) for each in samples])
    found = orbit_bins(batch, probabilities, size, trajectories=20, length=430, warmup=30, seed=-7)
    assert torch.equal(found, expected)
    twin = orbit_bins(batch, probabilities, size, trajectories=20, length=430, warmup=30, seed=-7, backend="torch")
    assert torch.allclose(found, twin, atol=2e-5)


def test_orbits_of_other_shapes_are_refused():
    batch, probabilities = random_codes(2, 3)
    with pytest.raises(InputError, match="probabilities"):
        orbit_bins(batch, probabilities[:2], 32, trajectories=2, length=40, warmup=30, seed=0)
    with pytest.raises(InputError, match="maps"):
        orbit_bins(batch[0], probabilities, 32, trajectories=2, length=40, warmup=30, seed=0)
    with pytest.raises(InputError, match="lower trajectories or length"):
        orbit_bins(batch, probabilities, 32, trajectories=2**24, length=100_000, warmup=30, seed=0)


class Counted(Density):
    """Density that notes what it renders: the number of maps, and whether each point was used once, as where several
    renderings are averaged."""

    def __init__(self):
        super().__init__(CAMERA)
        self.rendered: list[tuple[int, bool]] = []

    def render(self, code, resolution, seed, *, independent=False):
        self.rendered.append((len(code), independent))
        return super().render(code, resolution, seed, independent=independent)


class Promising(ImageObjective):
    """An image that may show a code, whatever the errors."""

    def is_hopeless(self, error):
        return False


def searched(image: torch.Tensor, maps: torch.Tensor, kind=ImageObjective) -> tuple[ImageSearch, Candidate, list]:
    """A search of the image that begins with the maps (N,6), and what it renders."""
    levels = Counted()
    judge = kind(image, levels, PARAMS)
    start = judge.judge(maps)
    search = ImageSearch(judge, levels.measure(image), noise=judge.noise(start.code))
    levels.rendered.clear()
    return search, Candidate(maps, None, start.error, start.error), levels.rendered


@pytest.fixture
def scribble() -> torch.Tensor:
    """A curve of no code, (64,64)."""
    t = torch.linspace(0, 6.28, 4000)
    column, row = 32 + 24 * (3 * t).sin() * (0.7 * t).cos(), 32 + 24 * (2 * t + 1).cos()
    image = torch.zeros(64, 64)
    image[row.long(), column.long()] = 0.6
    return image


@pytest.mark.parametrize("more", [0, 1])
def test_roots_of_one_of_many_maps_are_not_tried_where_the_image_may_be_of_no_code(scribble, more):
    count = HOPELESS_MAPS + more
    maps = random_codes(1, count)[0][0]
    maps[0, :4] = torch.tensor([0.8, 0.1, -0.1, 0.7])  # has roots

    def most_maps_rendered(kind=ImageObjective) -> int:
        search, start, rendered = searched(scribble, maps, kind)
        shown = search.objective.judge(maps)
        assert search.objective.is_hopeless(start.error) == (kind is ImageObjective)
        rendered.clear()
        rooted(search, shown, 0, 2)
        return max((each for each, _ in rendered), default=0)

    assert most_maps_rendered() == (0 if more else 2 * count - 1)
    assert not more or most_maps_rendered(Promising) == 2 * count - 1


def test_the_end_of_a_hopeless_search_is_not_polished_on_several_renderings_and_no_worse(scribble):
    search, start, drawn = searched(scribble, random_codes(1, 5)[0][0])
    found = search.finish(start)
    assert search.objective.is_hopeless(found.error) and found.error <= start.error
    assert not any(once for _, once in drawn)


@pytest.mark.parametrize("backend", ["cpu", "torch"])
def test_a_map_without_a_positive_weight_is_absent(backend):
    maps, samples = torch.randn(1, 2, 6) * 0.3, torch.rand(50, 3)
    alone = pushforward(maps[:, :1], torch.ones(1, 1), samples, 16, backend=backend)
    assert torch.equal(pushforward(maps, torch.tensor([[1.0, -1.0]]), samples, 16, backend=backend), alone)
