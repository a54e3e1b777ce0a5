"""Pictures that show a part of a shape: what lies beyond is unknown, not empty."""

from __future__ import annotations

import copy
from dataclasses import replace

import pytest
import torch
from collage_helpers import CAMERA, DENSITY, PARAMS

from fractal_exp import codes
from fractal_exp.cameras.comparison import Comparison
from fractal_exp.cameras.kinds import levels_of, with_camera
from fractal_exp.cameras.points import trajectories
from fractal_exp.errors import InputError
from fractal_exp.evaluation.metrics import f1_1px
from fractal_exp.ifs import affine, attractor
from fractal_exp.images.known import Known
from fractal_exp.images.levels import DRAWN, TargetImage
from fractal_exp.likeness import Likeness, redrawn
from fractal_exp.methods.collage.bins import binned
from fractal_exp.methods.collage.image.camera import polish_under
from fractal_exp.methods.collage.image.counts import FromCounts
from fractal_exp.methods.collage.image.objective import Frame, ImageObjective
from fractal_exp.methods.collage.measure.search import MeasureSearch, Regime
from fractal_exp.methods.collage.measure.windows import WindowSearch, completed, search_on, seen
from fractal_exp.methods.collage.moves.tools import CorrectedMeasure
from fractal_exp.methods.collage.state import Candidate, WeightedMaps
from fractal_exp.ops.collage import BinnedMeasure, Descent, collage_error, descend, orbit_bins, pushforward
from fractal_exp.runtime.deadline import NO_DEADLINE

SIDE = 128
GASKET = attractor.normalize(codes.known("sierpinski_triangle"))
MAPS, WEIGHTS = affine.from_code(GASKET), GASKET.sampling_probabilities()
CUT = Known(left=-1.0, bottom=-1.0, right=0.3, top=1.0)   # a third of the triangle lies beyond
MASK = CUT.mask(SIDE)
WHOLE = DENSITY.render(GASKET, SIDE, 0)
IMAGE = WHOLE * MASK
MASSES = DENSITY.measure(IMAGE)
HALVES = torch.stack([torch.full((32, 32), 0.0), torch.full((32, 32), 1.0)])


def counted(side: int) -> torch.Tensor:
    """The numbers of points of the gasket in the pixels of an image, over the largest."""
    counts, = orbit_bins(MAPS[None], WEIGHTS, side, seed=0, **trajectories(20 * side**2))
    return counts / counts.max()


def cells(known: torch.Tensor | None) -> BinnedMeasure:
    """The gasket's measure on 32² cells, of which only some are known."""
    measure = binned(DENSITY.measure(WHOLE), 32)
    return measure if known is None else replace(measure, bins=measure.bins * known, known=known)


def test_a_mask_holds_the_pixels_that_lie_in_the_box_with_all_that_they_cover():
    mask = Known(left=-1.0, bottom=-0.5, right=0.3, top=1.0).mask(8)
    assert mask[:6, :5].all() and mask.sum() == 30   # 0.3 lies within the sixth column
    points = torch.tensor([[0.2, 0.0], [0.4, 0.0], [0.2, -0.6], [-5.0, 0.0], [0.0, -5.0]])
    assert CUT.holds(points, 8).tolist() == [True, False, True, True, True]   # open on all sides but one
    assert Known(-1.0, -0.5, 0.3, 1.0).holds(points, 8).tolist() == [True, False, False, True, False]


@pytest.mark.parametrize("backend", ["torch", "cpu"])
def test_cells_that_are_not_known_do_not_count(backend):
    known = torch.ones(32, 32)
    known[:, 20:] = 0
    measure, how = cells(known), Descent(20, prior=0.0)
    start, weights = (MAPS + 0.05)[None], WEIGHTS[None]
    moved, shares, errors = descend(start, weights, measure, how, backend=backend)
    bins = pushforward(moved, shares, measure.samples, 32)
    assert errors == pytest.approx(collage_error(bins, measure), rel=1e-3)
    spoilt = bins.clone()
    spoilt[:, :, 20:] += 1.0
    assert torch.equal(collage_error(spoilt, measure), collage_error(bins, measure))
    behind = torch.zeros(1, 32, 32)
    behind[:, :, 20:] = 1.0   # mass where nothing is known changes neither errors nor maps
    again = descend(start, weights, measure, how, backgrounds=behind, backend=backend)
    assert all(map(torch.equal, again, (moved, shares, errors)))


