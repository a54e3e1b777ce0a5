"""What is looked at before a sweep is opened: whether its jobs can be composed, and what a picture means for it."""

from __future__ import annotations

import json
from inspect import signature
from typing import Any

from hydra.core.global_hydra import GlobalHydra
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Override
from hydra.experimental.callback import Callback
from omegaconf import DictConfig, open_dict, read_write

from ..errors import InputError
from ..targets import Picture
from . import words
from .configuration import plain
from .vocabulary import Vocabulary


class CheckSweep(Callback):
    """Hydra's call before that of `OpenSweep`: a mistake ends the command before there is a run or a folder."""

    def on_multirun_start(self, config: DictConfig, **kwargs: Any) -> None:
        try:
            _take_picture(config)
            _compose_some(config)
        except Exception as error:  # Hydra would make a mere warning of it
            message = words.explain(error, Vocabulary("sweep"))
            if message is None:
                raise
            words.complain("fractal-sweep", message)


def _take_picture(config: DictConfig) -> None:
    """With picture=FILE the study no longer varies its target, has no settings of another one, nor does its table
    speak of it."""
    keys = [word.split("=", 1)[0].lstrip("+") for word in config.hydra.overrides.task]
    params = config.hydra.sweeper.params
    if "picture" not in keys:
        return
    labels = plain(config.sweep)
    with read_write(config), open_dict(config):
        for key in [key for key in params or () if str(key).split(".")[0] == "target"]:
            del params[key]
        for key, value in (plain(config.target) if config.target else {}).items():
            if key not in ("_target_", *signature(Picture).parameters) and f"target.{key}" not in keys:
                # With its value, since Hydra's sweeper writes every override as KEY=VALUE.
                config.hydra.overrides.task.append(f"~target.{key}={json.dumps(value)}")
        for key in ("row", "sample"):
            if "${target." in labels[key] and f"sweep.{key}" not in keys:
                config.hydra.overrides.task.append(f"sweep.{key}=${{picture}}")


def _compose_some(config: DictConfig) -> None:
    """Compose the first job, and one for every choice and every type of value that it does not have."""
    loader = GlobalHydra.instance().config_loader()
    lines = [f"{key}={value}" for key, value in (config.hydra.sweeper.params or {}).items()]
    overrides = OverridesParser.create(config_loader=loader).parse_overrides(
        lines + list(config.hydra.overrides.task))
    varied = {override.get_key_element(): _kinds(override, bool(loader.get_group_options(override.key_or_group)))
              for override in overrides}
    first = {key: values[0] for key, values in varied.items()}
    jobs = [first, *(first | {key: value} for key, values in varied.items() for value in values[1:])]
    for job in jobs:
        loader.load_sweep_config(config, [f"{key}={value}" for key, value in job.items()])


def _kinds(override: Override, group: bool) -> list[str]:
    """The values of an override that differ in what could be wrong with them."""
    if not override.is_sweep_override():
        return [override.get_value_element_as_str()]
    values = list(override.sweep_string_iterator())
    if not values:
        raise InputError(f"{override.input_line} gives no value")
    kinds = {value if group else _type(value): value for value in reversed(values)}
    return [values[0], *(value for value in kinds.values() if value != values[0])]


def _type(value: str) -> type:
    return type(OverridesParser.create().parse_override(f"key={value}").value())
