"""How far maps may stretch in a search: as far as the codes of the field, if the whole contracts."""

import pytest
import torch
from collage_helpers import PARAMS

from fractal_exp import IFS, codes, invert, suite
from fractal_exp.cameras.kinds import levels_of
from fractal_exp.ifs import affine, attractor
from fractal_exp.methods.collage.image.jacobian import FromPoints
from fractal_exp.methods.collage.image.objective import Frame, ImageObjective
from fractal_exp.methods.collage.limits import LARGEST, SMALLER, largest_for, limited
from fractal_exp.methods.collage.measure.search import MeasureSearch, Regime

# The last map stretches by 1.14; in an ellipse, none does.
STRETCHING = IFS([[[0.2, 0.1], [-0.2, 0.3]], [[-0.2, -0.7], [-0.7, 0.1]], [[0.8, -0.7], [0.8, -0.1]]],
                 [[0.1, 0.0], [0.2, -0.2], [0.0, 0.0]])


def maps_of(*matrices):
    return torch.tensor([[*matrix, 0.1 * i, -0.1 * i] for i, matrix in enumerate(matrices)])


class Pooled(MeasureSearch):
    """A search whose mixture is the pool itself."""

    def mixture_of(self, pool, *_):
        return pool


def test_no_map_stretches_in_the_random_sets_of_a_start():
    search = Pooled(suite.target(codes.known("gosper_island"), 48), Regime.whole(PARAMS), PARAMS)
    pool = search.start()
    assert search.largest == LARGEST and float(affine.largest_singular(pool).max()) <= SMALLER + 1e-4


def test_maps_that_contract_in_any_way_stay():
    plain, stretching = maps_of((0.5, 0, 0, 0.5), (0.9, 0.1, 0, 0.3)), affine.from_code(STRETCHING)
    on_average = maps_of((1.3, 0, 0, 1 / 1.4), (0, 0.4, 0.4, 0))
    for maps, kind in ((plain, "norm"), (stretching, "norm"), (on_average, "average")):
        weights = torch.ones(len(maps)) / len(maps)
        assert affine.to_code(maps, weights).contraction.kind == kind
        torch.testing.assert_close(limited(maps, weights), maps, rtol=0, atol=1e-6)


def test_what_would_not_contract_at_all_is_brought_below_one_and_a_stretch_ends_somewhere():
    away = maps_of((1.2, 0, 0, 0.9), (1.1, 0, 0, 0.95))
    assert affine.to_code(away).contraction.kind == "neither"
    held = limited(away)
    assert float(affine.largest_singular(held).max()) == pytest.approx(SMALLER, abs=1e-6)
    assert affine.to_code(held).contraction.kind == "norm"
    far = limited(maps_of((3, 0, 0, 0.1), (0.1, 0, 0, 0.1)), torch.tensor([0.1, 0.9]))
    assert float(affine.largest_singular(far).max()) == pytest.approx(LARGEST, abs=1e-5)


def test_probabilities_decide_what_contracts_on_average():
    maps = maps_of((1.5, 0, 0, 0.9), (0.2, 0, 0, 0.2))
    torch.testing.assert_close(limited(maps, torch.tensor([0.1, 0.9])), maps, rtol=0, atol=1e-6)
    assert float(affine.largest_singular(limited(maps, torch.tensor([0.99, 0.01]))).max()) < 1


def test_what_a_search_judges_can_be_drawn():
    image, away = suite.target(attractor.normalize(STRETCHING), 64), maps_of((1.2, 0, 0, 0.9), (1.1, 0, 0, 0.95))
    objective = ImageObjective(image, levels_of(image, "density", PARAMS.camera), PARAMS)
    search = MeasureSearch(image, Regime.whole(PARAMS), PARAMS)
    weights = torch.tensor([0.5, 0.5])
    for judged in (objective.judge(away, weights), search.judged(away, weights, 0.0)):
        judged.code.check_contractive()
        assert judged.error > 1e-3


def test_the_frame_of_a_code_that_contracts_on_average_is_that_of_what_is_seen():
    maps, weights = maps_of((1.3, 0, 0, 1 / 1.4), (0, 0.4, 0.4, 0)), torch.tensor([0.5, 0.5])
    frame = Frame(64)
    assert affine.to_code(maps, weights).contraction.kind == "average"
    assert bool(torch.isfinite(frame.misfit(maps, weights)).all())
    assert frame.jacobian(maps, weights).shape == (3, 2, 6)


@pytest.mark.slow
def test_a_code_with_maps_that_stretch_is_found_again():
    code = attractor.normalize(STRETCHING)
    assert float(affine.largest_singular(affine.from_code(code)).max()) > 1.1
    found = invert(suite.target(code, 128), resolution=128)
    assert found.verdict.kind == "recovered" and len(found.code) == 3


def test_nothing_stretches_where_a_shape_lies_on_a_line():
    wide, thin = torch.diag(torch.tensor([1.0, 0.02])), torch.diag(torch.tensor([1.0, 0.005]))
    assert (largest_for(wide), largest_for(thin)) == (LARGEST, SMALLER)
    bars = torch.zeros(64, 64)
    bars[31:33, 4:60:4] = 1
    turned = ImageObjective(bars.T, levels_of(bars, "coverage", PARAMS.camera), PARAMS)
    assert turned.largest == SMALLER == MeasureSearch(bars, Regime.whole(PARAMS), PARAMS).largest
    shear = maps_of((0.3, 1.2, 0, 0.3), (0.3, 0, 0, 0.3))
    assert float(affine.largest_singular(turned.judge(shear).maps).max()) <= SMALLER + 1e-6


def test_a_step_of_gauss_and_newton_keeps_the_limits():
    image, maps = suite.target(attractor.normalize(STRETCHING), 64), affine.from_code(attractor.normalize(STRETCHING))
    objective = ImageObjective(image, levels_of(image, "density", PARAMS.camera), PARAMS)
    jacobian = FromPoints(objective, objective.judge(maps), range(len(maps)), 0)
    moved = jacobian.nudged(0, 1e3)
    assert float(affine.largest_singular(jacobian.nudged(0, 1.0)).max()) > 1
    assert float(affine.largest_singular(moved).max()) <= LARGEST + 1e-5
    affine.to_code(moved).check_contractive()
