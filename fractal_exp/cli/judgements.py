"""What `fractal-evaluate` does: codes judged against their truths, pictures against their inputs; the tables."""

from __future__ import annotations

import argparse
import json
import tempfile
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import torch
from torch import Tensor

from .. import tracking
from ..errors import InputError
from ..evaluation import Perceptual, score, summarize
from ..evaluation.code_error import code_error
from ..evaluation.scoring import ALIGNMENTS, TRIVIAL, Scored
from ..evaluation.summary import CEILING_F1, describe
from ..evaluation.views import KINDS
from ..images.pixels import write_image
from ..rendering.sheets import comparison_strip
from ..rendering.still import check_resolution, render
from ..runtime import threads
from ..runtime.bars import progress_bar
from ..runtime.checks import check_choice, check_count
from ..runtime.files import make_folder, write_atomically
from ..studies.judging import RESULT, against_input, as_drawn, f1_in_words
from . import published_codes
from .candidates import Aim, Submission, gather, without_code
from .code_names import is_picture
from .folders import PICTURE, TRUTH
from .reading import read_picture

STRIP_VIEWS = ("whole", "2-4x-a", "4-8x-a")
CEILING = "ceiling"
PROBABILITIES = {"area": "by area, |det| + 0.01,", "own": "of their own, such as published ones,"}


def evaluate_codes(options: argparse.Namespace) -> None:
    """Judge what the command line names, and write what came out."""
    check_resolution(options.resolution, "--resolution")
    if options.points is not None:
        check_count("--points", options.points)
    check_choice("--views", options.views, KINDS)
    threads.use()
    truth, read = _truth(options)
    candidates, alone = (published_codes.gather(options.published, options.codes) if options.published is not None else
                         (gather(options.codes, truth, options.output), []))
    if read:  # what cannot be placed is refused before any work
        candidates = [replace(one, code=ALIGNMENTS[options.align](one.code)) for one in candidates]
    begun, enlarged = without_code(options.codes)
    known = [candidate for candidate in candidates if candidate.aim.truth is not None]
    pictured = [candidate for candidate in candidates if candidate.aim.picture is not None]
    lost = [candidate.name for candidate in candidates if candidate not in known + pictured]
    if len(lost) == len(candidates):
        raise InputError(f"{', '.join(lost)}: neither {TRUTH} nor {PICTURE} is kept; name a truth "
                         "with --truth")
    distance = Perceptual.load(options.perceptual, options.perceptual_weights)
    for side, setting in {(options.resolution, "--resolution") for _ in known} | {
            (candidate.aim.picture.shape[-1], "--resolution" if read else "the resolution of the fit")
            for candidate in pictured}:
        distance.check(side, setting)
    folder = make_folder(options.out)
    with ExitStack() as stack:
        run = stack.enter_context(_start_run(options, folder))
        strips, parts = make_folder(folder / "strips"), []
        if known:
            cache = options.cache or stack.enter_context(tempfile.TemporaryDirectory())
            per_view, codes = _judge_all(known, options, distance, cache, strips, run)
            parts.append(_write(per_view, codes, options.views, folder, run))
            if options.published is not None:
                beside = published_codes.beside_published(per_view)
                write_atomically(folder / "published.csv", beside.to_csv(index=False))
                run.table("published.json", beside)
                parts.append("beside the paper's method in its Table 3 (100 fractals, 7 views each at 1024²); here at "
                             f"{options.resolution}², on other views of the same fractals\n{describe(beside, 'row')}")
        if pictured:
            parts.append(_write_inputs(_judge_pictures(pictured, options, distance, strips, run), folder, run))
        parts += ["\n".join(read)] * bool(read)
        if alone:
            parts.append(f"not judged, since the data set or the optimised codes lack it: {', '.join(alone)}")
        if lost:
            parts.append(f"not judged, since neither a truth nor a picture is kept: {', '.join(lost)}")
        if enlarged:
            parts.append(f"not judged, since they found no code: {', '.join(enlarged)}; fractal-train has judged them, "
                         "see per_view.csv beside them")
        if begun:
            parts.append(f"not judged, since unfinished: {', '.join(begun)}; the same command with resume=true goes on "
                         "with a fit")
        report = "\n\n".join(parts)
        write_atomically(folder / "report.txt", report + "\n")
        run.artifact("report.txt", report)
        print(f"{report}\n\n{folder}")


