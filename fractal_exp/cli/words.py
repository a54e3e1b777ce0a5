"""Check and complete the words on the command line of a program that Hydra composes, and explain in one line what is
wrong with them."""

from __future__ import annotations

import contextlib
import difflib
import os
import re
import sys
import traceback
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, NoReturn

import yaml
from hydra._internal.utils import get_args_parser
from hydra.core.hydra_config import HydraConfig
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.errors import HydraException, MissingConfigException, OverrideParseException
from hydra.types import RunMode
from omegaconf.errors import (
    ConfigAttributeError,
    ConfigKeyError,
    InterpolationKeyError,
    OmegaConfBaseException,
    UnsupportedInterpolationType,
    ValidationError,
)

from ..errors import InputError, did_you_mean
from ..methods.base import FitDiverged
from ..runtime import files
from . import interruption
from .vocabulary import Vocabulary

PICTURE = re.compile(r"\+{0,2}picture=(.*)", re.DOTALL)
SUFFIXES = (".png", ".jpg", ".jpeg", ".gif", ".bmp", ".tif", ".tiff", ".webp")
# Whoever names one of these means the paper's method: collage search reads none of them.
PAPERS_METHOD = {"model", "loss", "optimizer", "init", "ablation", "iterations", "starts", "scouting", "anneal_every",
                 "anneal_sharpness", "match_target"}
EXPECTED = {"Integer": "a whole number", "Float": "a number", "bool": "true or false"}
LIBRARIES = ("hydra", "omegaconf", "antlr4", "yaml")


def run(program: str, main: Callable[[], Any], words: Sequence[str], config: str,
        for_picture: Sequence[str] = ()) -> None:
    """Call `main`, decorated by Hydra, on these words. Whatever Hydra finds wrong with them is said in one line (exit
    status 2); a defect of ours keeps its traceback (status 1).

    config: the configuration whose keys are known. for_picture: the words that picture=… implies beside target=image;
    the method is implied only where none is named.
    """
    try:
        sys.argv[1:] = completed(words, Vocabulary(config), for_picture)
        with interruption.not_lost(), _exceptions_handed_on():
            main()
    except Exception as error:
        message = explain(error, Vocabulary(config), words)
        if message is None:
            traceback.print_exc()
            raise SystemExit(1) from None
        complain(program, message)


@contextlib.contextmanager
def one_line(program: str) -> Iterator[None]:
    """Print what a user can mend as one line (exit status 2), before Hydra adds lines of its own.

    With -m it is raised, as Hydra is to see which job failed.
    """
    try:
        with interruption.not_lost():
            yield
    except Exception as error:
        told = _told(error)
        if told is None or HydraConfig.get().mode == RunMode.MULTIRUN:
            raise
        complain(program, told)


def _told(error: BaseException) -> str | None:
    """What a user can mend of the work itself: what was given, and what the system refuses of a file."""
    if isinstance(error, InputError | FitDiverged):
        return str(error)
    return files.explain(error) if isinstance(error, OSError) and files.is_of_file(error) else None


def complain(program: str, message: str) -> None:
    """Print an error as one line and end with status 2."""
    print(f"{program}: error: {message}", file=sys.stderr)
    raise SystemExit(2) from None


@contextlib.contextmanager
def _exceptions_handed_on() -> Iterator[None]:
    """Let Hydra raise its exceptions instead of printing them."""
    before = os.environ.get("HYDRA_FULL_ERROR")
    os.environ["HYDRA_FULL_ERROR"] = "1"
    try:
        yield
    finally:
        del os.environ["HYDRA_FULL_ERROR"]
        if before is not None:
            os.environ["HYDRA_FULL_ERROR"] = before


def completed(words: Sequence[str], vocabulary: Vocabulary, for_picture: Sequence[str] = ()) -> list[str]:
    """The words as Hydra takes them: flags first, and what picture=… implies.

    Raises `InputError` on unknown flags, on words that are no settings and on a picture beside another target.
    """
    settings = _settings(words, vocabulary)
    rest = Counter(settings)
    flags = []
    for word in words:
        if rest[word] > 0:
            rest[word] -= 1
        else:
            flags.append(word)
    if "--help" not in flags and "-h" not in flags:
        settings = _with_picture(settings, for_picture)
        for word in settings:
            _check_setting(word, vocabulary)
    return [*flags, *settings]


