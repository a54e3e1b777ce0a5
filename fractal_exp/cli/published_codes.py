"""The data set and the optimised codes that the paper's authors offer on its project page, in the form in which their
program (https://github.com/sshadr/chaotic-fractals) writes and reads them.

A target is ifs_codes/fdb_7.json with the matrices `ifs_m` and the offsets `ifs_t`, and its picture ifs/fdb_7.png. An
optimised code is fdb_7/output/best_optimized_ifs_code.pth or fdb_7.pth, or a fdb_7.json like that of a target. A .pth
is a pickle of the program's objects. Here it only fills stand-ins with their numbers: nothing that it names is imported
or called. Probabilities are left out, because the program's evaluation takes |det| + 0.01 instead, as ours does.
"""

from __future__ import annotations

import io
import re
from collections import OrderedDict
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import pandas as pd
import torch
from torch import Tensor

from ..errors import InputError
from ..evaluation.scoring import TRIVIAL
from ..evaluation.summary import bootstrap_interval, without_empty
from ..ifs import attractor
from ..ifs.code import IFS
from ..runtime.files import read_file, read_json
from ..studies.published import COLUMNS, TABLES
from .candidates import Aim, Submission, fit_picture

NAME, BEST = re.compile(r"fdb_\d+"), "best_optimized_ifs_code.pth"
TARGETS, PICTURES, OURS = "ifs_codes", "ifs", "ours"  # names of folders; the program calls the paper's method "ours"
LARGEST_CHECKPOINT = 2**20  # bytes; ten maps take some twenty thousand
EXPECTED = f"optimised codes as fdb_0/output/{BEST}, fdb_0.pth or fdb_0.json"


class _Module:
    """Has the attributes that a module of the program had, and does nothing."""


STAND_INS = [(OrderedDict, "easydict.EasyDict"), (_Module, "system.blocks.ContractiveFunction"),
             (_Module, "system.blocks.LipschtizLinear")]


def gather(folder: str | Path, codes: Sequence[str] = ()) -> tuple[list[Submission], list[str]]:
    """Each optimised code with its target's code and, where it is there, its picture, both codes in the frame of their
    own boxes, as the program draws them; and the names of what is only in the data set or only among the codes.

    The data set lies anywhere in `folder`; so do the optimised codes, unless `codes` names their folder. Of several
    folders with codes, that of the paper's method is taken by its name. Raises `InputError`, which says what was
    expected and what was found.
    """
    folder = Path(folder).absolute()
    if len(codes) > 1:
        raise InputError(f"with --published name one folder of optimised codes at most, got {', '.join(codes)}")
    there = sorted(folder.rglob(TARGETS))
    targets = {path.stem: path for place in there for path in place.glob("*.json") if NAME.fullmatch(path.stem)}
    if len(there) != 1 or not targets:
        raise InputError(f"{folder}: expected one folder {TARGETS} with the targets' codes fdb_0.json, fdb_1.json, … "
                         f"and beside it {PICTURES} with their pictures; found {_some(there or folder.rglob('*.*'))}")
    results = _results(Path(codes[0]).absolute() if codes else folder)
    both, alone = (sorted(names, key=lambda name: int(name.removeprefix("fdb_")))
                   for names in (targets.keys() & results.keys(), targets.keys() ^ results.keys()))
    if not both:
        raise InputError(f"no optimised code has the name of a target: the targets are {_some(targets)}, the codes "
                         f"{_some(results)}")
    return [Submission(name, _framed(results[name]), _aim(targets[name])) for name in both], alone


def _aim(target: Path) -> Aim:
    picture = target.parent.with_name(PICTURES) / f"{target.stem}.png"
    if not picture.exists():
        return Aim(_framed(target))
    return Aim(_framed(target), fit_picture(read_file(picture, "the picture"), str(picture)), picture.name)


