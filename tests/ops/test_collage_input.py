"""What the operations of collage search refuse, in one line, before a kernel reads beyond an array."""

import numpy as np
import pytest
import torch
from ops_helpers import tiling_problem

from fractal_exp import InputError
from fractal_exp.ops.collage import Descent, descend, pushforward
from fractal_exp.ops.collage.reference import Settings

MEASURE, MAPS, WEIGHTS = tiling_problem()
GRID = torch.zeros(2, 32, 32)


@pytest.mark.parametrize("change, message", [
    (dict(chosen=torch.tensor([0, 1, 2, 0])), "chosen must hold numbers from 0 to 1, .* got 0 to 2"),
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


def test_kernels_get_numbers_of_one_type_whichever_a_user_gives():
    """Or they would be compiled anew for each."""
    given = Settings(**vars(Descent(np.int32(3), rate=1, decay=0, identity_radius=1, prior=np.float32(0.5))))
    assert [type(number) for number in given] == [int, *[float] * 8, bool, *[float] * 3]
    assert given == (3, 1, 0.05, 0, 0.995, 1, 0.5, 1, 0.3, False, 0.9, 0.98, 1e-7)


@pytest.mark.parametrize("absent", [float("nan"), float("inf")])
def test_the_numbers_of_an_absent_map_do_not_matter(absent):
    maps, weights = MAPS.clone(), WEIGHTS.clone()
    weights[:, 0] = 0.0
    expected = pushforward(maps, weights, MEASURE.samples, 32)
    maps[:, 0] = absent
    for backend in ("torch", "cpu"):
        assert torch.allclose(pushforward(maps, weights, MEASURE.samples, 32, backend=backend), expected, atol=1e-6)
