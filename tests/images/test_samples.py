"""The sample pictures."""

import numpy as np
import pytest
import torch
from skimage import measure

from fractal_exp import InputError
from fractal_exp.images.samples import retina_vessels, snowflake


def test_retina_vessels_are_a_clean_tree():
    image = retina_vessels(256)
    assert image.shape == (256, 256) and image.dtype == torch.float32
    assert image.min() == 0 and image.max() == 1 and 0.03 < float(image.mean()) < 0.07
    lit = image.numpy() > 0
    rows, columns = np.flatnonzero(lit.any(1)), np.flatnonzero(lit.any(0))
    assert max(np.ptp(rows), np.ptp(columns)) + 1 == 192
    labels, count = measure.label(lit, return_num=True)
    sizes = np.bincount(labels.ravel())[1:]
    assert count <= 4 and sizes.max() > 0.9 * lit.sum()


def test_the_snowflake_has_six_arms_alike():
    image = snowflake(128)
    assert image.shape == (128, 128) and 0.03 < float(image.mean()) < 0.5
    mirrored = [float((image - other).abs().sum() / image.sum()) for other in (image.flip(0), image.flip(1))]
    assert max(mirrored) < 0.2
    with pytest.raises(InputError, match="resolution must be a whole number"):
        snowflake(8)
