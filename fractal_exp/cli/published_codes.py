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
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import torch

from ..errors import InputError
from ..evaluation.scoring import TRIVIAL
from ..evaluation.summary import ALL_VIEWS, bootstrap_interval, describe, metric_columns, summarize, without_empty
from ..ifs import attractor
from ..ifs.code import IFS
from ..runtime.files import read_file, read_json
from ..studies.published import COLUMNS, TABLES
from .candidates import Aim, Submission, fit_picture

if TYPE_CHECKING:
    import pandas as pd

NAME = re.compile(r"fdb_\d+")
TARGETS, PICTURES, OURS = "ifs_codes", "ifs", "ours"  # names of folders; the program calls the paper's method "ours"
BEST = "best_optimized_ifs_code.pth"
LARGEST_CHECKPOINT = 2**20  # bytes; ten maps take some 50 thousand
EXPECTED = f"the optimised codes as fdb_0/output/{BEST}, fdb_0.pth or fdb_0.json"


class _Module:
    """Has the attributes that a module of the program had, and does nothing."""


STAND_INS = [(OrderedDict, "easydict.EasyDict"), (_Module, "system.blocks.ContractiveFunction"),
             (_Module, "system.blocks.LipschtizLinear")]


def gather(folder: str | Path, codes: Sequence[str] = ()) -> tuple[list[Submission], list[str]]:
    """Each optimised code with its target's code and, where it is there, its picture, all in the frame of their own
    boxes, as the program draws them; and what is there of one of the two alone.

    The targets lie anywhere in `folder`; so do the optimised codes, unless `codes` names their folder. Of several
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
                         f"and beside it {PICTURES} with their pictures; found {_found(there) or _holds(folder)}")
    results = _results(Path(codes[0]).absolute() if codes else folder)
    names = sorted(targets.keys() | results.keys(), key=lambda name: int(name.removeprefix("fdb_")))
    both = [name for name in names if name in targets and name in results]
    if not both:
        raise InputError(f"no optimised code has the name of a target: the targets are {_found(sorted(targets))}, the "
                         f"codes {_found(sorted(results))}")
    alone = [f"{name} (no {'optimised code' if name in targets else 'target'})" for name in names if name not in both]
    return [Submission(name, _framed(results[name]), _aim(targets[name])) for name in both], alone


def _aim(target: Path) -> Aim:
    picture = target.parent.with_name(PICTURES) / f"{target.stem}.png"
    image = fit_picture(read_file(picture, "the picture"), str(picture)) if picture.exists() else None
    return Aim(_framed(target), image, None if image is None else picture.name)


def _results(folder: Path) -> dict[str, Path]:
    """The optimised codes of one method by the names of their targets; of two forms of one code, the .pth."""
    found: dict[Path, dict[str, Path]] = {}
    for path in sorted(folder.rglob("*")):
        name, place = (path.parents[1].name, path.parents[2]) if path.name == BEST else (path.stem, path.parent)
        if path.suffix in (".pth", ".json") and NAME.fullmatch(name) and place.name != TARGETS:
            found.setdefault(place, {})[name] = path
    chosen = list(found) if len(found) == 1 else [place for place in found if place.name.startswith(OURS)]
    if not found:
        raise InputError(f"{folder}: expected {EXPECTED}; found {_holds(folder)}")
    if len(chosen) != 1:
        raise InputError(f"{folder}: expected one folder with {EXPECTED}, or one of several that is called {OURS}…; "
                         f"found {_found(list(found))}; name one before --published")
    return found[chosen[0]]


def _framed(path: Path) -> IFS:
    try:
        return attractor.normalize(IFS(*(_from_json if path.suffix == ".json" else _from_checkpoint)(path)))
    except InputError as error:
        raise InputError(str(error) if str(path) in str(error) else f"{path}: {error}") from None


def _from_json(path: Path) -> tuple[Any, Any]:
    data = read_json(path, "the code")
    if not isinstance(data, dict) or not {"ifs_m", "ifs_t"} <= data.keys():
        raise InputError(f"expected the matrices ifs_m and the offsets ifs_t, found "
                         f"{', '.join(map(str, data)) if isinstance(data, dict) else type(data).__name__}")
    return data["ifs_m"], data["ifs_t"]


def _from_checkpoint(path: Path) -> tuple[torch.Tensor, torch.Tensor]:
    """Matrices (N,2,2) and offsets (N,2): U diag(sigmoid(s)) V^T with the factors Q of free entries as U and V^T, or
    free matrices (the ablation "naive"); the offsets are a tanh."""
    data = read_file(path, "the code", LARGEST_CHECKPOINT)
    try:
        with torch.serialization.safe_globals(STAND_INS):
            if foreign := torch.serialization.get_unsafe_globals_in_checkpoint(io.BytesIO(data)):
                raise InputError(f"expected nothing but {', '.join(name for _, name in STAND_INS)} and tensors, found "
                                 f"{', '.join(sorted(foreign))}; nothing was loaded")
            code = torch.load(io.BytesIO(data), map_location="cpu", weights_only=True)
        layers = [vars(vars(function)["_modules"]["ll"]) for function in code["contractive_functions"]]
        parts = {name: torch.stack([layer[name].detach().float() for layer in layers])
                 for name in (("matrix",) if layers[0]["use_naive"] else ("au", "psigmas", "av")) + ("lbias",)}
    except InputError:
        raise
    except Exception as error:  # torch's own kinds, and what follows from another structure
        raise InputError("expected the authors' contractive_functions, each with the layer ll of the parameterisation "
                         f"qr or naive; found something else ({type(error).__name__}: "
                         f"{(str(error).splitlines() or [''])[0][:120]})") from None
    offset = torch.tanh(parts["lbias"])
    if "matrix" in parts:
        return parts["matrix"], offset
    singular = torch.diag_embed(torch.sigmoid(parts["psigmas"]))
    return torch.linalg.qr(parts["au"]).Q @ singular @ torch.linalg.qr(parts["av"]).Q, offset


def _found(things: Sequence[object]) -> str:
    return ", ".join(map(str, things[:3])) + (f" and {len(things) - 3} more" if len(things) > 3 else "")


def _holds(folder: Path) -> str:
    return _found([path.relative_to(folder) for path in sorted(folder.rglob("*")) if path.is_file()]) or "no file"


def beside_published(per_view: pd.DataFrame) -> pd.DataFrame:
    """Means with 95% intervals beside the published row of the paper's method: columns row, metric, mean, low, high.

    The rows are the measured means, the published ones, their difference, and the paired differences, fractal by
    fractal, from the truth drawn anew and from the trivial pictures.
    """
    import pandas as pd

    measured = per_view[per_view["method"] == "result"]
    overall = summarize(measured).query("zoom_class == @ALL_VIEWS").set_index("metric")
    published = pd.Series(TABLES["comparisons"].rows["chaotic"], COLUMNS)
    names = [name for name in COLUMNS if name in metric_columns(per_view) and measured[name].notna().any()]
    means = without_empty(per_view).groupby(["method", "fractal"])[names].mean()
    rows = []
    for name in names:
        mean, low, high = overall.loc[name, ["mean", "low", "high"]]
        rows += [("measured", name, mean, low, high), ("published", name, published[name], float("nan"), float("nan")),
                 ("measured - published", name, *(each - published[name] for each in (mean, low, high)))]
        for other in ("ceiling", *TRIVIAL):
            difference = (means.loc["result"] - means.loc[other])[name].to_numpy()
            rows.append((f"measured - {other}", name, difference.mean(), *bootstrap_interval(difference)))
    return pd.DataFrame(rows, columns=["row", "metric", "mean", "low", "high"])


def in_words(table: pd.DataFrame, resolution: int) -> str:
    """The table of `beside_published` as a part of the report."""
    return (f"beside the row of the paper's method in its Table 3 (100 fractals, 7 views each at 1024²); here at "
            f"{resolution}², on other views of the same fractals\n" + describe(table, "row"))
