"""The files of methods and of trainings, made from their parameters, which are stated once:

    python -m fractal_exp.conf.generate method/evolutionary > conf/method/evolutionary.yaml

Beside the files of conf/pretraining stand those of the scales, NAME_laptop.yaml and the like, which hold only their
difference.
"""

from __future__ import annotations

import sys
from pkgutil import resolve_name
from typing import Any

from fractal_exp.errors import InputError, did_you_mean
from fractal_exp.runtime.params import as_yaml

COMPARED = {  # file -> module and class, what stands above its parameters, and the settings that stand elsewhere
    "method/evolutionary": ("methods.population.evolutionary:Evolutionary",
                            "Evolutionary programming (Nettleton and Garigliano 1994).", {}),
    "method/cuckoo": ("methods.population.cuckoo:Cuckoo", "Cuckoo search (Quirce et al. 2017).", {}),
    "method/learning_fractals_32": ("methods.learning_fractals.method:LearningFractals32",
                                    "Learning Fractals (Tu et al. 2023) on its own canvas of 32².", {}),
    "method/learning_fractals_256": ("methods.learning_fractals.method:LearningFractals256",
                                     "Learning Fractals (Tu et al. 2023) on 256², with more points.", {}),
    "method/neural_regression": ("methods.neural_regression.method:NeuralRegression",
                                 "Neural regression (Graham and Demers 2021).", {"side": "${network_side}"}),
    "method/amortized": ("methods.amortized.method:Amortized", "Amortised set prediction (Yamaguti 2026).",
                         {"side": "${network_side}"}),
    "method/super_resolution": ("methods.super_resolution.method:SuperResolution",
                                "Super-resolution (SwinIR, Liang et al. 2021).", {"width": "${network_width}"}),
    "pretraining/neural_regression": ("training.neural_regression:RegressionTraining",
                                      "The training of the network of neural_regression, at the size of the paper.", {
                                          "maps": "${method.maps}", "side": "${method.side}",
                                          "as_released": "${method.as_released}"}),
    "pretraining/amortized": ("training.amortized:AmortizedTraining",
                              "The training of the network of amortized, at the size of the paper.", {
                                  "maps": "${method.maps}", "side": "${method.side}"}),
    "pretraining/super_resolution": ("training.super_resolution:SuperResolutionTraining",
                                     "The training of the network of super_resolution, at the size of the paper.", {
                                         "factor": "${method.factor}", "width": "${method.width}"}),
}
FILES = COMPARED | {"method/collage": (
    "methods.collage.method:Collage",
    "Collage search finds the maps of a code one by one, from the measure that the image shows.", {})}


def hydra_config(file: str) -> str:
    """The text of a file: every parameter below its docstring, a method's budget as a scale sets it."""
    if file not in FILES:
        raise InputError(f"there is no file for {file!r}{did_you_mean(file, FILES) or ';'} choose one of "
                         f"{', '.join(FILES)}")
    place, about, elsewhere = FILES[file]
    kind, (group, name) = resolve_name(f"fractal_exp.{place}"), file.split("/")
    settings, given = _settings(kind, group, name)
    source = kind.Params.__module__.replace(".", "/")
    page = "comparisons" if file in COMPARED else "method"
    return "\n".join([
        f"# {about} See docs/{page}.md.",
        f"# Made from {source}.py, which states every parameter once; do not edit it here.",
        f"_target_: {kind.__module__}.{kind.__qualname__}", "_convert_: all", *settings,
        as_yaml(kind.Params(), given | elsewhere), ""])


def _settings(kind: Any, group: str, name: str) -> tuple[list[str], dict[str, str]]:
    """The lines before the parameters, and the parameters that the configuration sets elsewhere."""
    if group == "pretraining":
        return ["seed: ${seed}"], {}
    if f"pretraining/{name}" in FILES:
        return ["seconds: ${seconds}", "device: ${device}"], {"weights": f"${{weights.{name}}}"}
    return (["seconds: ${seconds}", "seed: ${seed}", "device: ${device}", "previews: 10"],
            {kind.unit: f"${{budgets.{name}}}"} if hasattr(kind, "unit") else {})


if __name__ == "__main__":
    print(hydra_config(sys.argv[1]), end="")
