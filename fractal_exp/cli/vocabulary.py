"""The settings that a configuration of this package knows, read from its own files."""

from __future__ import annotations

import difflib
import importlib.resources
from collections.abc import Iterator, Mapping
from functools import cached_property
from pathlib import Path
from typing import Any

from omegaconf import OmegaConf

from .configuration import plain


class Vocabulary:
    """The keys below a configuration (train or sweep), and the choices of every group."""

    def __init__(self, config: str):
        self.config, self.folder = config, Path(str(importlib.resources.files("fractal_exp.conf")))

    def __contains__(self, key: str) -> bool:
        return key in self._keys

    def keys(self) -> list[str]:
        """All settings and groups, by their full name."""
        return list(self._keys)

    def choices(self, group: str) -> list[str]:
        """The choices of a group; none if there is no such group."""
        return sorted(path.stem for path in (self.folder / group).glob("*.yaml")) if group else []

    def unknown(self, key: str) -> str:
        """What to say to someone who asked for a setting that does not exist here."""
        key = key.split("@")[0]
        if owners := [choice for choice in self._keys.get(key, ()) if choice]:
            return f"{key} is a setting of {' or '.join(owners)}, which is not chosen here"
        last = key.replace("/", ".").rsplit(".", 1)[-1]
        near = [known for known in self._keys if known.rsplit(".", 1)[-1] == last] or self._nearest(key)
        hint = f"did you mean {' or '.join(map(self._where, near[:3]))}?" if near else "--help lists those most used"
        return f"there is no setting {key}; {hint}"

    def _nearest(self, key: str) -> list[str]:
        """Close names of the same group first, as a slip in the last word is the likeliest."""
        parent = key.rpartition(".")[0]
        beside = [known for known in self._keys if known.rpartition(".")[0] == parent]
        lasts: dict[str, list[str]] = {}
        for known in self._keys:
            lasts.setdefault(known.rsplit(".", 1)[-1], []).append(known)
        last = difflib.get_close_matches(key.rsplit(".", 1)[-1], lasts, n=1, cutoff=0.7)
        return (difflib.get_close_matches(key, beside, n=1, cutoff=0.6)
                or difflib.get_close_matches(key, self._keys, n=1, cutoff=0.6) or (lasts[last[0]] if last else []))

    def _where(self, key: str) -> str:
        owners = self._keys[key]
        return key if not all(owners) else f"{key} (with {' or '.join(owners)})"

    @cached_property
    def _keys(self) -> dict[str, list[str]]:
        """Every key with the choices that have it, as GROUP=CHOICE; '' for what is always there."""
        found: dict[str, list[str]] = {}
        for key in self._top():
            found.setdefault(key, []).append("")
        for group in self._groups:
            found.setdefault(group, []).append("")
            choices = {name: list(self._of(self.folder / group / f"{name}.yaml", group))
                       for name in self.choices(group)}
            for name, keys in choices.items():
                for key in keys:
                    everywhere = (all(key in others for others in choices.values())
                                  or not key.startswith(f"{group}."))  # what a scale sets is there without it
                    found.setdefault(key, []).append("" if everywhere else f"{group}={name}")
        return found

    def _top(self) -> Iterator[str]:
        for name in {"sweep": ("train", "sweep")}.get(self.config, (self.config,)):
            data = plain(OmegaConf.load(self.folder / f"{name}.yaml"))
            yield from _paths({key: value for key, value in data.items() if key not in ("defaults", "hydra")})

    @cached_property
    def _groups(self) -> list[str]:
        files = {"sweep": ("train", "sweep")}.get(self.config, (self.config,))
        loaded = [plain(OmegaConf.load(self.folder / f"{name}.yaml")) for name in files]
        defaults = [entry for data in loaded for entry in data["defaults"] if isinstance(entry, dict)]
        names = [str(key).removeprefix("optional ") for entry in defaults for key in entry]
        return [name for name in dict.fromkeys(names) if (self.folder / name).is_dir()]

    def _of(self, path: Path, group: str) -> Iterator[str]:
        data = plain(OmegaConf.load(path))
        defaults = data.pop("defaults", [])
        if path.read_text().startswith("# @package _global_"):
            yield from (key for key in data if key not in ("hydra", *self._groups))
            return
        for entry in defaults:
            if entry == "_self_":
                continue
            yield from self._of(self.folder / group / f"{entry}.yaml", group)
        yield from (f"{group}.{key}" for key in _paths(data))


def _paths(data: Mapping[Any, Any]) -> Iterator[str]:
    """The dotted names of all settings in nested data, without what names classes."""
    for key, value in data.items():
        if str(key).startswith("_"):
            continue
        yield str(key)
        if isinstance(value, Mapping):
            yield from (f"{key}.{inner}" for inner in _paths(value))
