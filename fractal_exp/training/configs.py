"""The files conf/pretraining/NAME.yaml, made from the recipes:

    python -m fractal_exp.training.configs neural_regression > conf/pretraining/neural_regression.yaml

Beside each stand the files of the scales, NAME_laptop.yaml and the like, which hold only their difference.
"""

from __future__ import annotations

import sys
from importlib import import_module

from ..errors import InputError, did_you_mean
from ..runtime.params import as_yaml
from .codes import CodeTraining

FILES = {  # name of the method -> module, class, and the settings that stand elsewhere
    "neural_regression": ("neural_regression", "RegressionTraining", {
        "maps": "${method.maps}", "side": "${method.side}", "as_released": "${method.as_released}"}),
    "amortized": ("amortized", "AmortizedTraining", {"maps": "${method.maps}", "side": "${method.side}"}),
    "super_resolution": ("super_resolution", "SuperResolutionTraining", {
        "factor": "${method.factor}", "width": "${method.width}"}),
}


def hydra_config(name: str) -> str:
    """The text of a recipe's file: every parameter below its docstring, at the size of the paper."""
    if name not in FILES:
        raise InputError(f"there is no file for {name!r}{did_you_mean(name, FILES) or ';'} choose one of "
                         f"{', '.join(FILES)}")
    module, class_name, settings = FILES[name]
    kind: type[CodeTraining] = getattr(import_module(f"{__package__}.{module}"), class_name)
    return f"""# The training of the network of {name}, at the size of the paper. See docs/comparisons.md.
# Made from fractal_exp/training/{module}.py, which states every parameter once; do not edit it here.
_target_: {kind.__module__}.{kind.__qualname__}
_convert_: all
seed: ${{seed}}
{as_yaml(kind.Params(), settings)}
"""


if __name__ == "__main__":
    print(hydra_config(sys.argv[1]), end="")