def _judge_all(candidates: list[Submission], options: argparse.Namespace, distance: Perceptual, cache: str,
               strips: Path, run: tracking.Tracker) -> tuple[pd.DataFrame, pd.DataFrame]:
    """All rows of all views, with columns method, fractal and perceptual, the distance's name; and a row a code."""
    tables, codes = [], []
    protocol = {"resolution": options.resolution, "points_in_view": options.points, "views": options.views,
                "align": options.align, "cache": cache, "perceptual": distance,
                "device": options.device}
    for candidate in progress_bar(candidates, desc="judging", unit="code", disable=len(candidates) == 1):
        truth = candidate.aim.truth
        scored = score(candidate.code, truth, **protocol)
        others = {CEILING: score(truth, truth, **protocol | {"align": "bbox"})}
        for name, picture in TRIVIAL.items():
            others[name] = replace(scored, images=torch.full_like(scored.truth, picture.value))
        tables += [one.frame.assign(method=method, fractal=candidate.name, perceptual=distance.name)
                   for method, one in {RESULT: scored, **others}.items()]
        codes.append({"fractal": candidate.name,
                      **_errors(candidate, options, scored.frame, others[CEILING].frame)})
        _keep_strip(_strip(candidate.name, scored), candidate.name, strips, run, len(codes))
    per_view = pd.concat(tables, ignore_index=True)
    per_view.attrs = tables[0].attrs
    return per_view, pd.DataFrame(codes)


def _errors(candidate: Submission, options: argparse.Namespace, scores: pd.DataFrame, ceiling: pd.DataFrame
            ) -> dict[str, object]:
    truth = candidate.aim.truth
    error = code_error(candidate.code, truth, resolution=options.resolution, align=options.align,
                       points_in_view=options.points)
    return {"exact": error.exact, "equivalent": error.equivalent(scores, ceiling),
            "displacement_px": error.displacement_px, "maps": len(candidate.code), "true_maps": len(truth),
            "maps_that_matter": sum(error.matters), "missed": len(error.missed), "spurious": len(error.spurious),
            "improbable": len(error.improbable), "probabilities": "area" if truth.probabilities is None else "own",
            "f1": scores["f1"].mean(), "ceiling_f1": ceiling["f1"].mean(),
            "whole_f1": error.f1, "whole_ceiling_f1": error.ceiling_f1}


def _strip(name: str, scored: Scored) -> np.ndarray:
    rows = [list(scored.views).index(view) for view in STRIP_VIEWS]
    captions = [f"{name} {scored.views[view].zoom:.1f}x, {f1_in_words(scored.frame['f1'][row])}"
                for view, row in zip(STRIP_VIEWS, rows, strict=True)]
    return comparison_strip(scored.images[rows], scored.truth[rows], captions)


def _keep_strip(strip: np.ndarray, name: str, strips: Path, run: tracking.Tracker, number: int,
                series: str = "strip") -> None:
    """Put a strip into the folder, among the run's files, and into its list of images as one of a series."""
    run.artifact(f"strips/{name}.png", write_image(strips / f"{name}.png", strip))
    run.image(series, strip, number)


def _truth(options: argparse.Namespace) -> tuple[str | Aim | None, list[str]]:
    """What all codes are to be, as `gather` takes it; and how its picture was read, in sentences, if it is one."""
    if options.truth is None or not is_picture(Path(options.truth)):
        return options.truth, []
    target = read_picture(options.truth, options)
    notes, name = list(target.notes), Path(options.truth).name
    if target.known is not None and options.align == "bbox":
        notes.append("the picture cuts its shape off, and codes are placed by their own boxes; --align none leaves "
                     "them where they are")
    return Aim(picture=target.image, file=name, target=target), [f"{name}: {note}" for note in notes]


def _judge_pictures(candidates: list[Submission], options: argparse.Namespace, distance: Perceptual, strips: Path,
                    run: tracking.Tracker) -> pd.DataFrame:
    """A row for each code that is to show a picture and each of the two trivial pictures, and for its truth where that
    is known too: columns fractal, method, against (input, of a fit, or picture, which the user named), input (the
    file), resolution, then the scores."""
    tables = []
    for number, candidate in enumerate(candidates, 1):
        aim = candidate.aim
        images, scores = (_whole_view(candidate, options, distance) if aim.target is None else
                          as_drawn(candidate.code, aim.target, distance))
        first = {"fractal": candidate.name, "method": list(images), "against": "picture" if aim.target else "input",
                 "input": aim.file, "resolution": aim.picture.shape[-1]}
        tables.append(pd.DataFrame(first).join(scores).assign(perceptual=distance.name))
        strip = comparison_strip(images[RESULT][None], aim.picture[None],
                                 [f"{candidate.name}, {f1_in_words(scores['f1'][0])}"])
        _keep_strip(strip, candidate.name if aim.truth is None else f"{candidate.name}-picture", strips, run, number,
                    "input strip")
    return pd.concat(tables, ignore_index=True)


def _whole_view(candidate: Submission, options: argparse.Namespace, distance: Perceptual
                ) -> tuple[dict[str, Tensor], pd.DataFrame]:
    """What a fit of a picture and the trivial pictures show on the whole view, (R,R), and its truth where that is
    known too; and a row of scores for each."""
    picture = candidate.aim.picture
    images = {name: render(code, resolution=picture.shape[-1], points_in_view=options.points, device=options.device)
              for name, code in {RESULT: candidate.code, CEILING: candidate.aim.truth}.items() if code is not None}
    images |= {name: torch.full_like(picture, one.value) for name, one in TRIVIAL.items()}
    rows = [against_input(image, picture, distance).drop(columns=["view", "zoom"]) for image in images.values()]
    return images, pd.concat(rows, ignore_index=True)


