"""The tables of results on the site, from the files under benchmarks/results.

A line `[table: MAKER FOLDER ...]` of a page becomes a table: the maker is a function of this module, of
`docs.picture_tables` or of `docs.paper_tables`, and each folder or file is one under benchmarks/results. So a page
never states a figure that its file does not hold.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pandas as pd
import yaml

from . import paper_tables as paper
from . import picture_tables as pictures
from .cells import Rows, frame, interval, lines_of, percent, share, short

ROOT = Path(__file__).parents[1]
RESULTS, PARTS = ROOT / "benchmarks" / "results", ROOT / "conf" / "without"
FULL = "nothing"                   # the name of the whole method among the parts
FEW = 5                            # paired differences of which an interval says nothing

VIEWS = {("attractor", "bbox"): "own box", ("attractor", "none"): "input", ("released", "bbox"): "own box"}
DRAWN = {"result": "the code", "truth, drawn anew": "the truth, rendered with other points", "all white": "all white",
         "all black": "all black"}
NAMES = {"search": "restarts, and moves on the corrected measure", "detail": "stage 2", "image": "stage 3",
         "last digits": "rounding"}   # of stages; a stage with another name keeps its own


def table(maker: str, *names: str) -> str:
    """The Markdown of a table. Raises `ValueError` for an unknown maker and for a file that is not there."""
    if maker not in MAKERS:
        raise ValueError(f"there is no table {maker}; choose from {', '.join(MAKERS)}")
    paths = [RESULTS / name for name in names]
    if missing := [name for name, path in zip(names, paths, strict=True) if not path.exists()]:
        raise ValueError(f"benchmarks/results has no {', '.join(missing)}, which the table {maker} names")
    head, rows = MAKERS[maker](*paths)
    lines = [head, ["---"] * len(head), *([cell.replace("|", "\\|") for cell in row] for row in rows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def suite(folder: Path) -> tuple[list[str], Rows]:
    """Scores of a suite's codes on all views, in both frames, beside the truth and trivial images."""
    from fractal_exp.evaluation.summary import CEILING_F1, bootstrap_interval, without_empty
    from fractal_exp.studies.published import TABLES

    views, rows = without_empty(pd.read_csv(folder / "per_view.csv")), []
    digits = {"f1": 3, "iou": 3, "psnr": 1, "ssim": 3}
    for name, drawn in DRAWN.items():
        for (kind, align), where in VIEWS.items():
            chosen = views[(views["views"] == kind) & (views["align"] == align) & (views["method"] == name)]
            if chosen.empty:
                continue
            ours, each = name == "result", chosen.groupby("fractal")[list(digits)].mean()
            cells = [short(chosen[score].mean(), places)
                     + (interval(*bootstrap_interval(each[score].to_numpy()), places) if ours else "")
                     for score, places in digits.items()]
            rows.append([drawn, kind, where, *cells, percent(each["f1"] >= CEILING_F1) if ours else ""])
    if lines_of(folder)[0]["suite"] == 2025:
        published = TABLES["comparisons"].rows["chaotic"]
        rows.append(["the paper's method, published: 1024², another sample", "released", "own box",
                     *map(short, published[:2]), f"{published[2]:.1f}", short(published[3]), ""])
    return ["drawn", "views", "frame", "F1", "IoU", "PSNR", "SSIM", f"F1 ≥ {short(CEILING_F1, 2)}"], rows


def codes(folder: Path) -> tuple[list[str], Rows]:
    """What is known of a suite's codes."""
    fits = pd.read_csv(folder / "per_view.csv").groupby("fractal")[["exact", "equivalent", "seconds"]].first()
    other = ~fits["exact"] & fits["equivalent"]
    seconds = fits["seconds"]
    return ["exact", "another code of the same attractor", "wrong", "seconds of one core: median", "mean", "longest"], [
        [share(fits["exact"]), share(other), share(~fits["exact"] & ~other), f"{seconds.median():.0f}",
         f"{seconds.mean():.0f}", f"{seconds.max():.0f}"]]


def parts() -> tuple[list[str], Rows]:
    """The parts of collage search that can be left out, and by which settings."""
    rows = []
    for path in sorted(PARTS.glob("*.yaml")):
        settings = (yaml.safe_load(path.read_text()) or {}).get("method")
        if settings:
            about = " ".join(line.removeprefix("# ") for line in path.read_text().splitlines()[1:]
                             if line.startswith("# "))
            rows.append([f"`{path.stem}`", about, ", ".join(f"`{name}={json.dumps(value)}`"
                                                            for name, value in leaves(settings).items())])
    return ["part", "without it", "settings"], rows


