"""Tables of `report.summary` as Markdown, LaTeX and CSV."""

from __future__ import annotations

import re

import numpy as np
import pandas as pd

from .published import AS_PUBLISHED, TABLES
from .report import MEASURED, PUBLISHED, TRIVIAL, Sweep, agreement, same_rows

TITLES = {"f1": "F1", "iou": "IoU", "f1_frame": "F1, frame", "iou_frame": "IoU, frame", "psnr": "PSNR", "ssim": "SSIM",
          "lpips": "LPIPS"}
DIGITS = {"psnr": 2}
RELEASED = "released"  # the kind of views on which the published rows were judged


def describe(sweep: Sweep) -> str:
    """One line on what was measured: scale, samples, the meaning of the brackets."""
    samples, views = sweep.jobs["sample"].dropna().nunique(), f" (views={sweep.views})" if sweep.views else ""
    empty, judged = (int(sweep.jobs[f"views_{name}"].sum()) for name in ("empty", "judged"))
    means = (f"1 sample, mean over views{views}" if samples == 1 else
             f"{samples} samples, mean over views{views} and samples [bootstrap 95% interval over samples]")
    return (f"measured at {sweep.scale} scale on {means}"
            + ("; codes are aligned by their boxes, but stay in the frame of the input in the columns named frame"
               if "f1_frame" in sweep.metrics else "")
            + (f"; {empty} of {empty + judged} views are empty in truth and result and are left out" if empty else "")
            + (f"; LPIPS with the backbone of {sweep.perceptual}" if "lpips" in sweep.metrics else "")
            + "".join(f"; {name} is no LPIPS, lower is better" for name in sweep.metrics if name.endswith("_distance")))


def cells(sweep: Sweep, table: pd.DataFrame, source: str) -> tuple[list[str], list[list[str]]]:
    """Head and rows of the part of the table from one source, as texts, without empty columns."""
    part = table[table["source"] == source]
    names = [name for name in [*sweep.metrics, *(set(TITLES) - set(sweep.metrics))]
             if name in part and part[name].notna().any()]
    names = sorted(names, key=lambda name: list(TITLES).index(name) if name in TITLES else len(TITLES))
    columns = {"": part["row"].astype(str).tolist()}
    for name in names:
        columns[TITLES.get(name, name)] = [_score(line, name) for _, line in part.iterrows()]
    if source == MEASURED:
        if sweep.baseline:
            columns[f"F1 above {sweep.baseline}"] = [
                f"{int(line['wins'])}/{int(line['compared'])}" if line.get("compared", np.nan) > 0 else "–"
                for _, line in part.iterrows()]
            columns[f"F1 minus {sweep.baseline}"] = [_gain(line) for _, line in part.iterrows()]
        columns["jobs"] = [_jobs(line) for _, line in part.iterrows()]
    if source == MEASURED and part["evaluations"].notna().any():
        columns["images drawn"] = [f"{count:.0f}" if np.isfinite(count) else "–" for count in part["evaluations"]]
    if "seconds" in part and part["seconds"].notna().any():
        columns["time"] = [_time(seconds) for seconds in part["seconds"]]
    return list(columns), [list(row) for row in zip(*columns.values(), strict=True)]


def _score(line: pd.Series, name: str) -> str:
    if not np.isfinite(line.get(name, np.nan)):
        return "–"
    digits = DIGITS.get(name, 3)
    low, high = line.get(f"{name}_low", np.nan), line.get(f"{name}_high", np.nan)
    return f"{line[name]:.{digits}f}" + (f" [{low:.{digits}f}, {high:.{digits}f}]" if np.isfinite(low) else "")


def _gain(line: pd.Series) -> str:
    """The paired difference with its interval, bold if zero is outside."""
    gain, low, high = (line.get(name, np.nan) for name in ("gain", "gain_low", "gain_high"))
    if not np.isfinite(gain):
        return "–"
    text = f"{gain:+.3f}" + (f" [{low:+.3f}, {high:+.3f}]" if np.isfinite(low) else "")
    return f"**{text}**" if low > 0 or high < 0 else text


def _jobs(line: pd.Series) -> str:
    extra = "".join(f", {int(line[name])} {name}" for name in ("failed", "unfinished") if line[name])
    return f"{int(line['finished'])}{extra}"


def _time(seconds: float) -> str:
    if not np.isfinite(seconds):
        return "–"
    if seconds < 1:
        return f"{seconds * 1000:.0f} ms"
    return f"{seconds:.0f} s" if seconds < 600 else f"{seconds / 60:.0f} min"


