"""The words of a command that Hydra composes: what picture=FILE stands for, and what a mistyped word may have meant.

What is wrong with a word, Hydra says itself.
"""

from __future__ import annotations

import contextlib
import re
from collections.abc import Iterator, Mapping, Sequence
from difflib import SequenceMatcher
from pathlib import Path
from typing import Any

from hydra import compose, initialize_config_module
from hydra.core.global_hydra import GlobalHydra
from hydra.errors import HydraException, MissingConfigException, OverrideParseException
from omegaconf import OmegaConf

from ..errors import InputError, did_you_mean

PICTURE = re.compile(r"\+{0,2}picture=(.*)", re.DOTALL)
# Whoever names one of these means the paper's method: collage search reads none of them.
PAPERS_METHOD = {"model", "loss", "optimizer", "init", "ablation", "iterations", "starts", "scouting", "anneal_every",
                 "anneal_sharpness", "match_target"}
MOST = 3    # names that are told
NEAR = 0.7  # a word with one letter too many, too few or wrong is at least so like the one that was meant


def completed(words: Sequence[str], for_picture: Sequence[str] = ()) -> list[str]:
    """The words as Hydra takes them: settings last, and with what picture=FILE implies: target=image and, of
    `for_picture`, what is not said; a method only where none is named. Raises `InputError` on a picture beside another
    target."""
    words = sorted(words, key=lambda word: not word.startswith("-") and ("=" in word or word.startswith("~")))
    given = [match[1] for word in words if (match := PICTURE.fullmatch(word))]
    if not given:
        return words
    if not given[-1]:
        raise InputError("picture= needs a file: picture=leaf.png")
    keys = [word.split("=", 1)[0].lstrip("+~") for word in words]
    for word, key in zip(words, keys, strict=True):
        if key == "target.path" or (key == "target" and word != "target=image"):
            raise InputError(f"picture={given[-1]} and {word} both name a target; leave one of them out")
    named = {re.split(r"[./@]", key)[0] for key in keys}
    implied = [word for word in for_picture if word.split("=")[0] not in keys
               and not (word.startswith("method=") and named & PAPERS_METHOD)]
    return [*(_quoted(word) for word in words if word != "target=image"), "target=image", *implied]


def plainest(words: Sequence[str], for_picture: Sequence[str] = ()) -> list[str]:
    """The words without those that `completed` adds by itself."""
    plain = [word for word in words if word not in ("target=image", *for_picture)]
    return plain if sorted(completed(plain, for_picture)) == sorted(words) else list(words)


def _quoted(word: str) -> str:
    """A picture whose name Hydra would read as several, or not at all, in quotes if there is such a file."""
    match = PICTURE.fullmatch(word)
    if not match or not re.search(r"[^\w./~-]", match[1]) or not Path(match[1]).expanduser().is_file():
        return word
    return "picture='" + match[1].replace("\\", "\\\\").replace("'", "\\'") + "'"


def hint(error: BaseException | None, config: str, words: Sequence[str]) -> str:
    """What may have been meant where Hydra refused these words for `config`; empty if nothing is near.

    error: what Hydra raised; None if its command line did not know a flag.
    """
    if isinstance(error, MissingConfigException):
        group, _, name = (error.missing_cfg_file or "").rpartition("/")
        return did_you_mean(name, error.options or ()).removeprefix("; ")
    if isinstance(error, OverrideParseException):
        key, equals, value = error.override.partition("=")
        return ("settings are written KEY=VALUE, and a text with special characters is quoted twice: "
                f"\"{key}='{value}'\"" if equals else f"settings are written KEY=VALUE; a picture: picture={key}")
    if error is None:
        dashed = [word.lstrip("-").split("=")[0] for word in words if word.startswith("--")]
        return _near(dashed, config, words, "settings are written without dashes: ")
    found = re.search(r"'([^']+)'", str(error)) if isinstance(error, HydraException) else None
    return _near([found[1]], config, words) if found else ""


def _near(wrong: Sequence[str], config: str, words: Sequence[str], told: str = "") -> str:
    """The settings and groups whose whole name, or whose last part, is nearest to one of the words."""
    def likeness(key: str) -> tuple[float, float]:
        pairs = [(SequenceMatcher(None, word, key).ratio(),
                  SequenceMatcher(None, word.rpartition(".")[2], key.rpartition(".")[2]).ratio()) for word in wrong]
        return max((max(pair), pair[0]) for pair in pairs)

    near = [key for key in dict.fromkeys(_known(config, words)) if wrong and likeness(key)[0] >= NEAR]
    best = sorted(near, key=likeness, reverse=True)[:MOST]
    return f"{told}did you mean {' or '.join(best)}?" if best else ""


def _known(config: str, words: Sequence[str]) -> list[str]:
    """The settings and groups of a configuration with the choices that the words make, as far as those are right."""
    for choices in (words, ()):
        GlobalHydra.instance().clear()
        with contextlib.suppress(HydraException), initialize_config_module("fractal_exp.conf", version_base="1.3"):
            groups = compose(config, return_hydra_config=True).hydra.runtime.choices
            chosen = [word for word in choices if word.split("=")[0] in groups and "," not in word]
            composed = OmegaConf.to_container(compose(config, chosen))
            return [*(str(group) for group in groups if not str(group).startswith("hydra/")), *_paths(composed)]
    return []


def _paths(data: Any) -> Iterator[str]:
    """The dotted names of all settings in nested data, but what names classes."""
    for key, value in data.items() if isinstance(data, Mapping) else ():
        if not str(key).startswith("_"):
            yield str(key)
            yield from (f"{key}.{inner}" for inner in _paths(value))
