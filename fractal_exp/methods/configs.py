"""The files conf/method/NAME.yaml of the methods that the paper compares with, made from their parameters:

    python -m fractal_exp.methods.configs evolutionary > conf/method/evolutionary.yaml
"""

from __future__ import annotations

import sys
from importlib import import_module

from ..errors import InputError, did_you_mean
from ..runtime.params import as_yaml
from .pretrained import Pretrained
from .stepwise import Stepwise

FILES = {  # name -> module, class, and what stands above its parameters
    "evolutionary": ("population.evolutionary", "Evolutionary",
                     "Evolutionary programming (Nettleton and Garigliano 1994)."),
    "cuckoo": ("population.cuckoo", "Cuckoo", "Cuckoo search (Quirce et al. 2017)."),
    "learning_fractals_32": ("learning_fractals.method", "LearningFractals32",
                             "Learning Fractals (Tu et al. 2023) on its own canvas of 32²."),
    "learning_fractals_256": ("learning_fractals.method", "LearningFractals256",
                              "Learning Fractals (Tu et al. 2023) on 256², with more points."),
}

NETWORKS = {  # the same of those that ask a trained network, and the parameters that a scale sets
    "neural_regression": ("neural_regression.method", "NeuralRegression",
                          "Neural regression (Graham and Demers 2021).", {"side": "${network_side}"}),
    "amortized": ("amortized.method", "Amortized", "Amortised set prediction (Yamaguti 2026).",
                  {"side": "${network_side}"}),
    "super_resolution": ("super_resolution.method", "SuperResolution", "Super-resolution (SwinIR, Liang et al. 2021).",
                         {"width": "${network_width}"}),
}


def hydra_config(name: str) -> str:
    """The text of a method's file: every parameter below its docstring, the budget as a scale sets it."""
    if name in NETWORKS:
        return _of_network(name)
    if name not in FILES:
        raise InputError(f"there is no file for {name!r}{did_you_mean(name, [*FILES, *NETWORKS]) or ';'} choose one of "
                         f"{', '.join([*FILES, *NETWORKS])}")
    module, class_name, about = FILES[name]
    kind: type[Stepwise] = getattr(import_module(f"{__package__}.{module}"), class_name)
    return f"""# {about} See docs/comparisons.md.
# Made from fractal_exp/methods/{module.replace('.', '/')}.py, which states every parameter once; do not edit it here.
_target_: {kind.__module__}.{kind.__qualname__}
_convert_: all
seconds: ${{seconds}}
seed: ${{seed}}
device: ${{device}}
previews: 10
{as_yaml(kind.Params(), {kind.unit: f"${{budgets.{name}}}"})}
"""


def _of_network(name: str) -> str:
    module, class_name, about, scaled = NETWORKS[name]
    kind: type[Pretrained] = getattr(import_module(f"{__package__}.{module}"), class_name)
    return f"""# {about} See docs/comparisons.md.
# Made from fractal_exp/methods/{module.replace('.', '/')}.py, which states every parameter once; do not edit it here.
_target_: {kind.__module__}.{kind.__qualname__}
_convert_: all
seconds: ${{seconds}}
device: ${{device}}
{as_yaml(kind.Params(), {"weights": f"${{weights.{name}}}", **scaled})}
"""


if __name__ == "__main__":
    print(hydra_config(sys.argv[1]), end="")