def _settings(words: Sequence[str], vocabulary: Vocabulary) -> list[str]:
    parser = get_args_parser()
    flags = [flag for flag in parser._option_string_actions if flag.startswith("--")]
    for word in words:
        name = word.split("=", 1)[0]
        if word.startswith("--") and name not in flags and not any(flag.startswith(name) for flag in flags):
            bare = name.lstrip("-").replace("-", "_")
            if bare in vocabulary:
                raise InputError(f"settings are written without dashes: {bare}=VALUE instead of {name}")
            near = did_you_mean(name, flags) or did_you_mean(bare, vocabulary.keys(), most=1)
            raise InputError(f"there is no option {name}{near}")

    def refuse(message: str) -> NoReturn:
        raise InputError(f"{message}; --help tells how the program is called")

    parser.error = refuse
    return parser.parse_intermixed_args(list(words)).overrides


def _check_setting(word: str, vocabulary: Vocabulary) -> None:
    if "=" not in word and not word.startswith("~"):
        if Path(word).suffix.lower() in SUFFIXES or Path(word).is_file():
            raise InputError(f"a picture is given as picture={word}" if "picture" in vocabulary else
                             f"settings are written KEY=VALUE, got {word!r}")
        if word in vocabulary:
            raise InputError(f"{word} needs a value: {word}=VALUE")
        raise InputError(f"settings are written KEY=VALUE, got {word!r}{did_you_mean(word, vocabulary.keys())}")
    try:
        OverridesParser.create().parse_override(word)
    except HydraException as error:
        raise InputError(_unreadable(word)) from error


def _unreadable(word: str) -> str:
    key, _, value = word.partition("=")
    quoted = value.replace("\\", "\\\\").replace("'", "\\'")
    return (f"the value of {word!r} cannot be read; a text with special characters is quoted twice, for the shell and "
            f"for the program: \"{key}='{quoted}'\"")


def _with_picture(settings: list[str], implied: Sequence[str]) -> list[str]:
    """Let picture=FILE mean target=image, and whatever else is implied and not said."""
    given = [match[1] for word in settings if (match := PICTURE.fullmatch(word))]
    if not given:
        return settings
    if not given[-1]:
        raise InputError("picture= needs a file: picture=leaf.png")
    keys = [word.split("=", 1)[0].lstrip("+~") for word in settings]
    for word, key in zip(settings, keys, strict=True):
        if key == "target.path" or (key == "target" and word != "target=image"):
            raise InputError(f"picture={given[-1]} and {word} both name a target; leave one of them out")
    named = {re.split(r"[./@]", key)[0] for key in keys}
    implied = [word for word in implied if word.split("=")[0] not in keys
               and not (word.startswith("method=") and named & PAPERS_METHOD)]
    return [*dict.fromkeys(["target=image", *implied]), *(_quoted(word) for word in settings if word != "target=image")]


def _quoted(word: str) -> str:
    """A picture whose name Hydra would read as several, or not at all, in quotes if there is such a file."""
    match = PICTURE.fullmatch(word)
    if not match or not re.search(r"[^\w./~-]", match[1]) or not Path(match[1]).expanduser().is_file():
        return word
    return "picture='" + match[1].replace("\\", "\\\\").replace("'", "\\'") + "'"


def explain(error: BaseException, vocabulary: Vocabulary, words: Sequence[str] = ()) -> str | None:
    """What a user can mend in one line: the words, what stands in a file, what the system refuses; else None."""
    if told := _told(error):
        return told
    if _during_our_work(error):
        return None
    cause = error.__cause__ if isinstance(error.__cause__, OmegaConfBaseException) else error
    for kind, text in EXPLANATIONS.items():
        for each in (error, cause):
            if isinstance(each, kind):
                return text(error, cause, vocabulary, words)
    return _first_line(error) if _raised_by_library(error) else None


