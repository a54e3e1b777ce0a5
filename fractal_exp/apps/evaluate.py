"""`fractal-evaluate`: codes against their truths. A plain command line, since there is nothing to compose."""

from __future__ import annotations

import argparse
import json
import tempfile
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import torch
from tqdm import tqdm

from .. import perceptual, threads, tracking
from ..evaluation import Perceptual, score, summarize
from ..evaluation.code_error import code_error
from ..evaluation.pictures import comparison_strip
from ..evaluation.scoring import ALIGNMENTS, TRIVIAL, Scored
from ..evaluation.summary import CEILING_F1, describe
from ..evaluation.views import KINDS, check_kind
from ..images import write_image
from .candidates import Candidate, gather
from .commands import command, command_parser, make_folder
from .judging import f1_in_words

if TYPE_CHECKING:
    import pandas as pd

SCALES = {"laptop": {"resolution": 256, "points": 4_000_000}, "paper": {"resolution": 1024, "points": 50_000_000}}
STRIP_VIEWS = ("whole", "2-4x-a", "4-8x-a")
RESULT, CEILING = "result", "ceiling"

DESCRIPTION = """Judge recovered codes on the seven views of each fractal: the whole, and closer by up to eight times.

CODES are JSON files, folders of them, folders of fits as fractal-train leaves them, or run:ID. Fits know their truth;
for other codes name it: --truth suite takes the fractal whose number ends the file's name (007.json), a folder the
file of the same name in it, and a code (fern, leaf.json, suite:7) stands for all.

Written to --out: per_view (.csv and .parquet, a row a view), summary and codes (.csv), report.txt, and for each code a
strip target | result | difference. Beside the results stand their ceiling, which is the truth drawn with other
random points, and what an all white and an all black picture would get.

examples
  fractal-evaluate outputs/fits                                   all finished fits of a study
  fractal-evaluate mine/*.json --truth suite --scale paper
  fractal-evaluate leaf.json --truth fern --align none            do not shift or scale the code
  fractal-evaluate run:3fa0… --track judgements                   a run of the store in outputs, logged as another"""


def main(arguments: list[str] | None = None) -> None:
    """The command line."""
    parser = command_parser("fractal-evaluate", DESCRIPTION)
    parser.add_argument("codes", nargs="+", help="what to judge")
    parser.add_argument("--truth", help="what it ought to be (default: what the fits' records say)")
    parser.add_argument("--out", default="evaluation", help="folder to write to")
    parser.add_argument("--scale", choices=SCALES, default="laptop", help="256² pixels and 4M points a view, or 1024² "
                                                                         "and 50M")
    parser.add_argument("--resolution", type=int, help="pixels a side, instead of the scale's")
    parser.add_argument("--points", type=int, help="points in a view, instead of the scale's")
    parser.add_argument("--views", default="attractor", metavar=f"{{{','.join(KINDS)}}}",
                        help="centred on points of the true attractor; towards the middle of the canvas as in the "
                             "authors' program, to stand beside published figures; or anywhere on the canvas")
    parser.add_argument("--align", choices=ALIGNMENTS, default="bbox", help="frame each code by its own bounding box, "
                                                                            "or take it in the frame of the input")
    parser.add_argument("--perceptual", choices=("none", *perceptual.kinds()), default="none",
                        help="a perceptual distance to add")
    parser.add_argument("--perceptual-weights", metavar="FILE", help="its weights (default: those of fractal come with "
                                                                     "the package, those of LPIPS from torch's cache, "
                                                                     "else a download)")
    parser.add_argument("--device", default="cpu", help="where codes are drawn: cpu, or cuda with an NVIDIA GPU")
    parser.add_argument("--cache", metavar="FOLDER", help="keep the truths' images here, for the next evaluation")
    parser.add_argument("--track", metavar="STUDY", help="log to this study of the MLflow store in --output")
    parser.add_argument("--output", default="outputs", help="folder of the MLflow store")
    command("fractal-evaluate", evaluate_codes, parser, arguments)


def evaluate_codes(options: argparse.Namespace) -> None:
    """Judge what the command line names, and write what came out."""
    check_kind(options.views)
    threads.use()
    options.resolution = SCALES[options.scale]["resolution"] if options.resolution is None else options.resolution
    options.points = SCALES[options.scale]["points"] if options.points is None else options.points
    candidates = gather(options.codes, options.truth, options.output)
    distance = Perceptual.load(options.perceptual, options.perceptual_weights)
    distance.check(options.resolution, "--resolution")
    folder = make_folder(options.out)
    with ExitStack() as stack:
        run = stack.enter_context(_start_run(options, folder))
        cache = options.cache or stack.enter_context(tempfile.TemporaryDirectory())
        per_view, codes = _judge_all(candidates, options, distance, cache, make_folder(folder / "strips"), run)
        _write(per_view, codes, options.views, folder, run)


