"""The metrics against scikit-image and scikit-learn, and their conventions."""

import pytest
import torch
from skimage.metrics import peak_signal_noise_ratio, structural_similarity
from sklearn.metrics import f1_score, jaccard_score

from fractal_exp.errors import InputError
from fractal_exp.evaluation import metrics


def images(count: int = 4, size: int = 40, seed: int = 0) -> tuple[torch.Tensor, torch.Tensor]:
    """Sparse grey images, as renderings are, that agree in part."""
    g = torch.Generator().manual_seed(seed)
    a = torch.rand(count, size, size, generator=g) * (torch.rand(count, size, size, generator=g) < 0.4)
    b = torch.where(torch.rand(count, size, size, generator=g) < 0.7, a, a.flip(1))
    return a, b


def test_f1_and_iou_are_those_of_scikit_learn():
    a, b = images()
    for one, other, f1, iou in zip(a, b, metrics.f1(a, b), metrics.iou(a, b), strict=True):
        one, other = (one > 0).flatten().numpy(), (other > 0).flatten().numpy()
        assert float(f1) == pytest.approx(f1_score(other, one), abs=1e-6)
        assert float(iou) == pytest.approx(jaccard_score(other, one), abs=1e-6)


def test_psnr_and_ssim_are_those_of_scikit_image():
    a, b = images()
    for one, other, psnr, ssim in zip(a.double().numpy(), b.double().numpy(), metrics.psnr(a, b), metrics.ssim(a, b),
                                      strict=True):
        assert float(psnr) == pytest.approx(peak_signal_noise_ratio(other, one, data_range=1), abs=1e-4)
        expected = structural_similarity(other, one, data_range=1, gaussian_weights=True, sigma=1.5,
                                         use_sample_covariance=False)
        assert float(ssim) == pytest.approx(expected, abs=1e-6)


def test_compare_looks_at_the_inner_part_only():
    a, b = images(size=64)
    scores, (a2, b2) = metrics.compare(a, b), (a.clone(), b.clone())
    a2[:, :8], b2[:, :, 56:] = 1, 0.5
    for name, values in metrics.compare(a2, b2).items():
        assert torch.equal(values, scores[name]), name
    assert {name: values.shape for name, values in scores.items()} == dict.fromkeys(("f1", "iou", "psnr", "ssim"), (4,))


@pytest.mark.parametrize(("a", "b", "message"), [
    (torch.zeros(1, 16, 16), torch.zeros(1, 32, 32), r"\(1, 16, 16\) and \(1, 32, 32\)"),
    (torch.zeros(16, 16), torch.zeros(16, 16), r"shape \(B, H, W\)"),
    (torch.zeros(1, 12, 12), torch.zeros(1, 12, 12), "13 px"),
    (torch.full((1, 32, 32), float("nan")), torch.zeros(1, 32, 32), "NaN"),
    (torch.zeros(1, 32, 32), torch.full((1, 32, 32), 255.0), r"truth to compare must lie in \[0, 1\].*; divide it by"),
    (torch.full((1, 32, 32), -1.0), torch.zeros(1, 32, 32), r"; of numbers in \[-1, 1\], take \(x \+ 1\) / 2"),
])
def test_images_that_cannot_be_compared(a, b, message):
    with pytest.raises(InputError, match=message):
        metrics.compare(a, b)


def test_the_window_of_ssim_fits_into_every_image_that_is_not_too_small():
    for side in range(13, 34):
        image = torch.rand(1, side, side)
        assert float(metrics.compare(image, image)["ssim"]) == pytest.approx(1), side


def test_f1_within_a_pixel_forgives_a_pixel():
    truth = torch.zeros(1, 32, 32)
    truth[0, 10, 5:25] = 0.3
    assert float(metrics.f1_1px(truth, truth)) == 1
    assert float(metrics.f1_1px(truth.roll(1, 1), truth)) == 1 and float(metrics.f1(truth.roll(1, 1), truth)) == 0
    assert float(metrics.f1_1px(truth.roll(2, 1), truth)) == 0
    half = truth.clone()
    half[0, :, 15:] = 0  # ten of twenty pixels, which reach an eleventh
    assert float(metrics.f1_1px(half, truth)) == pytest.approx(2 * (11 / 20) / (1 + 11 / 20))
    assert float(metrics.f1_1px(0 * truth, 0 * truth)) == 1 and float(metrics.f1_1px(0 * truth, truth)) == 0
