"""What the tests of the CUDA kernels share, in the simulator and on a GPU: both passes beside the float64 twin's."""

from __future__ import annotations

import math

import numpy as np
import torch
from ops_helpers import assert_close, random_code
from scipy import stats
from torch import Tensor

from fractal_exp import View, codes
from fractal_exp.ifs import attractor
from fractal_exp.ops import chaos_game, histogram, splat
from fractal_exp.ops.cuda_launch import DEVICE
from fractal_exp.ops.histogram import cuda as cuda_histogram
from fractal_exp.ops.histogram.cpu import COUNTED
from fractal_exp.rendering.weighing import address_tree, window_of


def play(backend: str, dtype: torch.dtype, code: tuple[Tensor, Tensor], game: dict) -> tuple[Tensor, ...]:
    """Points and the gradients of linear and offset under a random cotangent."""
    linear, offset = (t.detach().to(DEVICE, dtype).requires_grad_() for t in code)
    points = chaos_game(linear, offset, **game, backend=backend)
    cotangent = torch.randn(points.shape, generator=torch.Generator().manual_seed(1)).to(points)
    return (points.detach(), *torch.autograd.grad(points, (linear, offset), cotangent))


def check_chaos_game(batch: tuple[int, ...], maps: int, game: dict) -> None:
    code = random_code(*batch, maps=maps)
    results = [play(*kind, code, game) for kind in (("cuda", torch.float32), ("torch", torch.float64))]
    for name, got, expected in zip(("points", "linear's gradient", "offset's gradient"), *results, strict=True):
        assert_close(got, expected, name)


def check_numbers(maps: int, given: bool, trajectories: int, length: int) -> None:
    """The kernel draws exactly the twin's numbers: starts, and the maps that constant maps tell."""
    p = torch.rand(2, maps, generator=torch.Generator().manual_seed(0)) ** 4 if given else None
    p = (p / p.sum(-1, keepdim=True)).to(DEVICE) if given else None
    number = torch.arange(float(maps))[:, None].expand(2, maps, 2).to(DEVICE)
    still = torch.eye(2).expand(2, 1, 2, 2).to(DEVICE), torch.zeros(2, 1, 2, device=DEVICE)
    for seed in (0, -7, torch.tensor([1, 2**63 - 1])):
        game = dict(trajectories=trajectories, length=length, warmup=0, seed=seed)
        for name, code, probabilities in (("starts", still, None),
                                          ("indices", (torch.zeros(2, maps, 2, 2, device=DEVICE), number), p)):
            drawn, expected = (chaos_game(*code, probabilities=probabilities, **game, backend=backend)
                               for backend in ("cuda", "torch"))
            assert torch.equal(drawn, expected), name


def draw(backend: str, dtype: torch.dtype, points: Tensor, resolution: int, options: dict) -> tuple[Tensor, Tensor]:
    """The image and the gradient of the points under a random cotangent."""
    points = points.to(DEVICE, dtype, copy=True).requires_grad_()
    image = splat(points, resolution, **options, backend=backend)
    cotangent = torch.randn(image.shape, generator=torch.Generator().manual_seed(1)).to(image)
    return image.detach(), *torch.autograd.grad(image, points, cotangent)


def check_splat(points: Tensor, resolution: int, supersample: int, sigma_px: float, factor: float = 10) -> None:
    """Tolerances are those of the CPU's kernel, for its reasons (`test_splat`), unless the gradient's is given."""
    options = {"supersample": supersample, "sigma_px": sigma_px}
    (image, gradient), (true_image, true_gradient) = (
        draw(*kind, points, resolution, options) for kind in (("cuda", torch.float32), ("torch", torch.float64)))
    assert_close(image, true_image, "image", factor=2)
    assert_close(gradient + 1e-12, true_gradient + 1e-12, "gradient", factor=factor)
    with torch.no_grad():
        again = splat(points.to(DEVICE), resolution, **options, backend="cuda")
    assert torch.equal(image, again), "an image is another one where no gradient is wanted"


def check_histogram(view: View, bins: int, thrown: float) -> None:
    """A chi-squared test of one canvas against 64 of the CPU's sampler, whose own tests compare it with rejection."""
    code = attractor.normalize(codes.known("fern"))
    tree, window = address_tree(code), window_of(view, bins)
    canvas, kept = cuda_histogram.scatter(tree, window, thrown, seed=(1,), mode=COUNTED, device=DEVICE)
    assert int(canvas.sum()) == kept, "all points that are counted as kept, and no others, lie on the canvas"
    many = histogram.planes(bins, bins, COUNTED)
    for seed in range(64):
        tree.scatter(window, thrown, seed=(seed,), canvas=many, mode=COUNTED)
    counts, expected = canvas.cpu().numpy().ravel(), many.sum(0).ravel()
    usual = expected.sum() / 64
    assert abs(kept - usual) < 4 * math.sqrt(usual), f"{kept} points are kept where the CPU keeps {usual:.0f}"
    few = expected < 20 * 64
    table = np.array([[*counts[~few], counts[few].sum()], [*expected[~few], expected[few].sum()]])
    chance = stats.chi2_contingency(table[:, table.sum(0) > 0]).pvalue
    assert chance > 1e-3, f"points would differ so much from the CPU's by chance once in {1 / chance:.3g} times"


def scatter(*shape: int, spread: float = 1.1, seed: int = 0) -> Tensor:
    """Points uniform on [-spread, spread]²."""
    return (torch.rand(*shape, 2, generator=torch.Generator().manual_seed(seed)) * 2 - 1) * spread


AWKWARD = {
    "one point": scatter(1, spread=0.5),
    "beyond the frame": scatter(300, spread=1.6),
    "all on one spot": torch.tensor([[0.31, -0.17]]).repeat(50, 1),
    "on pixel centres and borders": torch.tensor([[x / 21, y / 21] for x in range(-22, 23) for y in (-21, -20, 0, 21)]),
    "just out of sight": torch.tensor([[1.8, 0.0], [-1.8, 0.0], [0.0, 1.8], [0.0, -1.8], [1.05, 1.05]]),
    "a batch": scatter(2, 3, 70),
    "dense": scatter(300, spread=0.3),
}