def _missing_choice(error: Any, cause: Any, vocabulary: Vocabulary, words: Sequence[str]) -> str:
    missing = error.missing_cfg_file
    group, _, name = (missing or "").rpartition("/")
    options = list(error.options or vocabulary.choices(group))
    if not group or not options:
        return f"there is no configuration {missing!r}; --config-dir FOLDER names the folder of your own"
    options.sort(key=lambda option: -difflib.SequenceMatcher(None, name, option).ratio())
    near = did_you_mean(name, options, most=1)
    return f"there is no {group}={name}{near or ';'} the choices are {', '.join(options)}"


def _unknown_key(error: Any, cause: Any, vocabulary: Vocabulary, words: Sequence[str]) -> str:
    quoted = re.search(r"'([^']+)'", str(error))
    return vocabulary.unknown(quoted[1] if quoted else str(cause.full_key))


def _wrong_type(error: Any, cause: Any, vocabulary: Vocabulary, words: Sequence[str]) -> str:
    kind = re.search(rf"\b({'|'.join(EXPECTED)})\b", str(cause))
    value = getattr(cause, "value", None)
    got = "nothing" if value in ("", None) else repr(value)
    expected = f"must be {EXPECTED[kind[1]]}, got {got}" if kind else f"cannot be {got}: {_first_line(cause)}"
    return f"{cause.full_key} {expected}"


def _dangling(error: Any, cause: Any, vocabulary: Vocabulary, words: Sequence[str]) -> str:
    return f"{cause.full_key or 'a setting'} refers to what does not exist: {_first_line(cause)}"


def _syntax(error: Any, cause: Any, vocabulary: Vocabulary, words: Sequence[str]) -> str:
    return _unreadable(error.override)


def _composition(error: Any, cause: Any, vocabulary: Vocabulary, words: Sequence[str]) -> str:
    """Where Hydra gives nothing but a text: what is known of it by its beginning, else its first line."""
    text = str(error)
    for pattern, meaning in TEXTS.items():
        if found := re.search(pattern, text, re.DOTALL):
            return meaning(vocabulary, found[1])
    return _first_line(error)


EXPLANATIONS: dict[Any, Callable[[Any, Any, Vocabulary, Sequence[str]], str]] = {
    MissingConfigException: _missing_choice,
    OverrideParseException: _syntax,
    (ConfigKeyError, ConfigAttributeError): _unknown_key,
    ValidationError: _wrong_type,
    (InterpolationKeyError, UnsupportedInterpolationType): _dangling,
    HydraException: _composition,
}
TEXTS: dict[str, Callable[[Vocabulary, str], str]] = {
    r"Additional config directory '(.*?)'": lambda _, path: f"there is no folder {path}; --config-dir names the folder "
                                                            "of your own configurations",
    r"Ambiguous value for argument '(.*?)'\n": lambda _, word: (
        f"{word} gives several values; -m runs one fit for each of them"),
    r"Could not override '(.*?)'": lambda vocabulary, key: vocabulary.unknown(key),
    r"config group '(.*?)' does not exist": lambda vocabulary, key: vocabulary.unknown(key),
    r"Could not delete .*?'(.*?)'": lambda vocabulary, key: vocabulary.unknown(key),
    r"already at '(.*?)'": lambda _, key: f"the setting {key} exists already; leave out the +",
}


def _first_line(error: BaseException) -> str:
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    if isinstance(error, yaml.YAMLError):  # its first line says what was being read, the next ones what is wrong where
        lines = [" ".join(lines)]
    return f"the command cannot be carried out: {lines[0] if lines else type(error).__name__}"


def _raised_by_library(error: BaseException) -> bool:
    *_, last = traceback.walk_tb(error.__traceback__)
    return last[0].f_globals.get("__name__", "").split(".")[0] in LIBRARIES


def _during_our_work(error: BaseException) -> bool:
    """Whether Hydra had begun a job and that had come to our code."""
    frames = [frame for frame, _ in traceback.walk_tb(error.__traceback__)]
    names = [frame.f_code.co_name for frame in frames]
    job = frames[names.index("run_job"):] if "run_job" in names else []
    return any(frame.f_globals.get("__name__", "").startswith(("fractal_exp.", "__main__")) for frame in job)
