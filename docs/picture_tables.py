"""The tables of pictures that others drew, and of the sets that stand for them: makers for `docs.tables`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from .cells import Rows, frame, interval, lines_of, percent, share, short

# Pairs of `benchmarks.verdicts` that a page shows, and what they are.
SHOWN_PAIRS = {
    "crosses of 0.02, grey/true": "crosses at every scale, grey: the true code",
    "crosses of 0.02, grey/filled square": "the same: a filled square",
    "T-square of depth 7/filled square": "T-square of seven steps: a filled square",
    "tone_curves/fern-gamma": "fern through a gamma: the true code",
    "textbook/cantor_set-3-black": "Cantor set of three steps: the true code",
    "tone_curves/fern-logarithm": "fern by logarithms: wrong fronds at the foot",
    "textbook/maple_leaf_dots-red": "maple leaf of dots: the true code",
    "textbook/cyclosorus_dots-green-jpeg": "cyclosorus of dots, as JPEG: one map too many",
    "textbook/pythagoras-13-red": "Pythagoras tree, 13 steps: filled where squares are",
    "tone_curves/maple_leaf-flame": "maple leaf as a flame: a white leaf",
    "trees/birch/slab": "photographed birch: a slab", "trees/holm_oak/slab": "photographed oak: a slab"}


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
        rows += [[f"{fits['maps'].iloc[0]}", f"for {role}", f"{len(each)}", short(each["f1_light"].mean()),
                  short(each["f1_light"].min()), short(each["f1_dark"].dropna().mean()), short(each["f1_input"].mean()),
                  short(each["f1_paving"].mean()), f"{each['core_seconds'].mean():.0f}"]
                 for role, each in [*fits.groupby("role"), ("both", fits)]]
    return ["maps", "shapes", "number", "F1 of the light", "worst", "F1 of the dark", "F1 by area", "plain paving",
            "seconds"], rows


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


def windows(*folders: Path) -> tuple[list[str], Rows]:
    """Parts of shapes: cuts, of pictures that others drew and of the suite, and zooms, called parts by their user or
    not; from the truth or not."""
    from benchmarks.pictures.tables import continued

    rows = []
    for folder in folders:
        fits = frame(folder)
        fits = fits.assign(suite=fits["picture"].str.contains("suite"),
                           told=[", called a part" if each.get("frame") == "part" else "" for each in fits["options"]])
        begin = "the true code" if fits["from_truth"].all() else "nothing"
        rows += [[begin, f"{kind}{told}", "random suite" if of_suite else "textbook and classics", f"{len(each)}",
                  short(each["f1_known"].mean()), short(each["f1_truth"].mean()), f"{continued(each).sum()}",
                  f"{each['recovered'].sum()}"]
                 for (kind, told, of_suite), each in fits.groupby(["kind", "told", "suite"])]
    return ["begun with", "", "", "pictures", "F1 in what is shown", "F1 of the whole attractor", "continued",
            "recovered"], rows


def seen(*folders: Path) -> tuple[list[str], Rows]:
    """Photographed paper and plots, by kind."""
    rows = []
    for folder in folders:
        fits = frame(folder)
        rows += [[str(fits["set"].iloc[0]), str(kind), f"{len(each)}", short(each["f1_truth"].mean()),
                  f"{each['recovered'].sum()}", f"{each['core_seconds'].mean():.0f}"]
                 for kind, each in [("all", fits), *fits.groupby("kind", sort=False)]]
    return ["set", "kind", "pictures", "F1 with the true attractor", "recovered", "seconds of a core"], rows


def growth_parts(path: Path) -> tuple[list[str], Rows]:
    """Photographs as small maps, with other parts in the place of growth's own: SSIM inside and PSNR."""
    means = lines_of(path)[-1]["figures"]["means"]
    cells = {tuple(name.removesuffix(" maps").rsplit(", ", 1)): row for name, row in means.items()}
    counts = list(dict.fromkeys(count for _, count in cells))
    rows = [[part, *(f"{cells[part, count]['ssim'][0]:.2f} / {cells[part, count]['psnr'][0]:.1f}" for count in counts)]
            for part in dict.fromkeys(part for part, _ in cells)]
    return ["", *(f"{count} maps" for count in counts)], rows


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
                  *(share(verdict["kind"] == "recovered" for verdict in each["verdict"][each["recovered"] == right])
                    for right in (True, False)),
                  f"{each['core_seconds'].mean():.0f}"] for which, each in groups]
    return ["picture", "codes", "number", "F1 with the true attractor", "F1 on the input", "density SSE",
            "of the truth", "recovered", "of them exact", "called recovered, of these", "of the others",
            "seconds of a core"], rows


def verdicts(path: Path) -> tuple[list[str], Rows]:
    """Some of the pairs that a person looked at: the figures on which the verdict stands, both verdicts."""
    pairs = {row["pair"]: row for row in lines_of(path)[-1]["figures"]["pairs"] if row["group"] == "seen"}
    rows = []
    for name, about in SHOWN_PAIRS.items():
        pair = pairs[name]
        dark = "–" if pair["f1_dark"] is None else short(pair["f1_dark"], 2)
        differs = "" if pair["verdict"] == pair["person"] else f" (the program: {pair['verdict']})"
        rows.append([about, short(pair["f1_1px"]), f"{short(pair['ssim'], 2)} of {short(pair['ssim_chance'], 2)}", dark,
                     short(pair["ssim_share"], 2), f"{pair['person']}{differs}"])
    return ["picture: drawing", "F1 within a pixel", "`ssim` of `ssim_chance`", "`f1_dark`", "`ssim_share`",
            "a person says"], rows


def misjudged(path: Path) -> tuple[list[str], Rows]:
    """How many pairs of each kind the verdict and a person, or the truth, tell apart."""
    pairs = pd.DataFrame(lines_of(path)[-1]["figures"]["pairs"])
    is_plot, is_other = pairs["pair"].str.startswith("plot/"), pairs["pair"].str.endswith("other shares")
    is_recovered, right = pairs["verdict"] == "recovered", pairs["group"] == "right"
    wrong, seen = pairs["group"] == "wrong", pairs["group"] == "seen"
    kinds = [("a person looked at both", seen, is_recovered != (pairs["person"] == "recovered")),
             ("right codes", right & ~is_plot, ~is_recovered),
             ("right codes, plots of dots", right & is_plot, ~is_recovered),
             ("wrong codes", wrong & ~is_plot, is_recovered),
             ("wrong codes, plots of dots", wrong & is_plot & ~is_other, is_recovered),
             ("right maps that share out the dots wrongly", wrong & is_other, is_recovered)]
    return ["pairs", "misjudged"], [[name, share(fails[chosen])] for name, chosen, fails in kinds]
