"""Methods that recover a code from an image: one folder per method, one contract (`base.Method`)."""

from __future__ import annotations

import inspect
import typing
from collections.abc import Callable, Iterable, Mapping
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Any

from ..errors import InputError, did_you_mean

if TYPE_CHECKING:
    from pydantic import TypeAdapter

    from .base import Method

KINDS = {"int": "a whole number", "float": "a number", "bool": "True or False", "str": "a text"}  # of options
METHODS = {  # name -> module:function that builds the method with sensible sizes
    "collage": "collage.method:laptop",
    "chaotic": "chaotic.method:laptop",
    "evolutionary": "population.evolutionary:Evolutionary.laptop",
    "cuckoo": "population.cuckoo:Cuckoo.laptop",
    "learning_fractals_32": "learning_fractals.method:LearningFractals32.laptop",
    "learning_fractals_256": "learning_fractals.method:LearningFractals256.laptop",
    "neural_regression": "neural_regression.method:NeuralRegression.laptop",
    "amortized": "amortized.method:Amortized.laptop",
}
WITHOUT_CODE = {"super_resolution": "draws the image larger"}  # methods that find no code, and what they do instead


def load(name: str) -> Callable[..., Method]:
    """The function that builds the method called `name`, imported when it is asked for."""
    return resolve_name(f"{__package__}.{METHODS[name]}")


def check_options(build: Callable[..., Method], name: str, options: Mapping[str, Any],
                  others: Iterable[str] = ()) -> None:
    """Raise `InputError` on options that a method's building function does not have or that have another type; others:
    names beside them that may have been meant."""
    import numpy as np

    takes = {key: each for key, each in inspect.signature(build).parameters.items() if each.kind != each.VAR_KEYWORD}
    kind = getattr(build, "__self__", None) or inspect.signature(build, eval_str=True).return_annotation
    params = getattr(kind, "Params", None)
    if params is not None:
        own = {key: value for key, value in options.items() if key in params.model_fields}
        params().updated(**own)
        others = [*others, *params.model_fields]
        options = {key: value for key, value in options.items() if key not in own}
    for option, value in options.items():
        if option not in takes:
            inner = [] if params is None else [full for full, _ in params.leaves() if full.endswith(f".{option}")]
            near = (f"; did you mean {' or '.join(inner)}?" if inner
                    else did_you_mean(option, [*takes, *others], most=1) or ";")
            raise InputError(f"the method {name!r} has no option {option!r}{near} it takes "
                             f"{', '.join([*takes, *(params.model_fields if params else ())])}")
        try:
            _checker(build, option).validate_python(value.item() if isinstance(value, np.generic) else value)
        except ValueError as error:
            kinds = " or ".join(KINDS.get(kind, kind) for kind in str(takes[option].annotation).split(" | "))
            raise InputError(f"{option} must be {kinds}, got {value!r}") from error


def _checker(build: Callable[..., Method], option: str) -> TypeAdapter:
    """What tells whether a value has the type that the option is annotated with. An int passes for a float."""
    from pydantic import ConfigDict, TypeAdapter

    hint = typing.get_type_hints(build)[option]
    return TypeAdapter(hint, config=ConfigDict(arbitrary_types_allowed=True, strict=True))
