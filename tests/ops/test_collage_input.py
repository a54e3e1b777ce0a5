"""What the operations of collage search refuse, in one line, before a kernel reads beyond an array."""

import numpy as np
import pytest
import torch
from ops_helpers import tiling_problem

from fractal_exp import InputError
from fractal_exp.ops.collage import BinnedMeasure, Descent, collage_error, descend, pushforward
from fractal_exp.ops.collage.reference import Settings

MEASURE, MAPS, WEIGHTS = tiling_problem()
GRID = torch.zeros(2, 32, 32)


@pytest.mark.parametrize("change, message", [
    (dict(chosen=torch.tensor([0, 1, 2, 0])), "chosen must hold numbers from 0 to 1, .* got 0 to 2"),
    (dict(chosen=torch.tensor([0, -1, 0, 0])), "chosen must hold numbers from 0 to 1, .* got -1 to 0"),
    (dict(chosen=torch.zeros(4)), "chosen must be int64"),
    (dict(chosen=torch.zeros(3, dtype=torch.int64)), "and chosen"),
    (dict(backgrounds=torch.zeros(0, 32, 32)), "backgrounds must not be empty"),
    (dict(backgrounds=torch.zeros(2, 16, 16)), r"backgrounds must have shape \(C, 32, 32\)"),
    (dict(backgrounds=GRID.double()), "backgrounds and maps must agree in dtype"),
    (dict(backgrounds=GRID.to_sparse()), "backgrounds must be a dense tensor"),
    (dict(maps=MAPS.to("meta")), "maps must hold numbers, got a tensor on the meta device"),
    (dict(weights=WEIGHTS.double()), "weights and maps must agree in dtype"),
    (dict(measure=GRID), "measure must be a BinnedMeasure"),
    (dict(how=3), "how must be a Descent"),
])
def test_a_descent_refuses_what_it_cannot_use(change, message):
    arguments = dict(maps=MAPS, weights=WEIGHTS, measure=MEASURE, how=Descent(1), backgrounds=GRID,
                     chosen=torch.tensor([0, 1, 1, 0])) | change
    with pytest.raises(InputError, match=message) as caught:
        descend(**arguments)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("size", [0, 1, -3, True, 2.0, 40_000, 10**400])
def test_a_grid_has_two_cells_a_side_at_least_and_a_bounded_number(size):
    with pytest.raises(InputError, match="size must be an integer of at"):
        pushforward(MAPS, WEIGHTS, MEASURE.samples, size)


@pytest.mark.parametrize("samples", [torch.zeros(5, 2), torch.zeros(3), torch.zeros(0, 3), torch.zeros(5, 3).double()])
def test_samples_are_rows_of_three(samples):
    with pytest.raises(InputError, match="samples"):
        pushforward(MAPS, WEIGHTS, samples, 8)


def test_bins_of_an_error_have_the_measures_shape():
    with pytest.raises(InputError, match=r"bins must have shape \(B, 32, 32\)"):
        collage_error(torch.zeros(2, 16, 16), MEASURE)


@pytest.mark.parametrize("bins, grids", [(torch.zeros(1, 1), 1), (torch.zeros(8, 8), 10**9), (torch.zeros(8), 1)])
def test_a_measure_has_a_grid_that_can_be_halved(bins, grids):
    with pytest.raises(InputError, match="bins must be square|size must be an integer"):
        BinnedMeasure(MEASURE.samples, bins, grids)


@pytest.mark.parametrize("floor", [0, -1, float("nan"), "1"])
def test_the_floor_of_a_measure_is_a_positive_number(floor):
    with pytest.raises(InputError, match="floor must be a finite number from 1e-12 on, got"):
        BinnedMeasure(MEASURE.samples, MEASURE.bins, floor=floor)


@pytest.mark.parametrize("change", [dict(steps=-1), dict(tied=-10**30), dict(steps=True), dict(steps=10**9),
                                    dict(rate=float("nan")), dict(identity_radius=0), dict(largest=-1),
                                    dict(decay="1"), dict(beta_1=1), dict(beta_2=-0.1), dict(epsilon=0)])
def test_a_descent_is_described_by_finite_numbers(change):
    with pytest.raises(InputError):
        Descent(**{"steps": 1} | change)


def test_kernels_get_numbers_of_one_type_whichever_a_user_gives():
    """Or they would be compiled anew for each."""
    given = Settings(**vars(Descent(np.int32(3), rate=1, decay=0, identity_radius=1, prior=np.float32(0.5))))
    assert [type(number) for number in given] == [int, *[float] * 8, bool, *[float] * 3]
    assert given == (3, 1, 0.05, 0, 0.995, 1, 0.5, 1, 0.3, False, 0.9, 0.98, 1e-7)