def _write_inputs(table: pd.DataFrame, folder: Path, run: tracking.Tracker) -> str:
    """The table of the fits of pictures into the folder and the run; its part of the report."""
    write_atomically(folder / "inputs.csv", table.to_csv(index=False))
    run.table("inputs.json", table)
    scores = table.drop(columns=["resolution", "input", "against", "perceptual"])
    means = scores.groupby("method", sort=False).mean(numeric_only=True).dropna(axis="columns", how="all")
    run.log({f"input/{name}": float(value) for name, value in means.loc[RESULT].items()})
    count, first = int((table["method"] == RESULT).sum()), table.iloc[0]
    return "\n".join([
        (f"{_codes(count)} against the picture {first['input']}, drawn as that was drawn: all of its "
         f"{first['resolution']}² pixels" if first["against"] == "picture" else
         f"{_codes(count)} of pictures against the input: the whole view at the input's own resolution, "
         + ("no truth is known" if CEILING not in means.index else "and the truth (ceiling) as we draw it")),
        means.rename_axis(None).to_string(float_format="{:.3f}".format, na_rep=""), "",
        "each result against its input",
        scores[scores["method"] == RESULT].drop(columns="method").set_index("fractal").rename_axis(None).dropna(
            axis="columns", how="all").to_string(float_format="{:.3f}".format)])


def _write(per_view: pd.DataFrame, codes: pd.DataFrame, views: str, folder: Path, run: tracking.Tracker) -> str:
    """Tables into the folder and the run; their part of the report."""
    summaries = {method: summarize(rows) for method, rows in per_view.groupby("method", sort=False)}
    summary = pd.concat([table.assign(method=method, perceptual=table.attrs["perceptual"])
                         for method, table in summaries.items()], ignore_index=True)
    write_atomically(folder / "per_view.parquet", per_view.to_parquet(index=False))
    for name, table in {"per_view": per_view, "summary": summary, "codes": codes}.items():
        write_atomically(folder / f"{name}.csv", table.to_csv(index=False))
        run.table(f"{name}.json", table)
    means = summary[(summary["method"] == RESULT) & (summary["zoom_class"] == "all")].set_index("metric")["mean"]
    run.log({f"eval/{name}": value for name, value in means.dropna().items()})
    run.log({"eval/exact_fraction": codes["exact"].mean(), "eval/equivalent_fraction": codes["equivalent"].mean(),
             "views/empty": summaries[RESULT].attrs["empty_views"],
             "eval/ceiling_fraction": summaries[RESULT].attrs["ceiling_fraction"]})
    return _report(summaries, summary, codes, views)


def _report(summaries: dict[str, pd.DataFrame], summary: pd.DataFrame, codes: pd.DataFrame, views: str) -> str:
    attributes, ceiling = summaries[RESULT].attrs, summaries[CEILING].attrs
    absent, distance = attributes["perceptual_absent"], attributes["perceptual"]
    empty = summaries[RESULT].attrs["empty_views"]
    lines = [f"{_codes(len(codes))}, mean of 7 views each, views={views} [bootstrap 95% interval over codes]",
             *([f"{empty} of {7 * len(codes)} views are empty in truth and result and are left out"] if empty else []),
             describe(summary[summary["zoom_class"] == "all"], "method"), "", "the results by zoom",
             describe(summaries[RESULT]), "",
             f"at the ceiling (mean F1 >= {CEILING_F1}): {attributes['ceiling_fraction']:.0%}; of the truths "
             f"themselves {ceiling['ceiling_fraction']:.0%}",
             f"recovered exactly: {codes['exact'].mean():.0%} ({codes['exact'].sum()} of {len(codes)}); another code "
             f"of the same attractor: {codes['equivalent'].mean():.0%} ({codes['equivalent'].sum()})",
             f"mean displacement of matched maps {codes['displacement_px'].mean():.2f} px",
             "map probabilities of the truths: " + ", ".join(
                 f"{PROBABILITIES[key]} {count} of {len(codes)}"
                 for key, count in codes["probabilities"].value_counts().items()),
             f"no perceptual distance: {absent}" if absent else f"perceptual distance: {distance}"]
    return "\n".join(lines)


def _codes(count: int) -> str:
    return f"{count} code{'s' * (count != 1)}"


def _start_run(options: argparse.Namespace, folder: Path) -> tracking.Tracker:
    if options.track is None:
        return tracking.Tracker()
    params = {name: value for name, value in vars(options).items() if name not in ("track", "output", "cache", "out")}
    tags = {"perceptual": options.perceptual, "scale": options.scale, "kind": "evaluation"}
    return tracking.start_run(tracking.prepare_store(options.output), options.track, folder.name, folder=folder,
                              params=params | {"codes": json.dumps(options.codes)}, tags=tags)
