"""The networks of the compared methods on held-out codes, beside a trivial answer to the same pictures.

    python -m benchmarks.networks                                        the weights in the package; five minutes
    python -m benchmarks.networks --record benchmarks/results/networks.jsonl
    python -m benchmarks.networks --weights neural_regression=FILE       those of a training of one's own

The error is the training's own, on codes that it never sees: see docs/comparisons.md. The difference of network and
trivial answer is paired, code by code; its interval is the bootstrap 95% interval of the mean.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from pkgutil import resolve_name
from typing import Any

import torch
from fractal_exp.conf.generate import FILES

from fractal_exp.evaluation.summary import bootstrap_interval
from fractal_exp.runtime import threads
from fractal_exp.runtime.weights import load
from fractal_exp.training.codes import CodeTraining

from . import record


def judged(name: str, weights: str | None) -> dict[str, Any]:
    """What the network of a method is worth on the held-out codes of its training."""
    kind: type[CodeTraining] = resolve_name(f"fractal_exp.{FILES[f'pretraining/{name}'][0]}")
    recipe = load(weights, kind.method.name).recipe
    fitting = kind.method(weights=weights, **{key: recipe[key] for key in kind.method.asked})
    network, _ = fitting.loaded()
    training = kind(seed=recipe["seed"], **{key: recipe[key] for key in kind.Params.model_fields})
    with torch.no_grad():
        errors = training.errors(network, "cpu")
    (trivial,) = errors.keys() - {"held_out"}
    apart = (errors["held_out"] - errors[trivial]).double()
    low, high = bootstrap_interval(apart.numpy())
    return {"network": name, "codes": len(apart), "held_out": float(errors["held_out"].double().mean()),
            "trivial": trivial, "trivial_error": float(errors[trivial].double().mean()),
            "difference": float(apart.mean()), "low": low, "high": high,
            "better_on": float((apart < 0).double().mean()),
            "training": {key: recipe.get(key) for key in ("stopped", "seconds")}}


def told(row: dict[str, Any]) -> str:
    """A line about a network."""
    return (f"{row['network']}: {row['held_out']:.4f} on {row['codes']} held-out codes, {row['trivial']} "
            f"{row['trivial_error']:.4f}; difference {row['difference']:+.4f} [{row['low']:+.4f}, {row['high']:+.4f}], "
            f"better on {row['better_on']:.0%}; {row['training']['stopped']}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--weights", action="append", default=[], metavar="METHOD=FILE")
    parser.add_argument("--record", type=Path, metavar="FILE", help="add a line of JSON to this file")
    arguments = parser.parse_args()
    given = dict(each.split("=", 1) for each in arguments.weights)
    threads.use(None)
    names = [file.removeprefix("pretraining/") for file in FILES if file.startswith("pretraining/")]
    rows = [judged(name, given.get(name)) for name in names]
    print("\n".join(map(told, rows)))
    if arguments.record:
        record.append(arguments.record, "networks", {"networks": rows},
                      {f"{row['network']}: error / {row['trivial']}": row["held_out"] / row["trivial_error"]
                       for row in rows})


if __name__ == "__main__":
    main()