def _parts(sweep: Sweep, table: pd.DataFrame) -> list[tuple[str, list[str], list[list[str]]]]:
    captions = {MEASURED: describe(sweep), TRIVIAL: "trivial images on the same views"
                + (", and the truth itself as the ceiling" if "metric.truth/f1" in sweep.jobs else "")}
    if sweep.published:
        captions[PUBLISHED] = f"published, not measured here ({TABLES[sweep.published].source})" + (
            "" if sweep.views == RELEASED else
            f"; on the views of the authors' program, not those above: only rows with views={RELEASED} may be compared "
            "with these")
    return [(caption, *cells(sweep, table, source)) for source, caption in captions.items()
            if (table["source"] == source).any()]


def failures(sweep: Sweep) -> list[str]:
    """A line for each job that did not finish, with the reason."""
    lost = sweep.jobs[sweep.jobs["status"] != "FINISHED"]
    return [f"{line.job}: {line.status.lower()}{f': {line.reason}' if line.reason else ''}"
            for line in lost.itertuples()]


def order_of_rows(table: pd.DataFrame, baseline: str | None = None) -> list[str]:
    """A line on how the order of the measured rows agrees with the published one, where that can be said."""
    tau, chance, rows = agreement(table, baseline)
    measured = set(table.loc[table["source"] == MEASURED, "row"])
    stand_in = "".join(f" {mine} stands for {name}." for mine, name in AS_PUBLISHED.items() if mine in measured)
    return [] if np.isnan(tau) else [f"Order of these {rows} rows by F1, against the published order: Kendall's tau "
                                     f"{tau:.2f} (p = {chance:.2g}).{stand_in}"]


def markdown(sweep: Sweep, table: pd.DataFrame) -> str:
    """The whole table as Markdown: measured, trivial and published rows separately, then the unfinished jobs."""
    blocks = [f"# {sweep.title}"]
    for caption, head, rows in _parts(sweep, table):
        widths = [max(len(text) for text in column) for column in zip(head, *rows, strict=True)]
        padded = [[text.ljust(width) for text, width in zip(line, widths, strict=True)]
                  for line in (head, ["-" * width for width in widths], *rows)]
        blocks += [f"{caption[:1].upper()}{caption[1:]}:", "\n".join(f"| {' | '.join(line)} |" for line in padded)]
    blocks += [f"The same results, number for number: {', '.join(rows)}." for rows in same_rows(sweep)]
    blocks += order_of_rows(table, sweep.baseline)
    if lost := failures(sweep):
        blocks.append("Not finished:\n\n" + "\n".join(f"- {line}" for line in lost))
    return "\n\n".join(blocks) + "\n"


def latex(sweep: Sweep, table: pd.DataFrame) -> str:
    """The whole table as LaTeX: a table environment that needs the package booktabs."""
    parts = _parts(sweep, table)
    order = ["", *TITLES.values()]  # scores that only published rows have stay among the scores
    heads = sorted(dict.fromkeys(title for _, head, _ in parts for title in head),
                   key=lambda title: order.index(title) if title in order else len(order))
    lines = [r"\begin{table}", r"\centering", rf"\caption{{{_escape(f'{sweep.title}: {describe(sweep)}')}.}}",
             rf"\label{{tab:{sweep.study}}}", rf"\begin{{tabular}}{{l{'r' * (len(heads) - 1)}}}", r"\toprule",
             " & ".join(_escape(title) for title in heads) + r" \\"]
    for number, (caption, head, rows) in enumerate(parts):
        lines.append(r"\midrule")
        if number:
            lines.append(rf"\multicolumn{{{len(heads)}}}{{p{{.95\linewidth}}}}{{\footnotesize {_escape(caption)}}} \\")
        for row in rows:
            known = dict(zip(head, row, strict=True))
            lines.append(" & ".join(_escape(known.get(title, "")) for title in heads) + r" \\")
    for said in order_of_rows(table, sweep.baseline):
        lines.append(rf"\midrule \multicolumn{{{len(heads)}}}{{l}}{{\footnotesize {_escape(said)}}} \\")
    return "\n".join([*lines, r"\bottomrule", r"\end{tabular}", r"\end{table}", ""])


def _escape(text: str) -> str:
    for plain, escaped in {"\\": r"\textbackslash ", "_": r"\_", "%": r"\%", "&": r"\&", "#": r"\#", "²": r"$^2$",
                           "–": "--"}.items():
        text = text.replace(plain, escaped)
    return re.sub(r"\*\*(.+?)\*\*", r"\\textbf{\1}", text)
