"""Parameters of a component as one frozen, validated class: each is stated once, with its range and its meaning."""

from __future__ import annotations

import json
import re
import textwrap
from collections.abc import Iterator
from typing import Annotated, Any, ClassVar, Self, get_args, get_origin

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator
from pydantic.fields import FieldInfo

from ..errors import InputError, did_you_mean

Count = Annotated[int, Field(ge=0)]
Positive = Annotated[int, Field(ge=1)]
Amount = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Share = Annotated[float, Field(ge=0, le=1)]
Odds = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Interval = tuple[Amount, Amount]
Some = Field(min_length=1)   # for a list that must not be empty

NAME = "\0"
EXPECTED = {  # kinds of pydantic's errors -> what was expected, from what it says of the limit
    "greater_than_equal": "at least {ge:.10g}", "greater_than": "above {gt:.10g}",
    "less_than_equal": "at most {le:.10g}", "less_than": "below {lt:.10g}", "finite_number": "a finite number",
    "int_type": "a whole number", "float_type": "a number", "bool_type": "true or false", "string_type": "a text",
    "literal_error": "{expected}", "model_type": "a mapping of settings", "tuple_type": "a list",
    "too_short": "a list of at least {min_length} values", "too_long": "a list of at most {max_length} values",
}
BOUNDS = {"ge": "at least", "gt": "above", "le": "at most", "lt": "below"}
OUTSIDE = ("greater_than_equal", "greater_than", "less_than_equal", "less_than")   # kinds of errors: out of range


class Params(BaseModel):
    """A component's parameters. Raises `InputError` that names a parameter in full, with what it may be. ascending:
    pairs of parameters of which the first may not be above the second."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, use_attribute_docstrings=True)
    ascending: ClassVar[tuple[tuple[str, str], ...]] = ()

    def __init__(self, **values: Any) -> None:
        try:
            super().__init__(**values)
        except ValidationError as error:
            raise _explained(type(self), error) from None

    @model_validator(mode="before")
    @classmethod
    def _as_written(cls, values: Any) -> Any:
        """Accept lists as tuples, as YAML and JSON write them, and NumPy's scalars as numbers."""
        if not isinstance(values, dict):
            return values
        return {name: _plain(value) for name, value in values.items()}

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        for first, second in self.ascending:
            low, high = getattr(self, first), getattr(self, second)
            if low > high:
                raise ParamError(second, f"{NAME} must be at least {first}, which is {low}; got {high}")
        return self

    def updated(self, **values: Any) -> Self:
        """The same with other values, those of nested parameters as mappings; checked."""
        return type(self)(**_merged(self, values))

    @classmethod
    def leaves(cls) -> Iterator[tuple[str, FieldInfo]]:
        """Every parameter by its full name, those of nested components too."""
        for name, info in cls.model_fields.items():
            inner = nested(info)
            if inner is None:
                yield name, info
            else:
                yield from ((f"{name}.{below}", each) for below, each in inner.leaves())


def _plain(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value.item() if isinstance(value, np.generic) else value


def nested(info: FieldInfo) -> type[Params] | None:
    """The class of a field that is a component itself."""
    kind = info.annotation
    return kind if isinstance(kind, type) and issubclass(kind, Params) else None


def _merged(params: Params, values: dict[str, Any]) -> dict[str, Any]:
    merged: dict[str, Any] = {name: getattr(params, name) for name in type(params).model_fields}
    for name, value in values.items():
        before = merged.get(name)
        if isinstance(before, Params) and isinstance(value, dict):
            value = _merged(before, value)
        merged[name] = value
    return merged


def below(params: Params, name: str, limit: str) -> None:
    """Raise `ParamError`, which names both, unless the parameter `name` is below the parameter `limit`."""
    value, most = getattr(params, name), getattr(params, limit)
    if value >= most:
        raise ParamError(name, f"{NAME} must be below {limit}, which is {most}; got {value}")


class ParamError(InputError):
    """What is wrong with one parameter: its full name stands where `told` has the mark `NAME`."""

    def __init__(self, name: str, told: str):
        super().__init__(told.replace(NAME, name))
        self.name, self.told = name, told


def _explained(kind: type[Params], error: ValidationError) -> ParamError:
    """The first thing that is wrong."""
    first = error.errors(include_url=False)[0]
    cause = first.get("ctx", {}).get("error")
    name = ".".join(str(part) for part in first["loc"])
    got = list(first["input"]) if isinstance(first["input"], tuple) else first["input"]
    if isinstance(cause, ParamError):  # of a component
        return ParamError(".".join(part for part in (name, cause.name) if part), cause.told)
    if cause is not None:
        return ParamError(name, str(cause))
    if first["type"] == "extra_forbidden":
        near = did_you_mean(name, kind.model_fields) or f"; choose one of {', '.join(kind.model_fields)}"
        return ParamError(name, f"there is no parameter {NAME}{near}")
    length = _length(kind.model_fields.get(str(first["loc"][0]))) if first["loc"] else 0
    if length and first["type"] in ("missing", "too_long"):
        return ParamError(str(first["loc"][0]), f"{NAME} must be a list of {length} values, got {got!r}")
    if first["type"] == "missing":
        return ParamError(name, f"{NAME} is needed, and was not given")
    told, near = EXPECTED.get(first["type"]), ""
    expected = told.format(**first.get("ctx", {})) if told else first["msg"].lower()
    if first["type"] in OUTSIDE and name in kind.model_fields:
        expected = _range(kind.model_fields[name]) or expected
    if first["type"] == "literal_error":
        near = did_you_mean(str(first["input"]), re.findall(r"'([^']*)'", expected), most=1)
    return ParamError(name, f"{NAME} must be {expected}, got {got!r}{near}")


def _length(info: FieldInfo | None) -> int:
    """The number of values of a field that takes a list of so many; 0 for any other field."""
    values = get_args(info.annotation) if info and get_origin(info.annotation) is tuple else ()
    return 0 if Ellipsis in values else len(values)


def _range(info: FieldInfo) -> str:
    """The bounds of a field in words, "at least 0 and below 1"; empty if none are its own."""
    return " and ".join(f"{words} {getattr(limit, sign):.10g}" for limit in info.metadata
                        for sign, words in BOUNDS.items() if getattr(limit, sign, None) is not None)


def as_yaml(params: Params, interpolated: dict[str, str], indent: int = 0, prefix: str = "") -> str:
    """The parameters as YAML, each below its docstring; interpolated: values by full name that stand elsewhere."""
    lines = []
    for name, info in type(params).model_fields.items():
        value, full, margin = getattr(params, name), prefix + name, " " * indent
        if isinstance(value, Params):
            told = (type(value).__doc__ or "").splitlines()
            lines += ["", *(f"{margin}# {line.strip()}".rstrip() for line in told), f"{margin}{name}:",
                      as_yaml(value, interpolated, indent + 2, f"{full}.")]
        else:
            text = interpolated.get(full) or json.dumps(value)
            lines += [f"{margin}# {line}" for line in textwrap.wrap(info.description or "", 117 - indent)]
            lines.append(f"{margin}{name}: {text}")
    return "\n".join(lines)
