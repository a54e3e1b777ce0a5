"""Keep what a sweep has found: one line a fit with its code and commit, and the report, to be committed.

    fractal-sweep comparisons launch=joblib sweep.count=20 seconds=180      the fits; hours, restartable
    python -m benchmarks.comparisons                                        benchmarks/results/comparisons_laptop
    python -m benchmarks.comparisons --study as_released                    benchmarks/results/as_released_laptop
    python -m benchmarks.comparisons --study ablations --add                adds more fractals to those kept before
    python -m benchmarks.comparisons --study presets_256 --so-far           of a sweep of days, what is done

Written: fits.jsonl, report.md, strips.png with the pictures of six fractals and, where the sweep has quality over time,
course.png. Everything comes from the tracking store, so run this on the machine of the fits. With `--add`, a sweep of
other fractals, from another day or machine, joins the lines of fits.jsonl, and the report is of all; pictures stay.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd

from fractal_exp import InputError, tracking
from fractal_exp.images.pixels import write_image
from fractal_exp.inversion.result import INVERSION
from fractal_exp.studies import course, report, report_text
from fractal_exp.studies.report_figure import figure
from fractal_exp.tracking.addresses import store_uri

from .record import RESULTS, machine

COURSE = "seconds", "f1", "step"  # of a code on the way; older fits have no step
STRIPS, SIDE = 6, 80  # fractals whose pictures are kept, and the pixels of a picture
SETTINGS = "scale", "suite", "resolution", "limit"   # of fits that one report may hold


def kept(uri: str, sweep: report.Sweep) -> list[dict[str, Any]]:
    """A record of each finished job: row, fractal, scores, seconds, the code and its course, commit and machine."""
    runs = tracking.runs_frame(uri, sweep.study, tracking.nested_below(sweep.run_id)).set_index("run_id")
    courses = course.read_courses(uri, sweep)
    records = []
    for job in sweep.jobs[sweep.jobs["status"] == "FINISHED"].to_dict("records"):
        run = runs.loc[job["run_id"]]
        scores = {name.removeprefix("metric."): round(value, 4) for name, value in job.items()
                  if name.startswith("metric.") and value == value}
        points = courses[(courses["row"] == job["row"]) & (courses["sample"] == job["sample"])]
        records.append({
            "row": job["row"], "sample": job["sample"], "suite": _number(run, "target.seed"),
            "scale": sweep.scale, "resolution": _number(run, "resolution"), "limit": _number(run, "method.seconds"),
            "seconds": round(job["seconds"], 2),
            "images": None if job["evaluations"] != job["evaluations"] else int(job["evaluations"]),
            "scores": scores, "course": points[list(COURSE)].dropna(axis=1, how="all").round(4).values.tolist(),
            "stopped": _artifact(uri, job["run_id"], INVERSION).get("meta", {}).get("inversion", {}).get("stopped"),
            "code": _artifact(uri, job["run_id"], "code.json") or None,
            "commit": run.get("tags.git_commit"), "machine": machine(), "date": run["start_time"].strftime("%Y-%m-%d")})
    return records


def _number(run: Any, name: str) -> float | None:
    text = run.get(f"params.{name}")
    return json.loads(text) if isinstance(text, str) and text != "None" else None


def _artifact(uri: str, run_id: str, name: str) -> dict[str, Any]:
    """A file of JSON of a run; empty if there is none, as super-resolution has no code."""
    try:
        return json.loads(tracking.read_artifact(uri, run_id, name))
    except tracking.NoArtifact:
        return {}


def jobs_of(records: list[dict[str, Any]]) -> pd.DataFrame:
    """Records as jobs of `report.Sweep`, as far as the report needs them."""
    return pd.DataFrame([{
        "row": record["row"], "sample": record["sample"], "status": "FINISHED", "reason": "",
        "seconds": record["seconds"], "evaluations": float("nan") if record["images"] is None else record["images"],
        **{f"metric.{name}": value for name, value in record["scores"].items()}} for record in records])


def joined(path: Path, records: list[dict[str, Any]], sweep: report.Sweep
           ) -> tuple[list[dict[str, Any]], report.Sweep]:
    """The records of a file with those of a sweep, which replace them where both have one, and the sweep of all."""
    if not path.exists():
        raise InputError(f"{path} is not there, so there is nothing to add to; leave out --add")
    fitted = {(record["row"], record["sample"]) for record in records}
    before = [record for record in map(json.loads, path.read_text().splitlines())
              if (record["row"], record["sample"]) not in fitted]
    settings = [{tuple(each[name] for name in SETTINGS) for each in group} for group in (before, records)]
    if before and settings[0] != settings[1]:
        raise InputError(f"{path} holds fits of ({', '.join(SETTINGS)}) {settings[0]}, and the sweep {sweep.name} has "
                         f"{settings[1]}; keep it in another --folder")
    return before + records, replace(sweep, jobs=pd.concat([jobs_of(before), sweep.jobs], ignore_index=True))


def keep(output: Path, study: str, name: str | None, folder: Path, *, add: bool = False, so_far: bool = False) -> None:
    """Write the newest sweep of a study, or the one of this name, into `folder`; or add it to what is there. so_far:
    leave out the jobs that are not finished, instead of refusing such a sweep."""
    uri = store_uri(output)
    sweep = report.read_sweep(uri, study, name)
    records, planned = kept(uri, sweep), len(sweep.jobs)
    if so_far and records:
        sweep = replace(sweep, jobs=sweep.jobs[sweep.jobs["status"] == "FINISHED"].reset_index(drop=True))
    if len(records) < len(sweep.jobs):
        raise InputError(f"the sweep {sweep.name} has {len(records)} finished jobs of {len(sweep.jobs)}; the same "
                         f"fractal-sweep {study} command again goes on, or name another sweep with --sweep")
    done = len(records)
    if add:
        records, sweep = joined(folder / "fits.jsonl", records, sweep)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "fits.jsonl").write_text("".join(json.dumps(record) + "\n" for record in records))
    commits = sorted({str(record["commit"])[:9] for record in records})
    limits = sorted({f"{record['limit']:g} s" for record in records if record["limit"]})
    at_once = _artifact(uri, sweep.run_id, "sweep.json").get("workers")
    machines = sorted({record["machine"] for record in records})
    together = "" if add else f", {at_once} at a time"
    others = f", and {len(records) - done} of others" if len(records) > done else ""
    part = f"{done} of the {planned} fits of the sweep so far{others}. " if so_far else ""
    about = (f"{part}Fitted by {', '.join(commits)} on {'; '.join(machines)}{together}"
             f"{', at most ' + ', '.join(limits) + ' each' if limits else ''}; fits.jsonl has every fit.")
    table = report_text.markdown(sweep, report.summary(sweep))
    (folder / "report.md").write_text(f"{table}\n{about}\n")
    print((folder / "report.md").read_text())
    if add:
        return
    sheet = figure(uri, sweep, samples=STRIPS, side=SIDE)
    if sheet is not None:
        write_image(folder / "strips.png", sheet)
    courses = course.read_courses(uri, sweep)
    (folder / "course.png").unlink(missing_ok=True)
    if len(courses):
        (folder / "course.png").write_bytes(course.drawn(sweep, courses))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--study", default="comparisons")
    parser.add_argument("--sweep", help="name of the sweep's folder (default: the newest)")
    parser.add_argument("--output", type=Path, default=Path("outputs"), help="folder of the MLflow store")
    parser.add_argument("--folder", type=Path, help="where to write (default: benchmarks/results/STUDY_SCALE)")
    parser.add_argument("--add", action="store_true", help="add to the fits that the folder holds, whatever the store")
    parser.add_argument("--so-far", action="store_true", help="keep the finished fits of a sweep that goes on")
    args = parser.parse_args()
    try:
        scale = report.read_sweep(store_uri(args.output), args.study, args.sweep).scale
        keep(args.output, args.study, args.sweep, args.folder or RESULTS / f"{args.study}_{scale}", add=args.add,
             so_far=args.so_far)
    except InputError as error:
        raise SystemExit(str(error)) from error


if __name__ == "__main__":
    main()
