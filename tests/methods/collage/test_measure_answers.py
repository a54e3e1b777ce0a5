"""Known answers and properties of parts of collage search: displacements, the push off the identity, the correction."""

import math

import pytest
import torch
from collage_helpers import DENSITY, PARAMS, random
from ops_helpers import tiling_problem

from fractal_exp import suite
from fractal_exp.ifs import affine, attractor
from fractal_exp.images.levels import meaning_of
from fractal_exp.methods.collage.bins import correction, halve
from fractal_exp.methods.collage.measure.births import candidates, raced
from fractal_exp.methods.collage.measure.search import MeasureSearch, Regime
from fractal_exp.ops.collage import BinnedMeasure, Descent, descend, pushforward
from fractal_exp.ops.collage.reference import displacement_squared

IDENTITY = torch.tensor([1.0, 0, 0, 1, 0, 0])


def applied(maps, samples):
    """Samples (K,3) of x, y, mass under maps (n,6): (n,K,2)."""
    return samples[:, :2] @ maps[:, :4].unflatten(1, (2, 2)).mT + maps[:, None, 4:]


def far_from_the_middle():
    """A measure whose mean is (0.3, -0.2), more or less."""
    measure, *_ = tiling_problem()
    moved = torch.tensor([[0.6, 0.1, 0, 0.5, 0.3, -0.2]])
    samples = torch.cat([applied(moved, measure.samples)[0], measure.samples[:, 2:]], 1)
    bins = pushforward(IDENTITY.view(1, 1, 6), torch.ones(1, 1), samples, measure.size)[0]
    return BinnedMeasure(samples, bins, measure.grids)


def test_the_displacement_of_a_measure_is_that_of_its_points():
    measure, maps = far_from_the_middle(), torch.randn(4, 6, generator=random())
    mass = measure.samples[:, 2]
    moved = (applied(maps, measure.samples) - measure.samples[:, :2]).square().sum(-1) @ mass / mass.sum()
    torch.testing.assert_close(displacement_squared(maps, measure.mean, measure.covariance).double(), moved.double(),
                               atol=1e-4, rtol=1e-4)


def near_the_identity():
    """Maps (3,1,6) that move the measure by less than `Descent.identity_radius`."""
    return IDENTITY + 0.02 * torch.randn(3, 1, 6, generator=random())


@pytest.mark.parametrize("backend", ["cpu", "torch"])
def test_maps_near_the_identity_are_pushed_off_it(backend):
    measure, maps = far_from_the_middle(), near_the_identity()

    def displacement(weight):
        how = Descent(60, rate=0.01, largest=1.1, identity_weight=weight)
        found, *_ = descend(maps, torch.ones(3, 1), measure, how, backend=backend)
        return displacement_squared(found[:, 0], measure.mean, measure.covariance).sqrt()

    assert float(displacement(0.0).max()) < 0.02, "the identity has no collage error"
    assert float(displacement(30.0).min()) > 0.095, "pushed as far as the radius"


@pytest.mark.parametrize("tied", [False, True])
def test_the_kernel_pushes_off_the_identity_as_its_twin_does(tied):
    measure, maps = far_from_the_middle(), near_the_identity()
    how = Descent(6, rate=0.004, largest=1.1, tied=tied)
    ours, twin = (descend(maps, torch.ones(3, 1), measure, how, backend=backend)[0] for backend in ("cpu", "torch"))
    torch.testing.assert_close(ours, twin, atol=2e-5, rtol=0)
    without = descend(maps, torch.ones(3, 1), measure, Descent(6, rate=0.004, largest=1.1, identity_weight=0.0))[0]
    assert float((without - ours).abs().max()) > 1e-3, "or nothing is shown"


def test_a_line_along_the_border_is_no_inside_of_a_shape():
    image = torch.zeros(64, 64)
    image[:4] = torch.tensor([0.5, 1, 1, 0.5])[:, None]  # an anti-aliased bar that the border cuts
    assert all(meaning_of(turned) == "drawn" for turned in (image, image.T, image.flip(0), image.T.flip(1)))


def test_a_correction_is_trusted_where_picture_and_code_agree():
    """Where a part of the picture is so dark that it cannot be of the code, it is left alone."""
    code, levels = attractor.normalize(suite.random_suite(6, 101)[5]), DENSITY
    masses = levels.measure(suite.target(code, 128))
    right = correction(masses, code, levels, PARAMS.saturation, seed=3)
    dark = masses.clone()
    dark[:, :64] *= 0.2
    wrong = correction(dark, code, levels, PARAMS.saturation, seed=3)
    torch.testing.assert_close(wrong[:, 66:], right[:, 66:])
    corrected = (masses > 0) & ((right - 1).abs() > 0.1)
    corrected[:, 62:] = False  # beyond the seam
    assert int(corrected.sum()) > 20, "there is something to correct"
    assert float((wrong[corrected] - 1).abs().max()) < 0.05


