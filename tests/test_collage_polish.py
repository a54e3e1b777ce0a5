"""The polish of codes: Jacobians, the frame, memory."""

from dataclasses import replace

import pytest
import torch

from fractal_exp import InputError, codes, suite
from fractal_exp.ifs import attractor
from fractal_exp.methods.collage import maps as affine
from fractal_exp.methods.collage.births import turned
from fractal_exp.methods.collage.frame import Frame
from fractal_exp.methods.collage.jacobian import Played, Redrawn
from fractal_exp.methods.collage.measure import LEVELS, binned
from fractal_exp.methods.collage.memory import MemoryBudget
from fractal_exp.methods.collage.method import Collage
from fractal_exp.methods.collage.picture import Picture
from fractal_exp.methods.collage.picture_search import THIN, PictureSearch
from fractal_exp.methods.collage.polish import polished
from fractal_exp.methods.collage.search import Tiling
from fractal_exp.methods.collage.superfluous import without_superfluous


@pytest.fixture(scope="module")
def fern():
    """Barnsley's fern in the frame, and its grey image of 128²."""
    code = attractor.normalize(replace(codes.known("fern"), probabilities=None))
    return code, suite.target(code, 128)


def displaced(code, pixels=0.5, side=128):
    maps = affine.from_code(code)
    return maps + 2 * pixels / side * torch.randn(maps.shape, generator=torch.Generator().manual_seed(1)) / 2


@pytest.mark.parametrize("slopes", [Played, Redrawn])
def test_both_jacobians_lead_to_the_true_code(triangle, slopes):
    code, image = triangle
    picture = Picture(image, LEVELS["density"])
    start = picture.judge(displaced(code))
    found = polished(picture, start, 8, slopes=slopes)
    assert found.error < 0.3 * start.error
    assert slopes(picture, start, [1], 0).square.shape == (6, 6)


def test_drawings_lead_nearer_than_bins_where_images_end_at_the_edge_of_a_pixel(triangle):
    code, image = triangle
    before = after = 0.0
    for seed in range(4):
        picture = Picture(image, LEVELS["density"], seed)
        by_bins = polished(picture, picture.judge(displaced(code, 0.05)), 10)
        before += by_bins.error
        after += polished(picture, by_bins, 4, slopes=Redrawn, alone=True).error
    assert after < 0.96 * before


def test_the_frame_is_that_of_targets_and_of_nothing_else(fern, triangle):
    for code, image in (fern, triangle):
        frame, maps = Frame.of(image), affine.from_code(code)
        misfit = frame.misfit(maps, code.sampling_probabilities())
        assert misfit.shape == (3,) and float(misfit.abs().max()) < 0.02
    image = fern[1]
    assert Frame.of(torch.zeros_like(image)) is None
    assert Frame.of(torch.ones_like(image)) is None
    small = torch.zeros_like(image)
    small[32:96, 32:96] = image[::2, ::2]
    assert Frame.of(small) is None


def test_the_slopes_of_a_misfit_are_its_differences(fern):
    code, image = fern
    frame, maps, chances = Frame.of(image), affine.from_code(code).double(), code.sampling_probabilities()
    slopes = frame.slopes(maps, chances)
    direction = torch.randn(maps.shape, dtype=torch.float64, generator=torch.Generator().manual_seed(2))
    step = 1e-4
    ends = [frame.misfit(maps + sign * step * direction, chances) for sign in (1, -1)]
    torch.testing.assert_close((ends[0] - ends[1]) / (2 * step), (slopes * direction).sum((1, 2)), rtol=0.02, atol=0.05)


def test_a_tip_nobody_sees_is_moved_into_the_frame(fern):
    code, image = fern
    stem = int(code.linear.det().abs().argmin())
    maps = affine.from_code(code)
    maps[stem, 5] += 0.02  # more than a pixel, of a tip that few points visit
    frame = Frame.of(image)
    picture = Picture(image, LEVELS["density"]).within(frame)
    start = picture.judge(maps)
    found = polished(picture, start, 8, patience=2)
    before, after = (float(frame.misfit(d.maps, d.chances).abs().max()) for d in (start, found))
    assert before > 1 and after < 0.5 * before