def test_both_backends_leave_out_the_same_cells():
    known = (torch.rand(32, 32, generator=torch.Generator().manual_seed(0)) < 0.7).float()
    found = [descend((MAPS + 0.05)[None], WEIGHTS[None], cells(known), Descent(5), backend=name)
             for name in ("torch", "cpu")]
    assert all(torch.allclose(a, b, atol=1e-4) for a, b in zip(*found, strict=True))


def test_if_all_cells_are_known_nothing_changes():
    found = [descend((MAPS + 0.05)[None], WEIGHTS[None], cells(known), Descent(20)) for known in (None, HALVES[1])]
    assert torch.equal(found[0][2], found[1][2]) and torch.allclose(found[0][0], found[1][0], atol=1e-6)
    with pytest.raises(InputError, match="known must have the shape of the bins"):
        replace(cells(None), known=torch.ones(16, 16))
    for wrong in (1.5, -0.1, float("nan")):
        with pytest.raises(InputError, match="known must hold shares from 0 to 1"):
            replace(cells(None), known=torch.full((32, 32), wrong))


def test_a_whole_picture_is_searched_as_before():
    masses = DENSITY.measure(WHOLE)
    assert type(search_on(masses, None, Regime.whole(PARAMS), PARAMS, 0)) is MeasureSearch
    assert torch.equal(seen(masses, 64, None).bins, binned(masses, 64).bins)
    whole = binned(masses, 64)
    assert completed([whole], WeightedMaps(MAPS, WEIGHTS), SIDE, None, 0) == [whole]


def test_a_code_continues_the_measure_beyond_the_picture():
    grids = [seen(MASSES, cells, CUT) for cells in (64, 32)]
    hidden = DENSITY.measure(WHOLE * ~MASK).sum() / MASSES.sum()
    for grid, whole in zip(grids, completed(grids, WeightedMaps(MAPS, WEIGHTS), SIDE, CUT, 0), strict=True):
        more = whole.samples[len(grid.samples):]
        assert torch.equal(whole.samples[:len(grid.samples)], grid.samples)
        assert (more[:, 0] > 0.3 - 2 / SIDE).all()
        assert float(more[:, 2].sum()) == pytest.approx(float(hidden), rel=0.05)


def test_the_true_code_agrees_with_the_measure_that_it_completes():
    def error(measure: BinnedMeasure) -> float:
        return float(collage_error(pushforward(MAPS[None], WEIGHTS[None], measure.samples, measure.size), measure)[0])

    cut = seen(MASSES, 64, CUT)
    whole, = completed([cut], WeightedMaps(MAPS, WEIGHTS), SIDE, CUT, 0)
    as_if_all = binned(MASSES, 64)
    assert error(whole) < 0.1 * error(cut) and error(whole) < 0.05 * error(as_if_all)


def test_a_map_cannot_hide_its_image_beyond_the_picture():
    whole, = completed([seen(MASSES, 64, CUT)], WeightedMaps(MAPS, WEIGHTS), SIDE, CUT, 0)
    hidden = torch.tensor([[0.1, 0, 0, 0.1, 0.8, 0.0]])   # beyond the right edge of what is known
    maps, weights = torch.cat([MAPS, hidden])[None], torch.cat([WEIGHTS, torch.tensor([0.3])])[None]
    without, within = (collage_error(pushforward(maps[:, :n], weights[:, :n], whole.samples, 64), whole).item()
                       for n in (3, 4))
    assert within > 3 * without


def test_what_reaches_beyond_the_canvas_is_where_the_code_has_it():
    code = GASKET.similar(1.6, (0.6, 0.0))   # a part of it lies off the canvas
    masses = DENSITY.measure(DENSITY.render(code, SIDE, 0) * MASK)
    found = WeightedMaps(affine.from_code(code), WEIGHTS)
    whole, = completed([seen(masses, 64, CUT)], found, SIDE, CUT, 0)
    assert (whole.samples[:, :2].abs() > 1).any()
    bins = pushforward(found.maps[None], WEIGHTS[None], whole.samples, 64)
    assert whole.known is not None and 0 < whole.known.min() < 1
    assert float(bins[0][whole.known < 1].sum()) == pytest.approx(float(whole.bins[whole.known < 1].sum()), rel=0.05)


