"""From a Hydra configuration to checked, plain data: the constructors' signatures are the schema."""

from __future__ import annotations

import inspect
import sys
import typing
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hydra.core.config_store import ConfigStore
from hydra.core.hydra_config import HydraConfig
from hydra.errors import InstantiationException
from hydra.types import RunMode
from hydra.utils import get_object, instantiate
from omegaconf import MISSING, DictConfig, ListConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from ..errors import InputError

if TYPE_CHECKING:
    from ..runtime.params import Params

PATH_KEYS = ("output", "picture", "target.path", "perceptual_weights", "weights.neural_regression",
             "weights.super_resolution", "weights.amortized", "method.weights")
VARIED = ("model", "loss", "optimizer")   # groups whose choice names a variant of the paper's method
PARENT = "parent_run"  # the setting that tells a fit of -m the run that it stands below
TIMES = ("method.seconds", "method.init.seconds")  # 60 and 60.0 are one limit


@dataclass
class TrainConfig:
    """The top level of `fractal-train`; every group's own keys are typed by the class that its `_target_` names."""

    picture: str | None = None
    seconds: float | None = None
    colour: bool = False
    task: str = MISSING
    target: Any = MISSING
    method: Any = MISSING
    pretraining: Any = None
    model: Any = MISSING
    loss: Any = MISSING
    optimizer: Any = MISSING
    evaluation: Any = MISSING
    tracking: Any = MISSING
    scale: str = MISSING
    variant: str = MISSING
    preset: str | None = None
    resolution: int = MISSING
    iterations: int = MISSING
    perceptual: str = "none"
    perceptual_weights: str | None = None
    seed: int = 0
    device: str = "cpu"
    backend: str = "auto"
    threads: int | None = None
    output: str = "outputs"
    study: str = "fits"
    sweep: Any = None
    parent_run: str | None = None
    name: str | None = None
    resume: bool = False
    checkpoint_every: int = 250
    init: Any = None
    regularizer_weight: float = 0.01
    budgets: dict[str, int] = field(default_factory=dict)
    weights: dict[str, str | None] = field(default_factory=dict)
    network_side: int = 64
    network_width: int = 32
    scouting: int = 100
    anneal_every: int = 250
    anneal_sharpness: float = 10.0
    match_target: bool = MISSING
    starts: int = MISSING


def register() -> None:
    """Make the top-level schema known to Hydra, under the name that conf/train.yaml asks for, and `chosen`."""
    ConfigStore.instance().store(name="train_schema", node=TrainConfig)
    OmegaConf.register_new_resolver("chosen", chosen, replace=True)


def chosen(preset: str | None = None) -> str:
    """The preset of the method, and the chosen model, loss and optimizer as far as they are not the usual ones with it,
    as in as_released+naive+moments, each by the name of the ablation that chose it; "full" if there is nothing to name.
    """
    names = {}
    if HydraConfig.initialized():
        choices = HydraConfig.get().runtime.choices
        usual = _defaults("train") | _defaults(f"method/{choices.get('method')}")
        names = {group: str(choices[group]) for group in VARIED if choices.get(group) != usual[group]}
        named = _defaults(f"ablation/{choices.get('ablation')}")
        names |= {group: str(choices["ablation"]) for group in names if named.get(group) == names[group]}
    return "+".join([*([preset] if preset else []), *names.values()]) or "full"


def _defaults(file: str) -> dict[str, Any]:
    """The choice of each group in the defaults of a file of the package; of another file, none."""
    path = Path(str(files("fractal_exp.conf"))) / f"{file}.yaml"
    lines = plain(OmegaConf.load(path)).get("defaults", []) if path.exists() else []
    return {group.removeprefix("override /"): choice
            for line in lines if isinstance(line, dict) for group, choice in line.items()}


def own_words() -> str:
    """The words of this job that the other jobs of -m do not share; none without -m."""
    if not HydraConfig.initialized() or HydraConfig.get().mode != RunMode.MULTIRUN:
        return ""
    given = {word.lower() for word in sys.argv}  # Hydra writes true as True
    return " ".join(word for word in words_of_a_fit() if word.lower() not in given)


def words_of_a_fit() -> list[str]:
    """The words of the command, or of this job of it, without what -m adds for itself."""
    return [word for word in HydraConfig.get().overrides.task if not word.startswith(f"{PARENT}=")]


