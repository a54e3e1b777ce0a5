"""Forward and backward of every loss term, beside the plain library version of the same value, in one run.

    python benchmarks/losses.py [--sizes 256 1024] [--kind lpips_alex] [--repeats 5] [--ours]

Milliseconds, the minimum over the repeats; "ratio" is library over ours. The library versions know nothing of the
target in advance: average pooling of both images, kornia's SSIM, the lpips package on three equal colours. Backbone
weights are random: they change no timing, and the distances mean nothing.
"""

from __future__ import annotations

import argparse
import resource
import tempfile
import time
import warnings
from collections.abc import Callable
from pathlib import Path

import torch
import torch.nn.functional as F
from torch import Tensor

from fractal_exp.methods.chaotic.losses import DSSIM, MipMSE, Moments, PerceptualTerm, Regularizer, Term
from fractal_exp.methods.chaotic.rendering import Rendering
from fractal_exp.perceptual.distances import kinds
from fractal_exp.runtime import threads

Loss = Callable[[Tensor, Tensor], Tensor]


def library_mse(image: Tensor, target: Tensor) -> Tensor:
    return F.mse_loss(image, target)


def library_mip_mse(image: Tensor, target: Tensor) -> Tensor:
    image, target, levels = image[None, None], target[None, None], []
    while image.shape[-1] >= 2:
        levels.append(F.mse_loss(image, target))
        image, target = F.avg_pool2d(image, 2), F.avg_pool2d(target, 2)
    return torch.stack(levels).mean()


def library_dssim(image: Tensor, target: Tensor) -> Tensor:
    import kornia

    return 1 - kornia.metrics.ssim(image[None, None], target[None, None], 11, eps=0.0, padding="valid").mean()


def library_lpips(kind: str, features: dict[str, Tensor]) -> Loss:
    import lpips

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # torchvision's, on arguments that lpips still uses
        net = lpips.LPIPS(net=kind.removeprefix("lpips_"), pnet_rand=True, verbose=False).requires_grad_(False)
    for number in range(1, net.net.N_slices + 1):
        part = getattr(net.net, f"slice{number}")
        part.load_state_dict({name: features[name] for name in part.state_dict()})
    return lambda image, target: net(*(x.expand(1, 3, -1, -1) for x in (image, target)), normalize=True).squeeze()


def random_features(kind: str) -> dict[str, Tensor]:
    from torchvision.models import get_model

    model = {"lpips_alex": "alexnet", "lpips_squeeze": "squeezenet1_1", "lpips_vgg": "vgg16"}[kind]
    return get_model(model, weights=None).features.state_dict()


def milliseconds(loss: Callable[[], Tensor], inputs: list[Tensor], repeats: int) -> float:
    def once() -> float:
        start = time.perf_counter()
        torch.autograd.grad(loss(), inputs)
        return 1e3 * (time.perf_counter() - start)

    once()
    return min(once() for _ in range(repeats))


def measure(name: str, term: Term, library: Loss | None, size: int, repeats: int) -> tuple[float, str]:
    """Our milliseconds and the line of the table, once the library version has had its turn."""
    generator = torch.Generator().manual_seed(0)
    image, target = torch.rand(2, size, size, generator=generator)
    singular, offset = torch.rand(2, 10, 2, generator=generator)
    inputs = [x.requires_grad_() for x in ((singular, offset) if isinstance(term, Regularizer) else (image,))]
    rendering = Rendering(image, torch.zeros(1, 2), singular, offset)
    term.prepare(target)
    ours = milliseconds(lambda: term(rendering), inputs, repeats)
    line = f"{size:5d}  {name:20s} {ours:10.2f}"
    if library:
        difference = abs(float(term(rendering).detach()) - float(library(image, target).detach()))
        theirs = milliseconds(lambda: library(image, target), inputs, repeats)
        line += f" {theirs:10.2f} {theirs / ours:8.1f} {difference:12.1e}"
    return ours, line


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", type=int, nargs="+", default=[256, 1024])
    parser.add_argument("--kind", choices=kinds(), default="lpips_alex")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--ours", action="store_true", help="skip the library versions (for the peak memory of ours)")
    arguments = parser.parse_args()
    features = random_features(arguments.kind)
    with tempfile.TemporaryDirectory() as folder:
        torch.save(features, Path(folder) / "random.pth")
        perceptual = PerceptualTerm(arguments.kind, str(Path(folder) / "random.pth"))
    library_perceptual = None if arguments.ours else library_lpips(arguments.kind, features)
    terms = [
        ("mse", MipMSE(levels=1), library_mse), ("mip mse", MipMSE(), library_mip_mse),
        ("mip mse, stretched", MipMSE(stretch=True), None), ("d-ssim", DSSIM(), library_dssim),
        ("moments", Moments(), None), ("regularizer", Regularizer(), None),
        (arguments.kind, perceptual, library_perceptual),
    ]
    print(f"{threads.use()} threads, torch {torch.__version__}\n"
          f" size  {'term':20s} {'ours ms':>10s} {'library ms':>10s} {'ratio':>8s} {'difference':>12s}")
    for size in arguments.sizes:
        total = 0.0
        for name, term, library in terms:
            ours, line = measure(name, term, None if arguments.ours else library, size, arguments.repeats)
            total += ours * (name in ("mip mse", "d-ssim", "regularizer", arguments.kind))
            print(line)
        print(f"{size:5d}  {'the whole objective':20s} {total:10.2f}\n")
    print(f"peak memory of the process: {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20:.2f} GiB")


if __name__ == "__main__":
    main()
