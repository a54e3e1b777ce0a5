"""Train the network of the perceptual distance `fractal` and write its weight file:

    python -m benchmarks.perceptual_training mine.safetensors                 under an hour on two cores
    python -m benchmarks.perceptual_training mine.safetensors steps=14000 batch=48 fits=500 --device cuda   not run yet
    python -m benchmarks.perceptual_training mine.safetensors contrastive=0.3 --seed 1

A training that was interrupted goes on where the same command finds its checkpoint beside the file. Fits and
evaluations take the file: fractal-train perceptual=fractal perceptual_weights=mine.safetensors.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from pathlib import Path

from tqdm import tqdm

from fractal_exp.methods.base import Progress
from fractal_exp.perceptual import fractal_features
from fractal_exp.runtime import threads
from fractal_exp.runtime.checkpoint import Checkpoint
from fractal_exp.training.loop import train

from .training import PerceptualTraining


def main(arguments: Sequence[str] | None = None) -> Path:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file", type=Path)
    parser.add_argument("recipe", nargs="*", metavar="KEY=VALUE", help="of benchmarks/perceptual_training/training.py")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--device", default="cpu", help="cuda: pictures are still drawn by the CPU")
    parser.add_argument("--threads", type=int, help="default: one a core")
    parser.add_argument("--checkpoint-every", type=int, default=250, metavar="STEPS")
    options = parser.parse_args(arguments)
    threads.use(options.threads)
    training = PerceptualTraining(seed=options.seed, **{
        key: json.loads(value) for key, _, value in (each.partition("=") for each in options.recipe)})
    identity = training.recipe() | {"device": options.device}
    checkpoint = Checkpoint(options.file.with_suffix(".checkpoint"), options.checkpoint_every, identity, resume=True)
    with tqdm(total=training.steps) as bar:
        def tell(progress: Progress) -> None:
            bar.set_postfix_str(progress.describe(), refresh=False)
            bar.update(progress.step - bar.n)

        trained = train(training, device=options.device, on_step=tell, checkpoint=checkpoint)
    path = fractal_features.save(options.file, *training.exported(trained.tensors),
                                 identity | {"validation": trained.scores})
    fractal_features.load(path)  # what is not finite must not count as finished
    checkpoint.path.unlink(missing_ok=True)
    print(f"{json.dumps({name: round(value, 3) for name, value in trained.scores.items()})}\n{path}")
    return path


if __name__ == "__main__":
    main()