def test_the_search_prefers_the_true_code_to_one_that_patches_what_is_seen():
    search = search_on(MASSES, CUT, Regime.whole(PARAMS), PARAMS, 0)
    assert isinstance(search, WindowSearch)
    scale = 1 - search.params.search.slack
    true = search.judged(MAPS, scale * WEIGHTS, 0.0)
    patch = affine.composed(MAPS[int(MAPS[:, 4].argmax())], MAPS[int(MAPS[:, 4].argmin())])   # a half of the right copy
    maps = torch.cat([MAPS[MAPS[:, 4] < MAPS[:, 4].max()], patch[None]])
    patched = search.judged(maps, scale * torch.tensor([0.4, 0.4, 0.2]), 0.0)
    assert true.score < 0.5 * patched.score


def test_a_short_search_finds_the_maps_of_a_gasket_that_is_cut_off():
    search = search_on(MASSES, CUT, Regime.whole(PARAMS), PARAMS, 1)
    found: Candidate = search.start()
    for number in range(40):
        found = search.step(found, number)
    drawn = (DENSITY.render(found.code, SIDE, 0) > 0).float()
    assert float(f1_1px(drawn[None], (WHOLE > 0).float()[None])) > 0.93   # what takes the rest for empty has .85


def test_only_known_pixels_are_compared():
    levels = levels_of(IMAGE, "density", CAMERA, CUT)
    judge, spoilt = Comparison(IMAGE, levels), WHOLE.clone()
    spoilt[~MASK] = 1.0
    assert judge.error(spoilt) == judge.error(WHOLE) == judge.error(IMAGE) == 0
    assert judge.error(judge.render(GASKET)) < 1.3 * judge.noise(GASKET)
    assert (judge.render(GASKET)[~MASK] == 0).all() and Comparison(IMAGE, DENSITY).error(WHOLE) > 1
    assert with_camera(levels, levels.camera).known == CUT == levels.adjusted({}).known == copy.copy(levels).known


def test_the_true_code_of_a_part_is_like_it_and_is_drawn_whole():
    target = TargetImage(IMAGE, levels="density", known=CUT)
    likeness = Likeness.of(GASKET, target)
    assert likeness.noise_ratio < 1.2 and likeness.f1_1px > 0.99
    assert Likeness.of(GASKET, replace(target, known=None)).f1_1px < 0.9
    drawn = redrawn(GASKET, target, levels_of(IMAGE, "density", CAMERA, CUT).camera)
    assert (drawn[~MASK] > 0).any()


def test_a_part_has_no_frame_and_its_corrected_measure_goes_on_beyond_it():
    levels = levels_of(IMAGE, "density", CAMERA, CUT)
    assert Frame.of(WHOLE, DENSITY, PARAMS.frame) is not None and Frame.of(IMAGE, levels, PARAMS.frame) is None
    objective = ImageObjective(IMAGE, levels, PARAMS)
    measure = CorrectedMeasure.of(MASSES, WeightedMaps(MAPS, WEIGHTS), objective, 0)
    assert float(measure.fine.samples[:, 2].sum()) > 1.2 and measure.fine.known is not None


@pytest.mark.parametrize("side", [64, 640])
def test_counts_have_no_derivatives_where_nothing_is_known(side):
    """The second image is larger than the finest grid on which errors are computed."""
    image = counted(side) * CUT.mask(side)
    objective = ImageObjective(image, levels_of(image, "linear", CAMERA, CUT), PARAMS)
    shown = objective.judge(MAPS, WEIGHTS)
    _, rows = next(iter(FromCounts(objective, shown, [0], 0).grids(objective, shown)))
    mask = CUT.mask(objective.side).flatten()
    assert rows[mask].abs().max() > 0 == rows[~mask].abs().max()


def test_a_camera_that_is_polished_knows_what_is_not_seen():
    drawn = IMAGE.clamp(0, 1)
    objective = ImageObjective(drawn, levels_of(drawn, DRAWN, CAMERA, CUT), PARAMS)
    fits = polish_under(objective, objective.judge(MAPS, WEIGHTS), "coverage", NO_DEADLINE)
    assert fits and all(seen.levels.known == CUT for seen, _ in fits)