def _judge_all(candidates: list[Candidate], options: argparse.Namespace, distance: Perceptual, cache: str,
               strips: Path, run: tracking.Tracker) -> tuple[pd.DataFrame, pd.DataFrame]:
    """All rows of all views, with columns method, fractal and perceptual, the distance's name; and a row a code."""
    import pandas as pd

    tables, codes = [], []
    protocol = {"resolution": options.resolution, "points_in_view": options.points, "views": options.views,
                "align": options.align, "cache": cache, "perceptual": distance,
                "device": options.device}
    for candidate in tqdm(candidates, "judging", unit="code", disable=len(candidates) == 1):
        scored = score(candidate.code, candidate.truth, **protocol)
        others = {CEILING: score(candidate.truth, candidate.truth, **protocol | {"align": "bbox"})}
        for name, picture in TRIVIAL.items():
            others[name] = replace(scored, images=torch.full_like(scored.truth, picture.value))
        tables += [one.frame.assign(method=method, fractal=candidate.name, perceptual=distance.name)
                   for method, one in {RESULT: scored, **others}.items()]
        codes.append({"fractal": candidate.name,
                      **_errors(candidate, options, scored.frame, others[CEILING].frame)})
        strip = write_image(strips / f"{candidate.name}.png", _strip(candidate.name, scored))
        run.artifact(f"strips/{strip.name}", strip)
    per_view = pd.concat(tables, ignore_index=True)
    per_view.attrs = tables[0].attrs
    return per_view, pd.DataFrame(codes)


def _errors(candidate: Candidate, options: argparse.Namespace, scores: pd.DataFrame, ceiling: pd.DataFrame
            ) -> dict[str, object]:
    error = code_error(candidate.code, candidate.truth, resolution=options.resolution, align=options.align,
                       points_in_view=options.points)
    return {"exact": error.exact, "equivalent": error.equivalent(scores, ceiling),
            "displacement_px": error.displacement_px, "maps": len(candidate.code), "true_maps": len(candidate.truth),
            "maps_that_matter": sum(error.matters), "missed": len(error.missed), "spurious": len(error.spurious),
            "improbable": len(error.improbable), "f1": scores["f1"].mean(), "ceiling_f1": ceiling["f1"].mean(),
            "whole_f1": error.f1, "whole_ceiling_f1": error.ceiling_f1}


def _strip(name: str, scored: Scored) -> torch.Tensor:
    rows = [list(scored.views).index(view) for view in STRIP_VIEWS]
    captions = [f"{name} {scored.views[view].zoom:.1f}x, {f1_in_words(scored.frame['f1'][row])}"
                for view, row in zip(STRIP_VIEWS, rows, strict=True)]
    return comparison_strip(scored.images[rows], scored.truth[rows], captions)


def _write(per_view: pd.DataFrame, codes: pd.DataFrame, views: str, folder: Path, run: tracking.Tracker) -> None:
    """Tables and report into the folder and the run."""
    import pandas as pd

    summaries = {method: summarize(rows) for method, rows in per_view.groupby("method", sort=False)}
    summary = pd.concat([table.assign(method=method, perceptual=table.attrs["perceptual"])
                         for method, table in summaries.items()], ignore_index=True)
    per_view.to_parquet(folder / "per_view.parquet", index=False)
    for name, table in {"per_view": per_view, "summary": summary, "codes": codes}.items():
        table.to_csv(folder / f"{name}.csv", index=False)
        run.table(f"{name}.json", table)
    means = summary[(summary["method"] == RESULT) & (summary["zoom_class"] == "all")].set_index("metric")["mean"]
    run.log({f"eval/{name}": value for name, value in means.dropna().items()})
    run.log({"eval/exact_fraction": codes["exact"].mean(), "eval/equivalent_fraction": codes["equivalent"].mean(),
             "views/empty": summaries[RESULT].attrs["empty_views"],
             "eval/ceiling_fraction": summaries[RESULT].attrs["ceiling_fraction"]})
    report = _report(summaries, summary, codes, views)
    (folder / "report.txt").write_text(report + "\n")
    run.artifact("report.txt", report)
    print(f"{report}\n\n{folder}")


def _report(summaries: dict[str, pd.DataFrame], summary: pd.DataFrame, codes: pd.DataFrame, views: str) -> str:
    attributes, ceiling = summaries[RESULT].attrs, summaries[CEILING].attrs
    absent, distance = attributes["perceptual_absent"], attributes["perceptual"]
    empty = summaries[RESULT].attrs["empty_views"]
    lines = [f"{len(codes)} codes, mean of 7 views each, views={views} [bootstrap 95% interval over codes]",
             *([f"{empty} of {7 * len(codes)} views are empty in truth and result and are left out"] if empty else []),
             describe(summary[summary["zoom_class"] == "all"], "method"), "", "the results by zoom",
             describe(summaries[RESULT]), "",
             f"at the ceiling (mean F1 >= {CEILING_F1}): {attributes['ceiling_fraction']:.0%}; of the truths "
             f"themselves {ceiling['ceiling_fraction']:.0%}",
             f"recovered exactly: {codes['exact'].mean():.0%} ({codes['exact'].sum()} of {len(codes)}); another code "
             f"of the same attractor: {codes['equivalent'].mean():.0%} ({codes['equivalent'].sum()})",
             f"mean displacement of matched maps {codes['displacement_px'].mean():.2f} px",
             f"no perceptual distance: {absent}" if absent else f"perceptual distance: {distance}"]
    return "\n".join(lines)


def _start_run(options: argparse.Namespace, folder: Path) -> tracking.Tracker:
    if options.track is None:
        return tracking.NoTracker()
    params = {name: value for name, value in vars(options).items() if name not in ("track", "output", "cache", "out")}
    tags = {"perceptual": options.perceptual, "scale": options.scale, "kind": "evaluation"}
    return tracking.start_run(tracking.prepare_store(options.output), options.track, folder.name, folder=folder,
                              params=params | {"codes": json.dumps(options.codes)}, tags=tags)


if __name__ == "__main__":
    main()
