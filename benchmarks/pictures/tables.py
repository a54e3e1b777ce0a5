"""The tables of each set: from a row a fit to rows by fractal, depth, colour or number of maps."""

from __future__ import annotations

from collections.abc import Callable

import pandas as pd

from .density_maps import PUBLISHED
from .judging import EQUIVALENT_F1

GOOD_IOU = 0.95
LEAST_DEPTH = 4
BYTES_A_MAP = 12           # six numbers of 16 bits


def textbook(fits: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """By fractal, by depth and by colour; overall for depth 4 and more, and for the deepest.

    The rows "with a true code" leave out fractals that no code of a few maps draws.
    """
    fits = fits.assign(depth=fits["depth"].astype("Int64"))
    chosen = {"depth 4 and more, and scatter plots": fits[~(fits["depth"] < LEAST_DEPTH).fillna(False).astype(bool)],
              "the deepest of each": fits[fits["deepest"].fillna(False).astype(bool)], "all": fits}
    overall = pd.DataFrame([{"pictures": f"{name}{which}", **_textbook_row(rows[keep(rows)])}
                            for name, rows in chosen.items()
                            for which, keep in (("", _any), (", with a true code", _with_code))])
    drawn = fits[fits["depth"].notna()]
    by_depth = [{"fractal": family, "depth": depth, **_textbook_row(rows)}
                for (family, depth), rows in drawn.groupby(["family", "depth"], sort=False)]
    by_plot = [{"fractal": family, "depth": "dots", **_textbook_row(rows)}
               for family, rows in fits[fits["depth"].isna()].groupby("family", sort=False)]
    return {"Overall": overall, "By fractal and depth": pd.DataFrame(by_depth + by_plot),
            "By colour": _grouped(fits, "ink", _textbook_row), "By file": _files(fits)}


def _any(rows: pd.DataFrame) -> pd.Series:
    return pd.Series(True, rows.index)


def _with_code(rows: pd.DataFrame) -> pd.Series:
    return rows["recovered"].notna()


def _textbook_row(rows: pd.DataFrame) -> dict[str, object]:
    with_code = rows[_with_code(rows)]
    return {"n": len(rows), "IoU": _mean(rows["iou"]), "best IoU within 1 px": _mean(rows["iou_1px"]),
            f"IoU >= {GOOD_IOU}": _mean(rows["iou"].fillna(0) >= GOOD_IOU),
            f"best IoU >= {GOOD_IOU}": _mean(rows["iou_1px"].fillna(0) >= GOOD_IOU),
            "F1 within 1 px": _mean(rows["f1_truth"]),
            f"F1 >= {EQUIVALENT_F1}": _mean(rows["f1_truth"].fillna(0) >= EQUIVALENT_F1),
            "recovered": _mean(with_code["recovered"]),
            "exact": _mean(with_code["exact"]), "F1 on the input": _mean(rows["f1_input"]),
            "maps": _mean(rows["maps"], 1), "true maps": _mean(rows["true_maps"], 1), "core s": _core(rows)}


def _files(fits: pd.DataFrame) -> pd.DataFrame:
    """PNG and JPEG of the same pictures, where both were fitted."""
    fits = fits.assign(twin=fits["picture"].str.removesuffix("-jpeg"))
    both = fits[fits.groupby("twin")["jpeg"].transform("nunique") == 2]
    return pd.DataFrame([{"file": "JPEG" if jpeg else "PNG", **_textbook_row(rows)}
                         for jpeg, rows in both.groupby("jpeg")])


def windows(fits: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """By what is shown of the shape: cuts, and zooms by their factor. continued: see `continued`."""
    return {"By part": _grouped(fits, "kind", _window_row)}


def continued(fits: pd.DataFrame) -> pd.Series[bool]:
    """Which codes go on where the picture shows nothing as a code of the true one's simplicity does: they draw what is
    shown to within a pixel, with no more maps than the truth. A close view may leave room for several such codes."""
    return (fits["f1_known"] >= EQUIVALENT_F1) & (fits["maps"] <= fits["true_maps"])


def _window_row(rows: pd.DataFrame) -> dict[str, object]:
    return {"n": len(rows), "read as a part": _mean(rows["told"]), "continued": _mean(continued(rows)),
            "recovered": _mean(rows["recovered"]), "exact": _mean(rows["exact"]),
            "F1 in what is shown": _mean(rows["f1_known"]),
            "F1 of the whole attractor": _mean(rows["f1_truth"]), "maps": _mean(rows["maps"], 1),
            "true maps": _mean(rows["true_maps"], 1), "core s": _core(rows)}


def density(fits: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """Beside the published rows and the floor, which is the truth against itself."""
    rows: list[dict[str, object]] = [{"method": f"published: {name}", "n": 256, **{
        key: f"{value:.3g}" for key, value in row.items()}} for name, row in PUBLISHED.items()]
    for published, group in fits.groupby("published", sort=False):
        kind = "the published maps" if published else "maps drawn here"
        for name, prefix in (("here", ""), ("floor, truth against truth", "floor_")):
            rows.append({"method": f"{name}: {kind}", "n": len(group),
                         **{key: f"{group[prefix + key].mean():.3g}" for key in ("sse", "chamfer", "hd95", "covered")}})
            if not prefix:
                rows[-1] |= {"recovered": _mean(group["recovered"]), "exact": _mean(group["exact"]),
                             "core s": _core(group), "wall s": _mean(group["wall_seconds"], 1)}
    return {"Density maps": pd.DataFrame(rows).fillna("")}


def shapes(fits: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """Likeness by number of maps, and shape by shape, beside a plain paving with as many maps."""
    classes = pd.cut(fits["maps"].astype(float), [0, 8, 16, 32, 64, 128, 256, float("inf")],
                     labels=["1-8", "9-16", "17-32", "33-64", "65-128", "129-256", "257-"])
    by_maps = _grouped(fits.assign(**{"number of maps": classes.astype(str)}), "number of maps", _shape_row)
    each = pd.DataFrame([{"shape": row["picture"], "role": row["role"], **_shape_row(fits.loc[[index]]),
                          "licence": row["licence"]} for index, row in fits.iterrows()])
    return {"Overall": pd.DataFrame([_shape_row(fits)]), "By number of maps": by_maps,
            "Shapes": each.drop(columns=["n", "below paving", "worst"])}


def _shape_row(rows: pd.DataFrame) -> dict[str, object]:
    return {"n": len(rows), "maps": _mean(rows["maps"], 1), "bytes": _mean(BYTES_A_MAP * rows["maps"], 0),
            "F1 of the light": _mean(rows["f1_light"]), "worst": f"{rows['f1_light'].min():.3f}",
            "F1 of the dark": _mean(rows["f1_dark"].dropna()), "F1 by area": _mean(rows["f1_input"]),
            "paving F1": _mean(rows["f1_paving"]), "below paving": int((rows["f1_input"] < rows["f1_paving"]).sum()),
            "core s": _core(rows), "wall s": _mean(rows["wall_seconds"], 1)}


def binary(fits: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """F1 in both frames, overall and by role."""
    overall = pd.DataFrame([{"role": "all", **_binary_row(fits)}])
    return {"Binary suite": pd.concat([overall, _grouped(fits, "role", _binary_row)], ignore_index=True)}


def _binary_row(rows: pd.DataFrame) -> dict[str, object]:
    return {"n": len(rows), "F1 by box": _mean(rows["f1_box"]), "F1 by frame": _mean(rows["f1_frame"]),
            "at the ceiling (F1 >= .97)": _mean(rows["f1_box"].fillna(0) >= 0.97), "exact": _mean(rows["exact"]),
            "F1 on the input": _mean(rows["f1_input"]), "core s": _core(rows)}


def tone_curves(fits: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """By curve, overall and picture by picture."""
    overall = pd.DataFrame([{"curve": "all", **_curve_row(fits)}])
    each = fits[["picture", "f1_truth", "recovered", "missed", "maps", "true_maps", "core_seconds"]]
    return {"Tone curves": pd.concat([overall, _grouped(fits, "curve", _curve_row)], ignore_index=True),
            "Pictures": each}


def _curve_row(rows: pd.DataFrame) -> dict[str, object]:
    return {"n": len(rows), "F1 within 1 px": _mean(rows["f1_truth"]), "recovered": _mean(rows["recovered"]),
            "exact": _mean(rows["exact"]), "true maps missed": _mean(rows["missed"], 1), "core s": _core(rows)}


def seen(fits: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """Photographs of paper or plots, overall and by kind."""
    overall = pd.DataFrame([{"kind": "all", **_curve_row(fits)}])
    return {"Pictures": pd.concat([overall, _grouped(fits, "kind", _curve_row)], ignore_index=True)}


def trees(fits: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """Overall and tree by tree."""
    each = fits[["picture", "depth", "likeness", "f1_truth", "recovered", "missed", "maps", "true_maps",
                 "core_seconds"]]
    return {"Trees": _grouped(fits, "role", _tree_row), "Each": each.round(3)}


def _tree_row(rows: pd.DataFrame) -> dict[str, object]:
    return {"n": len(rows), "likeness": _mean(rows["likeness"]),
            "F1 with the true attractor": _mean(rows["f1_truth"]), "recovered": _mean(rows["recovered"]),
            "maps": _mean(rows["maps"], 1), "true maps": _mean(rows["true_maps"], 1), "core s": _core(rows)}


def fractaldb(fits: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """Overall, by the true number of maps and by how the true maps contract."""
    fits = fits.assign(**{"true maps": fits["true_maps"], "maps that contract": contraction(fits)})
    fits = fits.sort_values("true maps")
    return {"FractalDB-1k": pd.DataFrame([_fractaldb_row(fits)]),
            "By number of maps": _grouped(fits, "true maps", _fractaldb_row),
            "By contraction": _grouped(fits, "maps that contract", _fractaldb_row)}


def contraction(fits: pd.DataFrame) -> pd.Series:
    """How the true maps of fits contract, in words."""
    kinds = fits["contraction"].map({"norm": "in a norm, but a map stretches", "average": "on average only"})
    return kinds.where(fits["largest"] >= 1, "every map, in every direction")


def _fractaldb_row(rows: pd.DataFrame) -> dict[str, object]:
    return {"n": len(rows), "F1 within 1 px": _mean(rows["f1_truth"]),
            "density SSE": f"{rows['density_sse'].mean():.2g}",
            "truth against itself": f"{rows['floor_sse'].mean():.2g}", "recovered": _mean(rows["recovered"]),
            "exact": _mean(rows["exact"]), "F1 on the input": _mean(rows["f1_input"]),
            "of the truth": _mean(rows["f1_input_truth"]), "maps": _mean(rows["maps"], 1),
            "true maps missed": _mean(rows["missed"], 1), "core s": _core(rows)}


def _grouped(fits: pd.DataFrame, key: str, row: Callable[[pd.DataFrame], dict[str, object]]) -> pd.DataFrame:
    return pd.DataFrame([{key: name, **row(rows)} for name, rows in fits.groupby(key, sort=False)])


def _mean(values: pd.Series, digits: int = 3) -> str:
    mean = pd.to_numeric(values.dropna().astype(float)).mean()
    return "" if pd.isna(mean) else f"{mean:.{digits}f}"


def _core(rows: pd.DataFrame) -> str:
    return _mean(rows["core_seconds"], 1)
