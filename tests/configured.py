"""Configurations of fractal-train as Hydra composes them."""

import os
from copy import deepcopy
from functools import cache

from hydra import compose, initialize_config_module
from omegaconf import OmegaConf

from fractal_exp.cli import configuration

ABLATIONS = {  # the keys by which each row of the paper's ablation table may differ from the full method
    "naive": {"model.parameterization._target_", "loss.weights.regularizer", "regularizer_weight"},
    "no_multisampling": {"model.supersample", "model.sigma_px"},
    "no_mip": {"loss.terms.mse.levels"},
    "no_ssim": {"loss.weights.ssim"},
    "no_perceptual": {"loss.terms.perceptual.kind", "loss.weights.perceptual"},
    "no_regularizer": {"loss.weights.regularizer"},
    "moments": {"loss"},
    "no_annealing": {"optimizer"},
    "no_gradients": {"optimizer"},
    "noisy_gradients": {"optimizer"},
}


def composed(*overrides: str, hydra: bool = False):
    configuration.register()
    with initialize_config_module("fractal_exp.conf", version_base="1.3"):
        return compose("train", list(overrides), return_hydra_config=hydra)


@cache
def _resolved(folder: str, *overrides: str) -> dict:
    return OmegaConf.to_container(configuration.resolve(composed(*overrides)))


def plain(*overrides: str) -> dict:
    return deepcopy(_resolved(os.getcwd(), *overrides))  # paths are absolute


def options(group: str) -> list[str]:
    configuration.register()
    with initialize_config_module("fractal_exp.conf", version_base="1.3"):
        from hydra.core.global_hydra import GlobalHydra

        return GlobalHydra.instance().config_loader().get_group_options(group)
