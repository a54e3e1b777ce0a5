"""The tables of results on the site, from the files under benchmarks/results.

A line `[table: MAKER FOLDER ...]` of a page becomes a table: the maker is a function of this module, and each folder or
file is one under benchmarks/results. So a page never states a figure that its file does not hold.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import pandas as pd
import yaml

ROOT = Path(__file__).parents[1]
RESULTS, PARTS = ROOT / "benchmarks" / "results", ROOT / "conf" / "without"
FULL = "nothing"                   # the name of the whole method among the parts
Rows = list[list[str]]

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


def lines_of(path: Path) -> list[dict[str, Any]]:
    """The records of a file of JSON lines; of a folder, those of its fits."""
    if path.is_dir():
        path = next(path / name for name in ("codes.jsonl", "fits.jsonl") if (path / name).exists())
    return [json.loads(line) for line in path.read_text().splitlines()]


def frame(path: Path) -> pd.DataFrame:
    """The records as a table."""
    return pd.DataFrame(lines_of(path))


def short(value: float, digits: int = 3, sign: str = "") -> str:
    """A number as .976, with a true minus sign; empty if it is absent."""
    text = "" if pd.isna(value) else f"{value:{sign}.{digits}f}".replace("-", "−")
    return text.replace("0.", ".", 1) if text.lstrip("+−").startswith("0.") else text


def share(flags: Iterable[Any]) -> str:
    """How many of them hold, as 44 of 46."""
    flags = [bool(flag) for flag in flags]
    return f"{sum(flags)} of {len(flags)}"


def percent(flags: pd.Series) -> str:
    return f"{flags.astype(bool).mean():.0%}"


def interval(low: float, high: float, digits: int = 3, sign: str = "") -> str:
    return "" if pd.isna(low) else f" [{short(low, digits, sign)}, {short(high, digits, sign)}]"


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
    fits = pd.concat([frame(folder) for folder in folders], ignore_index=True)
    for old, name in {"fractal": "target", "f1_box": "f1", "exact": "recovered"}.items():
        fits = fits.rename(columns={old: name}) if name not in fits else fits
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


def _difference(without: pd.DataFrame, whole: pd.DataFrame) -> str:
    from fractal_exp.evaluation.summary import bootstrap_interval

    both = without.index.intersection(whole.index)
    if both.empty:
        return ""
    change = (without.loc[both, "f1"] - whole.loc[both, "f1"]).to_numpy(float)
    low, high = bootstrap_interval(change)
    mean, gained = short(change.mean(), sign="+"), int(without.loc[both, "recovered"].sum()
                                                       - whole.loc[both, "recovered"].sum())
    mark = "**" if low > 0 or high < 0 else ""
    return f"{mark}{mean}{mark}{interval(low, high, sign='+')}<br>{short(gained, 0, '+') if gained else '±0'}"


def worked_example(path: Path) -> tuple[list[str], Rows]:
    """The code after each stage of one search. The restarts of a round are one row."""
    stages = lines_of(path)[-1]["figures"]["stages"]
    last = [stage for stage, after in zip(stages, [*stages[1:], {}], strict=True)
            if stage["stage"] != after.get("stage")]
    return ["after", "seconds", "maps", "true maps found", "F1"], [
        [NAMES.get(stage["stage"], stage["stage"]), f"{stage['seconds']:.0f}", str(stage["maps"]), str(stage["found"]),
         short(stage["f1"])] for stage in last]


def textbook(folder: Path) -> tuple[list[str], Rows]:
    """Textbook fractals with a true code, of depth four or more and the deepest of each."""
    fits = frame(folder)
    fits = fits[(fits["role"] == "reporting") & fits["recovered"].notna() & ~(fits["depth"] < 4)]
    chosen = [fits, fits[fits["deepest"].fillna(False).astype(bool)]]
    meanings: dict[str, Callable[[pd.DataFrame], Iterable[Any]]] = {
        "recovered": lambda each: each["recovered"], "exact: the true maps": lambda each: each["exact"],
        "IoU with the true attractor ≥ .95": lambda each: each["iou_1px"] >= 0.95,
        "F1 with the true attractor ≥ .995": lambda each: each["f1_truth"] >= 0.995}
    return ["", "depth ≥ 4", "the deepest of each"], [
        [name, *(share(holds(each)) for each in chosen)] for name, holds in meanings.items()] + [
        ["seconds of one core", *(f"{each['core_seconds'].mean():.0f}" for each in chosen)]]


def trees(*folders: Path) -> tuple[list[str], Rows]:
    """Drawings of trees and plants."""
    fits = pd.concat([frame(folder) for folder in folders])
    rows = []
    for (kind, role), each in fits.groupby(["set", "role"]):
        good = each["likeness"] >= 0.98
        rows.append([f"{str(kind).replace('_', ' ')}, for {role}", f"{len(each)}", short(each["likeness"].mean()),
                     f"{good.sum()}", f"{(good & (each['maps'] <= each['true_maps'] + 1)).sum()}",
                     f"{each['recovered'].sum()}"])
    return ["", "pictures", "likeness", "likeness ≥ .98", "the same, with at most one map more than the truth",
            "recovered"], rows


def binary(*folders: Path) -> tuple[list[str], Rows]:
    """The black and white suite, by limit of time and role."""
    rows = []
    for folder in folders:
        fits = frame(folder)
        roles = [(f"for {role}", each) for role, each in fits.groupby("role")] if fits["role"].nunique() > 1 else []
        rows += [[f"{fits['limit'].iloc[0]:.0f} s", name, f"{len(each)}", short(each["f1_box"].mean()),
                  short(each["f1_frame"].mean()), short(each["f1_input"].mean()), percent(each["f1_box"] >= 0.97),
                  percent(each["exact"]), f"{each['core_seconds'].mean():.0f}"]
                 for name, each in [*roles, ("all" if roles else f"for {fits['role'].iloc[0]}", fits)]]
    return ["limit", "images", "number", "F1, own box", "F1, frame of the input", "F1 on the input", "F1 ≥ .97",
            "exact", "seconds"], rows


def shapes(*folders: Path) -> tuple[list[str], Rows]:
    """Shapes that are not self-similar, by number of maps and role."""
    rows = []
    for folder in folders:
        fits = frame(folder)
        rows += [[f"{fits['maps'].iloc[0]}", f"for {role}", f"{len(each)}", short(each["f1_input"].mean()),
                  short(each["f1_input"].min()), short(each["f1_paving"].mean()), f"{each['core_seconds'].mean():.0f}"]
                 for role, each in [*fits.groupby("role"), ("both", fits)]]
    return ["maps", "shapes", "number", "F1 within a pixel", "worst", "plain paving", "seconds"], rows


def photographs(path: Path) -> tuple[list[str], Rows]:
    """Photographs of plants as small maps: the newest record of each role and number of maps."""
    newest = {(line["figures"]["role"], maps): (line["figures"]["fits"], means)
              for line in lines_of(path) for maps, means in line["figures"]["means"].items()
              if "colour_psnr" not in means}
    rows = [["not told" if maps == "0" else maps, f"for {role}", f"{sum(fit['maps'] == int(maps) for fit in fits)}",
             *(f"{mean:.{digits}f}{interval(low, high, digits)}"
               for digits, (mean, low, high) in zip((2, 1, 0), means.values(), strict=True))]
            for (role, maps), (fits, means) in newest.items()]
    return ["maps", "pictures", "number", "SSIM inside", "PSNR", "seconds of a core"], rows


def photographs_in_colour(path: Path) -> tuple[list[str], Rows]:
    """The same in colour: the newest record of each role and number of maps."""
    newest = {(figures["role"], maps): means for line in lines_of(path) for figures in [line["figures"]]
              for maps, means in figures["means"].items() if "colour_psnr" in means}
    columns = {"colour_psnr": 1, "colour_error": 1, "seconds": 0}
    rows = [[maps, f"for {role}", *(f"{means[name][0]:.{digits}f}{interval(*means[name][1:], digits)}"
                                    for name, digits in columns.items())] for (role, maps), means in newest.items()]
    return ["maps", "pictures", "PSNR in colour", "difference of colours (CIEDE2000)", "seconds of a core"], rows


def equal_bytes(folder: Path) -> tuple[list[str], Rows]:
    """Codes of shapes beside other ways to write them with as many bytes."""
    from benchmarks.pictures.equal_bytes import SCORES, summary

    return ["", "pictures", "bytes", "F1: code", "JBIG", "outlines", "closest: code / JBIG / outlines",
            "bytes of JBIG without loss"], [
        [row["group"], str(row["pictures"]), f"{row['bytes']:.0f}", *(short(row[way]) for way in SCORES),
         " / ".join(str(row[f"{way} closest"]) for way in SCORES), f"{row['lossless']:.0f}"]
        for row in summary(frame(folder)).to_dict("records")]


def density(folder: Path) -> tuple[list[str], Rows]:
    """Published density maps, beside the truth and the published method."""
    from benchmarks.pictures.density_maps import PUBLISHED

    def cells(scores: Mapping[str, float]) -> list[str]:
        return [short(scores["chamfer"], 4), f"{scores['sse']:.1e}", short(scores["covered"])]

    fits = frame(folder)
    truth = {name: fits[f"floor_{name}"].mean() for name in ("chamfer", "sse", "covered")}
    return ["", "Chamfer", "density SSE", "covered within 2 px", "codes with all four maps", "seconds"], [
        ["collage search", *cells(fits[["chamfer", "sse", "covered"]].mean()), share(fits["exact"]),
         f"{fits['core_seconds'].mean():.1f}"],
        ["the truth against itself", *cells(truth), "", ""],
        *([f"published: {name}", *cells(scores), "", ""] for name, scores in PUBLISHED.items())]


def tone_curves(folder: Path) -> tuple[list[str], Rows]:
    """Densities through tone curves, by curve and role."""
    names = {"gamma": "gamma", "logarithm": "logarithm", "flame": "both"}
    rows = [[f"{names[str(curve)]}, for {role}", f"{len(each)}", short(each["f1_truth"].mean()),
             f"{each['recovered'].sum()}"] for (role, curve), each in frame(folder).groupby(["role", "curve"])]
    return ["", "pictures", "F1 with the true attractor", "recovered"], rows


def windows(folder: Path) -> tuple[list[str], Rows]:
    """Parts of shapes: cuts, of pictures that others drew and of the suite, and zooms."""
    fits = frame(folder)
    fits = fits.assign(suite=fits["picture"].str.contains("suite"))
    rows = [[str(kind), "random suite" if of_suite else "textbook and classics", f"{len(each)}",
             short(each["f1_known"].mean()), short(each["f1_truth"].mean()), f"{each['recovered'].sum()}"]
            for (kind, of_suite), each in fits.groupby(["kind", "suite"])]
    return ["", "", "pictures", "F1 in what is shown", "F1 of the whole attractor", "recovered"], rows


def fractaldb(*folders: Path) -> tuple[list[str], Rows]:
    """Codes of FractalDB-1k for reporting, by kind of picture, number of maps and contraction."""
    from benchmarks.pictures.tables import contraction

    rows = []
    for folder in folders:
        fits = frame(folder)
        fits = fits[(fits["role"] == "reporting") & fits["f1_truth"].notna()]
        groups = [("all", fits), *((f"{count} maps", each) for count, each in fits.groupby("true_maps")),
                  *((f"contract: {kind}", each) for kind, each in fits.groupby(contraction(fits)))]
        rows += [[str(fits["set"].iloc[0]).removeprefix("fractaldb_"), str(which), f"{len(each)}",
                  short(each["f1_truth"].mean()), short(each["f1_input"].mean()), f"{each['density_sse'].mean():.1e}",
                  f"{each['floor_sse'].mean():.1e}", f"{each['recovered'].sum()}", f"{each['exact'].sum()}",
                  f"{each['core_seconds'].mean():.0f}"] for which, each in groups]
    return ["picture", "codes", "number", "F1 with the true attractor", "F1 on the input", "density SSE",
            "of the truth", "recovered", "of them exact", "seconds of a core"], rows


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


MAKERS: dict[str, Callable[..., tuple[list[str], Rows]]] = {
    each.__name__: each for each in (suite, codes, parts, ablation, worked_example, textbook, trees, binary, shapes,
                                     photographs, photographs_in_colour, equal_bytes, density, tone_curves, windows,
                                     fractaldb, classics, datasets, speed, dimensions)}