def test_halved_bins_hold_the_same_mass():
    bins = torch.rand(3, 8, 8, generator=random())
    torch.testing.assert_close(halve(bins, 4), bins.view(3, 4, 2, 4, 2).sum((2, 4)))
    torch.testing.assert_close(halve(bins[0], 1), bins[0].sum().view(1, 1))


def test_random_matrices_are_half_of_them_reflections_and_their_sizes_log_uniform():
    matrices = affine.random_matrices(4000, 0.01, 0.64, 0.05, random())
    assert float((torch.linalg.det(matrices) < 0).float().mean()) == pytest.approx(0.5, abs=0.04)
    logs = torch.linalg.svdvals(matrices)[:, 0].log()
    parts = torch.tensor([0.25, 0.5, 0.75])
    torch.testing.assert_close(logs.quantile(parts), math.log(0.01) + parts * math.log(64), atol=0.15, rtol=0)


def test_maps_born_of_a_blob_give_the_measure_its_mean_and_covariance():
    measure, size = far_from_the_middle(), 64
    axis = (2 * torch.arange(size) + 1) / size - 1
    blob = torch.exp(-((axis - 0.3) / 0.12).square() / 2) * torch.exp(-((-axis[:, None] - 0.1) / 0.06).square() / 2)
    wide = (0.9, 0.97)  # windows far wider than the blob
    born = candidates(blob, blob, measure, wide, 20, 20, PARAMS.births, random())
    linear = born[:, :4].unflatten(1, (2, 2))
    covariance = linear @ measure.covariance.float() @ linear.mT
    expected = torch.tensor([[0.12**2, 0], [0, 0.06**2]]).expand(20, 2, 2)
    torch.testing.assert_close(covariance, expected, atol=2e-3, rtol=0)
    mean = linear @ measure.mean.float() + born[:, 4:]
    torch.testing.assert_close(mean, torch.tensor([0.3, 0.1]).expand(20, 2), atol=0.02, rtol=0)


def test_a_race_is_won_by_what_each_background_lacks():
    samples = tiling_problem()[0].samples
    tiles = torch.stack([torch.tensor([0.5, 0, 0, 0.5, 0.4 * k, 0.4 * k]) for k in (-1, 1)])
    images = pushforward(tiles[:, None].contiguous(), torch.full((2, 1), 0.5), samples, 64)
    grids = [BinnedMeasure(samples, halve(images.sum(0), size)) for size in (64, 32)]
    entrants, weights, still = (tiles + 0.01).expand(2, 2, 6), torch.full((2, 2), 0.5), Descent(0, prior=0.0)
    lacking = images.flip(0)   # the first lacks the first tile, the second the other

    def winners(*heats):
        return raced(entrants, weights, grids[-len(heats):], heats, lacking, (0.99, 0.99))[0]

    torch.testing.assert_close(winners((still, 2)), torch.stack([tiles, tiles.flip(0)]) + 0.01)  # best first
    torch.testing.assert_close(winners((still, 2), (still, 1)), tiles[:, None] + 0.01)
    shrunk, _ = raced(entrants, weights, grids, [(Descent(1, prior=0.0), 1)] * 2, lacking, (0.4, 0.3))
    torch.testing.assert_close(torch.linalg.svdvals(shrunk[:, 0, :4].unflatten(1, (2, 2))),
                               torch.tensor([[0.4, 0.3]]).expand(2, 2), atol=1e-3, rtol=0)
    moved = winners((Descent(30, rate=0.01, prior=0.0), 1), (Descent(30, rate=0.01, prior=0.0), 1))
    torch.testing.assert_close(moved[:, 0], tiles, atol=4e-3, rtol=0)


def test_a_score_is_the_error_and_what_maps_identities_and_untied_weights_cost():
    masses = torch.rand(32, 32, generator=random())
    search = MeasureSearch(masses, Regime(32, 1e-3, 0.02, 8, (0.1, 0.9)), PARAMS)
    half, quarter = torch.tensor([0.5, 0, 0, 0.5, 0.3, 0.3]), torch.tensor([0.5, 0, 0, 0.5, -0.3, 0.3])
    maps, even = torch.stack([half, quarter]), torch.tensor([0.25, 0.25])
    assert search.cheap_score(maps, even, 0.125) == pytest.approx(0.125 + 2e-3, abs=1e-6)
    untied = 0.75 * math.log(1.5) ** 2 + 0.25 * math.log(0.5) ** 2
    assert search.cheap_score(maps, torch.tensor([0.375, 0.125]), 0.125) == pytest.approx(
        0.125 + 2e-3 + 0.01 * untied, abs=1e-6)
    assert search.cheap_score(IDENTITY[None], torch.tensor([0.5]), 0.125) == pytest.approx(
        0.125 + 1e-3 + 0.5 * Descent(1).identity_weight, abs=1e-6)