def leaves(node: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """The settings of nested components by their full names."""
    return {key: value for name, inner in node.items() for key, value in (
        leaves(inner, f"{prefix}{name}.") if isinstance(inner, Mapping) else {f"{prefix}{name}": inner}).items()}


def ablation(*folders: Path) -> tuple[list[str], Rows]:
    """A row for each part that was left out, a column for each kind of pictures: the paired difference of F1 with its
    95% interval, in bold if that lacks zero, and the change in the number of recovered codes."""
    older = {"fractal": "target", "f1_box": "f1", "exact": "recovered"}   # names in earlier records
    fits = pd.concat([each.rename(columns={old: name for old, name in older.items() if name not in each})
                      for each in map(frame, folders)], ignore_index=True)
    fits["target"] = fits["target"].astype(str)
    kinds = list(dict.fromkeys(fits["set"]))
    whole = fits[fits["without"] == FULL].set_index(["set", "target"])
    of = [whole.loc[kind] for kind in kinds]
    rows = [["nothing", *(f"{short(each['f1'].mean())}<br>{share(each['recovered'])}" for each in of)]]
    for part, group in fits[fits["without"] != FULL].groupby("without"):
        rows.append([" and ".join(f"`{name}`" for name in str(part).split("+")),
                     *(_difference(group[group["set"] == kind].set_index("target"), all_of)
                       for kind, all_of in zip(kinds, of, strict=True))])
    return ["without", *(kind.replace("_", " ") for kind in kinds)], rows


def paper_ablations(folder: Path) -> tuple[list[str], Rows]:
    """The rows of the paper's Table 4 as a sweep measured them, the best F1 first: paired difference from the full
    method with its 95% interval, in bold if that lacks zero; then the published F1 and its difference."""
    from fractal_exp.studies.published import TABLES

    fits = pd.DataFrame([{"row": line["row"], "sample": line["sample"], "seconds": line["seconds"], **line["scores"]}
                         for line in lines_of(folder)])
    f1, means = fits.pivot(index="sample", columns="row", values="f1"), fits.groupby("row").mean(numeric_only=True)
    published, rows = {row: scores[0] for row, scores in TABLES["ablations"].rows.items()}, []
    for row in means["f1"].sort_values(ascending=False).index:
        is_full, theirs = row == "full", short(published[row] - published["full"], sign="+")
        rows.append([f"`{row}`", short(means.loc[row, "f1"]), short(means.loc[row, "iou"]),
                     f"{means.loc[row, 'psnr']:.1f}", short(means.loc[row, "ssim"]),
                     "" if is_full else _mean_change((f1[row] - f1["full"]).dropna()),
                     short(published[row]), "" if is_full else theirs, f"{means.loc[row, 'seconds']:.0f}"])
    return ["row", "F1", "IoU", "PSNR", "SSIM", "F1 minus full", "published F1", "minus full", "seconds"], rows


def _difference(without: pd.DataFrame, whole: pd.DataFrame) -> str:
    both = without.index.intersection(whole.index)
    if both.empty:
        return ""
    changes = without.loc[both, "f1"] - whole.loc[both, "f1"]
    change = short(changes.mean(), sign="+") if len(both) < FEW else _mean_change(changes)
    gained = int(without.loc[both, "recovered"].sum() - whole.loc[both, "recovered"].sum())
    return f"{change}<br>{short(gained, 0, '+') if gained else '±0'}"


def _mean_change(changes: pd.Series) -> str:
    """The mean of paired differences with its 95% interval, in bold if that lacks zero."""
    from fractal_exp.evaluation.summary import bootstrap_interval

    low, high = bootstrap_interval(changes.to_numpy(float))
    mark = "**" if low > 0 or high < 0 else ""
    return f"{mark}{short(changes.mean(), sign='+')}{mark}{interval(low, high, sign='+')}"


def worked_example(path: Path) -> tuple[list[str], Rows]:
    """The code after each stage of one search. The restarts of a round are one row."""
    stages = lines_of(path)[-1]["figures"]["stages"]
    last = [stage for stage, after in zip(stages, [*stages[1:], {}], strict=True)
            if stage["stage"] != after.get("stage")]
    return ["after", "seconds", "maps", "true maps found", "F1"], [
        [NAMES.get(stage["stage"], stage["stage"]), f"{stage['seconds']:.0f}", str(stage["maps"]), str(stage["found"]),
         short(stage["f1"])] for stage in last]


def classics(path: Path) -> tuple[list[str], Rows]:
    """The classics of the gallery."""
    each = [line["figures"] for line in lines_of(path)]
    return ["classic", "maps found", "true maps", "F1", "F1 of the truth", ""], [
        [one["fractal"].replace("_", " "), str(one["maps"]), str(one["true_maps"]), short(one["f1"]),
         short(one["ceiling_f1"]), "exact" if one["exact"] else "equivalent" if one["equivalent"] else "wrong"]
        for one in sorted(each, key=lambda one: one["fractal"])]


def datasets(path: Path) -> tuple[list[str], Rows]:
    """What a picture of a data set costs, and how many are made in a second."""
    figures, head = lines_of(path)[-1]["figures"], ["", "points", "patches"]
    parts = {(row["draw"], row["size"]): row for row in figures["parts"]}
    rows = [[f"{name}, {size}²", *(_time(parts[kind, size][key] / 1000) for kind in head[1:])] for size in (256, 362)
            for name, key in (("drawing", "drawing_ms"), ("its PNG", "png_ms"), ("its PNG by Pillow", "pillow_ms"))]
    for way in dict.fromkeys(row["to"] for row in figures["rates"]):
        made = {row["draw"]: row for row in figures["rates"] if row["to"] == way}
        rows.append([f"pictures of 256² a second to {way}",
                     *(f"{made[kind]['per_second']:.0f} on {made[kind]['cores']:.2f} cores" for kind in head[1:])])
    times = {row["draw"]: row for row in figures["beside"]}
    rows += [[f"four PNG of a drawing at 362², {name}",
              *(_time(sum(times[kind][key]) / len(times[kind][key])) for kind in head[1:])]
             for name, key in (("here", "ours"), ("by FractalDB's renderer", "theirs"))]
    return head, [*rows, ["ratio of the two", *(f"{times[kind]['ratio']:.0f}" for kind in head[1:])]]


def speed(*paths: Path) -> tuple[list[str], Rows]:
    """Times of operators and of steps of the compared methods, beside their twins in plain torch."""
    found = [line for path in paths for line in [lines_of(path)[-1]["figures"]]]
    rows = [[case["case"], _time(case["total_ms"] / 1000), _time(case["twin_total_ms"] / 1000),
             f"{case['twin_ratio']:.0f}"] for line in found for case in line.get("cases", ())]
    rows += [[step["step"], _time(step["seconds"]), _time(step["twin_seconds"]), f"{step['twin_ratio']:.0f}"]
             for line in found for step in line.get("steps", ())]
    return ["", "kernel", "plain torch", "ratio"], rows


def shares(path: Path) -> tuple[list[str], Rows]:
    """Where the time of collage search goes, by kinds of pictures: shares of its stages, and then of its parts."""
    sets = lines_of(path)[-1]["figures"]["sets"]
    rows = [["seconds of a search", *(f"{each['seconds']:.0f}" for each in sets)]]
    for kind in "stages", "parts":
        names = dict.fromkeys(name for each in sets for name in each[kind])
        rows.append([f"**{kind}**", *[""] * len(sets)])
        for name in names:
            title = NAMES.get(name, name) if kind == "stages" else name
            rows.append([title, *(f"{each[kind].get(name, 0.0):.0%}" for each in sets)])
    return ["", *(each["set"].replace("_", " ") for each in sets)], rows


def _time(seconds: float) -> str:
    return f"{seconds:.1f} s" if seconds >= 1 else f"{1000 * seconds:.3g} ms"


def dimensions(path: Path) -> tuple[list[str], Rows]:
    """Dimensions of codes and of drawings, beside the known ones."""
    def number(each: Mapping[str, Any], digits: int = 2) -> str:
        return f"{each['value']:.{digits}f} [{each['low']:.{digits}f}, {each['high']:.{digits}f}]"

    rows = []
    for each in lines_of(path)[-1]["figures"]["sets"]:
        code, known = each["code"], each["known"]
        held = [f"**{number(boxes)}**" if known and not boxes["low"] <= known <= boxes["high"] else number(boxes)
                for boxes in each["boxes"].values()]
        measure = [number(given) if given["standing"] == "estimate" else f"{given['value']:.4f}"
                   for given in (each["information"][0], each["correlation"][0])]
        rows.append([each["set"].replace("_", " "), f"{known:.5f}" if known else "", f"{code['value']:.5f}",
                     f"{code['kind']}, {code['standing']}", *held, *measure])
    return ["set", "known box dimension", "`code.dimension()`", "", "boxes at 256²", "boxes at 1024²", "information",
            "correlation"], rows


MAKERS: dict[str, Callable[..., tuple[list[str], Rows]]] = {each.__name__: each for each in (
    suite, codes, parts, ablation, paper_ablations, paper.function_count, paper.real, paper.convergence, worked_example,
    pictures.textbook, pictures.trees, pictures.binary, pictures.shapes,
    pictures.photographs, pictures.photographs_in_colour, pictures.equal_bytes, pictures.density, pictures.tone_curves,
    pictures.windows, pictures.seen, pictures.growth_parts, pictures.fractaldb, pictures.verdicts, pictures.misjudged,
    classics, datasets, speed, shares, dimensions)}