def resolve(config: DictConfig) -> DictConfig:
    """The configuration with every interpolation resolved, every path absolute and every component checked.

    Raises `InputError` naming the key on a missing value, a wrong type, a key that no constructor takes or a class
    that does not exist.
    """
    for key in PATH_KEYS:
        value = OmegaConf.select(config, key)
        if value is not None:
            OmegaConf.update(config, key, str(Path(value).expanduser().absolute()))
    try:
        OmegaConf.resolve(config)
        missing = OmegaConf.missing_keys(config)
    except OmegaConfBaseException as error:
        raise InputError(f"the configuration cannot be resolved: {str(error).splitlines()[0]}") from error
    if config.get("init") and "init" not in config.method:
        raise InputError("init=… says what the paper's method begins with; take method=chaotic, or leave init out")
    if config.get("picture") and OmegaConf.select(config, "target.path") != config.picture:
        raise InputError(f"picture={config.picture} and the configuration's target are two; give one of them (in a "
                         "file, picture: stands beside `override target: image`)")
    if config.get("target") and "path" in config.target and config.target.path is None:
        raise InputError("no value was given for target.path; add picture=FILE to the command")
    if missing:
        raise InputError(f"no value was given for {', '.join(sorted(missing))}; add KEY=VALUE to the command")
    for key in TIMES:
        if isinstance(value := OmegaConf.select(config, key), float) and value.is_integer():
            OmegaConf.update(config, key, int(value))
    # The method repeats model, loss and optimizer: it comes last, so that an error names the part itself.
    for key, node in sorted(config.items(), key=lambda item: item[0] == "method"):
        if isinstance(node, DictConfig):
            check_components(node, str(key))
    return config


def method_name(method: Mapping[str, Any]) -> str:
    """A method's name in folders and tables: that of its class, after that of the method it begins with."""
    own = method["_target_"].rsplit(".", 1)[-1].lower()
    return f"{method_name(method['init'])}-{own}" if method.get("init") else own


def build(node: DictConfig) -> Any:
    """The object that a checked component describes. A constructor's `InputError` comes out as it is."""
    try:
        return instantiate(node)
    except InstantiationException as error:
        cause: BaseException | None = error
        while cause is not None and not isinstance(cause, InputError):
            cause = cause.__cause__
        raise cause or error from None


def check_components(node: DictConfig, path: str) -> None:
    """Check a node, and all nodes below it, against the constructors that `_target_` names."""
    for key, value in node.items():
        if isinstance(value, DictConfig):
            check_components(value, f"{path}.{key}")
    if "_target_" in node:
        given = {str(key): value for key, value in node.items() if not str(key).startswith("_")}
        _check_against_signature(get_object(node["_target_"]), given, path)


def plain(config: DictConfig | ListConfig, resolve: bool = False) -> dict[str, Any]:
    """A mapping as a dictionary without OmegaConf's types; interpolations stay as text unless `resolve`."""
    return typing.cast(dict[str, Any], OmegaConf.to_container(config, resolve=resolve))


def _checked_params(params: type[Params], given: dict[str, Any], path: str) -> dict[str, Any]:
    """What is given beside a constructor's parameters, which are checked by their own class."""
    from ..runtime.params import ParamError

    own = {name: OmegaConf.to_container(value) if OmegaConf.is_config(value) else value
           for name, value in given.items() if name in params.model_fields}
    try:
        params().updated(**own)
    except ParamError as error:
        raise ParamError(f"{path}.{error.name}" if error.name else path, error.told) from None
    return {name: value for name, value in given.items() if name not in own}


def _check_against_signature(constructor: Any, given: dict[str, Any], path: str) -> None:
    import pydantic

    if params := getattr(constructor, "Params", None):
        given = _checked_params(params, given, path)
    hints = typing.get_type_hints(constructor.__init__ if inspect.isclass(constructor) else constructor)
    fields: dict[str, Any] = {}
    for name, each in inspect.signature(constructor).parameters.items():
        if each.kind not in (each.VAR_POSITIONAL, each.VAR_KEYWORD):
            kind = Any if OmegaConf.is_config(given.get(name)) else hints.get(name, Any)  # a node is checked by itself
            fields[name] = (kind, ... if each.default is each.empty else each.default)
    options = pydantic.ConfigDict(arbitrary_types_allowed=True, strict=True, extra="forbid", protected_namespaces=())
    schema = pydantic.create_model(constructor.__name__, __config__=options, **fields)
    try:
        schema(**given)
    except pydantic.ValidationError as error:
        first = error.errors()[0]
        names = f"; {constructor.__name__} takes {', '.join([*fields, *(params.model_fields if params else ())])}"
        told = {"missing": names, "extra_forbidden": names}.get(first["type"], f", got {first['input']!r}")
        raise InputError(f"{path}.{first['loc'][0]}: {first['msg']}{told}") from error