def test_a_line_is_turned_by_its_drawing(fern):
    code, image = fern
    maps, stem = affine.from_code(code), int(code.linear.det().abs().argmin())
    measure = binned(LEVELS["density"].measure(image), 64)
    thin = [affine.thinness(each, measure) for each in maps]
    assert thin[stem] < THIN < min(thin[:stem] + thin[stem + 1:])
    wrong = maps.clone()
    wrong[stem] = turned(maps[stem], measure, 1, torch.Generator().manual_seed(4))[0]
    search = PictureSearch(Picture(image, LEVELS["density"]), LEVELS["density"].measure(image), noise=0.1)
    shown = search.picture.judge(wrong)
    search._small = lambda shown, g, count=1: [stem]
    found = search._turned(shown, torch.Generator().manual_seed(0))
    assert found.error < shown.error


def test_with_little_memory_maps_are_polished_in_turn(triangle):
    code, image = triangle
    picture = Picture(image, LEVELS["density"], maps_at_once=1)
    start = picture.judge(displaced(code))
    assert polished(picture, start, 6).error < 0.6 * start.error


def test_memory_bounds_what_is_searched_and_polished():
    free, tight = MemoryBudget(None, 1024, 16), MemoryBudget(0.26, 1024, 16)
    assert free.size(512) == 512 and free.maps_at_once(512) > 1000
    assert 1 <= tight.maps_at_once(1024) < 20
    assert MemoryBudget(0.2, 512, 16).size(512) == 256
    with pytest.raises(InputError, match=r"takes at least 0\.\d+ GiB, got memory_gib=0.05"):
        MemoryBudget(0.05, 512, 16)
    with pytest.raises(InputError, match="memory_gib must be above 0"):
        Collage(memory_gib=0)


def test_too_little_memory_is_refused_before_any_work(triangle):
    with pytest.raises(InputError, match="memory_gib=0.01; allow that much"):
        Collage(memory_gib=0.01).check(triangle[1])


def test_a_search_within_a_memory_budget_finds_the_code(triangle):
    code, image = triangle
    method = Collage(islands=1, moves=10, rounds=1, detail_moves=2, picture_moves=2, memory_gib=0.2, previews=0)
    found = method.reconstruct(image).code
    assert len(found) == 3


def test_the_last_polish_leaves_a_true_code_where_it_is(fern):
    code, image = fern
    true = affine.from_code(code)
    search = PictureSearch(Picture(image, LEVELS["density"]), LEVELS["density"].measure(image), noise=0.1)
    found = search.finish(search._tiling(search.picture.judge(true)))
    away = affine.distances(found.maps, true, binned(LEVELS["density"].measure(image), 64)).diagonal() * 64
    assert float(away.max()) < 0.1  # pixels of 128


def test_a_resumed_search_knows_weights_of_its_own_as_the_live_one_does(fern):
    code, image = fern
    maps = affine.from_code(code)
    picture = Picture(image, LEVELS["density"])
    search = PictureSearch(picture, LEVELS["density"].measure(image), noise=0.1)
    fewer = picture.without(picture.judge(maps, torch.tensor([0.1, 0.5, 0.2, 0.2])), [3])
    now = search._tiling(fewer)
    shown = search._shown
    for number in range(6):
        search._shown = shown
        again = PictureSearch(picture, search.masses, noise=0.1)
        live = search.step(now, number)
        resumed = again.step(Tiling(now.maps, now.weights, now.error, now.score), number)
        assert torch.equal(live.maps, resumed.maps) and torch.equal(live.weights, resumed.weights)


def test_a_polished_code_loses_what_neither_picture_nor_frame_asks_for(triangle):
    maps = torch.cat([affine.from_code(triangle[0]), torch.tensor([[0.01, 0, 0, 0.01, 0.2, 1.2]])])
    maps = affine.from_code(attractor.normalize(affine.to_code(maps)))  # the last map is a tip that decides the box
    picture = Picture(suite.target(affine.to_code(maps), 128), LEVELS["density"])
    drawn = picture.judge(maps)
    price = 1.5 * (picture.without(drawn, [3]).error - drawn.error)
    blind = without_superfluous(picture, drawn, price, 3, near=False)
    assert torch.equal(blind.maps, maps[:3]) and blind.error == picture.judge(maps[:3]).error
    assert without_superfluous(picture, drawn, price, 3, near=True) is drawn
    assert without_superfluous(picture, drawn, price, 4, near=False) is drawn  # as many as there must be