def _results(folder: Path) -> dict[str, Path]:
    """The optimised codes of one method by the names of their targets; of two forms of one code, the .pth."""
    found: dict[Path, dict[str, Path]] = {}
    for path in sorted(folder.rglob("*")):
        name, place = (path.parents[1].name, path.parents[2]) if path.name == BEST else (path.stem, path.parent)
        if path.suffix in (".pth", ".json") and NAME.fullmatch(name) and place.name != TARGETS:
            found.setdefault(place, {})[name] = path
    if not found:
        raise InputError(f"{folder}: expected {EXPECTED}; found {_some(folder.rglob('*.*'))}")
    chosen = list(found) if len(found) == 1 else [place for place in found if place.name.startswith(OURS)]
    if len(chosen) != 1:
        raise InputError(f"{folder}: expected one folder with {EXPECTED}, or one of several that is called {OURS}…; "
                         f"found {_some(found)}; name one before --published")
    return found[chosen[0]]


def _framed(path: Path) -> IFS:
    try:
        return attractor.normalize(IFS(*(_from_json if path.suffix == ".json" else _from_checkpoint)(path)))
    except InputError as error:
        raise InputError(str(error) if str(path) in str(error) else f"{path}: {error}") from None


def _from_json(path: Path) -> tuple[Any, Any]:
    data = read_json(path, "the code")
    if not isinstance(data, dict) or not {"ifs_m", "ifs_t"} <= data.keys():
        found = _some(data) if isinstance(data, dict) else type(data).__name__
        raise InputError(f"expected the matrices ifs_m and the offsets ifs_t, found {found}")
    return data["ifs_m"], data["ifs_t"]


def _from_checkpoint(path: Path) -> tuple[Tensor, Tensor]:
    """Matrices (N,2,2), U diag(sigmoid(s)) V^T with the factors Q of free entries as U and V^T, and the offsets (N,2),
    tanh of free ones."""
    data = read_file(path, "the code", LARGEST_CHECKPOINT)
    try:
        with torch.serialization.safe_globals(STAND_INS):
            if foreign := torch.serialization.get_unsafe_globals_in_checkpoint(io.BytesIO(data)):
                raise InputError(f"expected nothing but {', '.join(name for _, name in STAND_INS)} and tensors, found "
                                 f"{', '.join(sorted(foreign))}; nothing was loaded")
            code = torch.load(io.BytesIO(data), map_location="cpu", weights_only=True)
        layers = [vars(vars(function)["_modules"]["ll"]) for function in code["contractive_functions"]]
        u, singular, vt, offset = (torch.stack([layer[name].detach().float() for layer in layers])
                                   for name in ("au", "psigmas", "av", "lbias"))
        linear = torch.linalg.qr(u).Q @ torch.diag_embed(torch.sigmoid(singular)) @ torch.linalg.qr(vt).Q
        return linear, torch.tanh(offset)
    except InputError:
        raise
    except Exception as error:  # torch's own kinds, and what follows from another structure
        reason = (str(error).splitlines() or [""])[0][:120]
        raise InputError("expected the authors' contractive_functions, each with a layer ll of the parameterisation qr "
                         f"(au, psigmas, av, lbias); found something else ({type(error).__name__}: {reason})") from None


def _some(things: Iterable[object]) -> str:
    names = sorted(map(str, things))
    return ", ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else "") or "nothing"


def beside_published(per_view: pd.DataFrame) -> pd.DataFrame:
    """Means over fractals with 95% intervals, beside the published row of the paper's method: columns row, metric,
    mean, low, high. The rows are what was measured, what is published, and paired differences, fractal by fractal."""
    means: dict[Any, Any] = {method: views.groupby("fractal")[list(COLUMNS)].mean()
                             for method, views in without_empty(per_view).groupby("method")}
    measured = means["result"].dropna(axis="columns", how="all")
    published = pd.DataFrame([TABLES["comparisons"].rows["chaotic"]], columns=list(COLUMNS))[measured.columns]
    rows = {"measured": measured, "published": published, "measured - published": measured - published.iloc[0],
            **{f"measured - {other}": measured - means[other][measured.columns] for other in ("ceiling", *TRIVIAL)}}
    return pd.DataFrame([(row, name, values[name].mean(), *bootstrap_interval(values[name].to_numpy()))
                         for row, values in rows.items() for name in values],
                        columns=["row", "metric", "mean", "low", "high"])
