"""What a finished fit is worth: scores and pictures, against the truth where it is known, else against the input."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
import torch
from torch import Tensor

from ..errors import InputError
from ..evaluation import Perceptual, metrics, score
from ..evaluation.code_error import at_ceiling, code_error
from ..evaluation.pictures import compare_pictures
from ..evaluation.scoring import ALIGNMENTS, TRIVIAL
from ..evaluation.summary import without_empty
from ..evaluation.views import KINDS
from ..ifs.code import IFS, View
from ..images.reading import ReadImage
from ..likeness import Likeness, camera_for, lit_above, redrawn
from ..methods.base import CodeReconstruction, Reconstruction
from ..rendering.sheets import comparison_strip
from ..rendering.still import MAX_SUPERSAMPLE, check_device, check_resolution, points_per_view, render
from ..runtime.checks import check_choice, check_count
from ..targets import Target
from ..verdict import Verdict

NAMES = {"f1": "F1", "iou": "IoU", "psnr": "PSNR", "ssim": "SSIM", "lpips": "LPIPS", "ciede2000": "CIEDE2000",
         "f1_frame": "F1 in the frame", "iou_frame": "IoU in the frame"}
RESULT = "result"  # among images by name


@dataclass(frozen=True)
class Judgement:
    """What a fit is worth.

    per_view: one row a view; scores: their means as eval/…, where it was asked for those of the code in the frame of
    the input as eval/f1_frame and eval/iou_frame, time/fit_seconds, and time/evaluations where the method counts them;
    trivial: the means of an all white and an all black image, as trivial/white_… and trivial/black_…, and
    where it was asked for those of the truth drawn with other random numbers, as trivial/truth_…; counts: views/judged,
    the views that the scores are means of, views/empty, those that are left out because nothing is on them, and
    views/left_out, those that the reconstruction cannot show, if there are any;
    pictures by name: the input as `target`, its reconstruction as `result`, `comparison` (target | result | difference
    of every view), and where the truth is known `zoomed_target` and `zoomed`, the view beyond 2x that shows most;
    compared: in words, what was compared with a picture.
    """

    per_view: pd.DataFrame
    scores: dict[str, float]
    trivial: dict[str, float]
    counts: dict[str, int]
    pictures: dict[str, Tensor | np.ndarray]
    compared: str = "against the input"

    def describe(self) -> str:
        """The scores in one line; those without a title under their own name."""
        found = [key.removeprefix("eval/") for key in self.scores if key.startswith("eval/")]
        names = [*(name for name in NAMES if name in found), *(name for name in found if name not in NAMES)]
        shown = [f"{NAMES.get(name, name)} {self.scores[f'eval/{name}']:.3f}" for name in names]
        whole = f"F1 {self.per_view['f1'].iloc[0]:.3f} on the whole one"
        judged, empty = self.counts["views/judged"], self.counts["views/empty"]
        views = f"mean of {judged} views, {whole}" if len(self.per_view) > 1 else self.compared
        views += f", {empty} more are empty in both" if empty else ""
        if left_out := self.counts.get("views/left_out"):
            views += f", {left_out} more are left out, as they are closer by than it can show"
        return f"{'  '.join(shown)}  ({views}; fitted in {self.scores['time/fit_seconds']:.0f} s)"


def check_options(options: Mapping[str, Any]) -> None:
    """Raise `InputError` on evaluation options that `judge` could not use."""
    known = {"resolution", "points_in_view", "supersample", "views", "align", "device"}
    if odd := sorted(set(options) ^ known):
        raise InputError(f"the evaluation options are {', '.join(sorted(known))}; {odd[0]!r} is "
                         f"{'none of them' if odd[0] in options else 'missing'}")
    check_resolution(options["resolution"], "evaluation.resolution")
    if options["points_in_view"] is not None:
        check_count("evaluation.points_in_view", options["points_in_view"])
    check_count("evaluation.supersample", options["supersample"], most=MAX_SUPERSAMPLE)
    check_choice("evaluation.views", options["views"], KINDS)
    check_choice("evaluation.align", options["align"], ALIGNMENTS)
    check_device(options["device"])


def judge(reconstruction: Reconstruction, target: Target, options: Mapping[str, Any], perceptual: Perceptual,
          seconds: float, ceiling: bool = False, in_frame: bool = False) -> Judgement:
    """Score a reconstruction by the evaluation `options` of the configuration and a perceptual distance. ceiling:
    whether the truth, drawn anew, is scored as well, if it is known: what no method can do better than. in_frame:
    whether F1 and IoU are also measured in the frame of the input (align=none), if the truth is known.

    With a known code, on its seven views (see `fractal_exp.evaluation.score`); for a picture, on the whole view at
    the picture's own resolution.
    """
    drawn = reconstruction.render(View(), resolution=target.image.shape[-1], points_in_view=options["points_in_view"],
                                  supersample=options["supersample"])
    if target.truth is None:
        per_view, images, truth = against_input(drawn, target.image, perceptual), drawn[None], target.image[None]
    else:
        scored = score(reconstruction, target.truth, **options, perceptual=perceptual)
        per_view, images, truth = scored.frame, scored.images, scored.truth
    measured = [name for name in dict.fromkeys((*NAMES, perceptual.column)) if name in per_view]
    means = per_view[measured].mean().dropna()
    scores = {f"eval/{name}": float(value) for name, value in means.items()} | {"time/fit_seconds": seconds}
    if in_frame and target.truth is not None:
        scores |= _in_frame(reconstruction, target.truth, options)
    if isinstance(reconstruction, CodeReconstruction) and reconstruction.evaluations is not None:
        scores["time/evaluations"] = float(reconstruction.evaluations)
    judged = len(without_empty(per_view))
    counts = {"views/judged": judged, "views/empty": len(per_view) - judged}
    if left_out := per_view.attrs.get("left_out"):
        counts["views/left_out"] = len(left_out)
    captions = [f"{row.view}, {f1_in_words(row.f1)}" for row in per_view.itertuples()]
    pictures = {"target": target.image, "result": drawn, "comparison": comparison_strip(images, truth, captions)}
    if len(per_view) > 1:
        lit = [float((image > 0).float().mean()) if zoom > 2 else -1.0
               for image, zoom in zip(truth, per_view["zoom"], strict=True)]
        k = lit.index(max(lit))
        pictures |= {"zoomed_target": truth[k], "zoomed": images[k]}
    trivial = _trivial(truth)
    if ceiling and target.truth is not None:
        again = score(target.truth, target.truth, **options, perceptual=perceptual).frame
        means = again[again["view"].isin(per_view["view"])][measured].mean().dropna()
        trivial |= {f"trivial/truth_{name}": float(value) for name, value in means.items()}
    attractor = "the attractor " if isinstance(reconstruction, CodeReconstruction) else ""
    return Judgement(per_view, scores, trivial, counts, pictures, f"{attractor}against the input")


def finds_truth(code: IFS, truth: IFS, options: Mapping[str, Any]) -> tuple[bool, bool]:
    """Whether a code is the true one, and else whether it is another code of the same attractor, by the evaluation
    `options` of the configuration (see `fractal_exp.evaluation.code_error`). All views are drawn only where it takes
    them to tell."""
    error = code_error(code, truth, **{key: options[key] for key in ("resolution", "align", "points_in_view")})
    if error.exact or not at_ceiling(error.f1, error.ceiling_f1):
        return error.exact, False
    result, ceiling = (score(each, truth, **options | {"align": align}).frame
                       for each, align in ((code, options["align"]), (truth, "bbox")))
    return False, error.equivalent(result, ceiling)


def _in_frame(reconstruction: Reconstruction, truth: IFS, options: Mapping[str, Any]) -> dict[str, float]:
    framed = score(reconstruction, truth, **{**options, "align": "none"}).frame
    return {f"eval/{name}_frame": float(framed[name].mean()) for name in ("f1", "iou")}


def judge_course(course: Sequence[tuple[float, int, IFS]], truth: IFS, options: Mapping[str, Any]
                 ) -> list[dict[str, float]]:
    """The F1 of the whole view of each code that a method came to on its way, with its seconds and its step."""
    size = {key: options[key] for key in ("resolution", "points_in_view", "supersample")}
    size["points_in_view"] = size["points_in_view"] or points_per_view(options["resolution"])
    whole = render(ALIGNMENTS["bbox"](truth), View(), **size, seed=1)[None]
    return [{"seconds": seconds, "step": step, "f1": float(metrics.compare(
        render(ALIGNMENTS[options["align"]](code), View(), **size)[None], whole)["f1"])}
        for seconds, step, code in course]


def f1_in_words(f1: float) -> str:
    """The F1 of a view for its caption; that of an empty view is NaN."""
    return "empty" if np.isnan(f1) else f"F1 {f1:.3f}"


def _trivial(truth: Tensor) -> dict[str, float]:
    means = {f"trivial/{name.removeprefix('all ')}_{metric}": float(values.nanmean())
             for name, picture in TRIVIAL.items()
             for metric, values in metrics.compare(torch.full_like(truth, picture.value), truth).items()}
    return {name: mean for name, mean in means.items() if np.isfinite(mean)}


def against_input(drawn: Tensor, image: Tensor, perceptual: Perceptual) -> pd.DataFrame:
    """One row: the scores of a picture (R,R) of the whole view against the picture (R,R) that was the input."""
    row = {name: float(value) for name, value in metrics.compare(drawn[None], image[None]).items()}
    row[perceptual.column] = float(perceptual.measure(metrics.inner_crop(drawn[None]), metrics.inner_crop(image[None])))
    return pd.DataFrame([{"view": "whole", "zoom": 1.0, **row}])


def as_drawn(code: IFS, target: ReadImage, perceptual: Perceptual) -> tuple[dict[str, Tensor], pd.DataFrame]:
    """A code in the frame of a picture, drawn as that picture was drawn: images (R,R) by name, `RESULT` and the trivial
    ones, all black where the picture shows nothing; and a row for each of them, in this order.

    The columns are those of `compare_pictures`. For the code, those that `Likeness` has are its own, noise_ratio with
    them; verdict is the kind of `Verdict`, and camera says how the picture was drawn, as far as that was found out.
    """
    image, camera = target.image, camera_for(code, target)
    likeness, above = Likeness.of(code, target, camera), lit_above(target, camera)
    known = None if target.known is None else target.known.mask(len(image))
    images = {RESULT: redrawn(code, target, camera).to(image),
              **{name: torch.full_like(image, one.value) for name, one in TRIVIAL.items()}}
    images = {name: each if known is None else each * known for name, each in images.items()}
    rows: list[dict[str, Any]] = [
        compare_pictures(each, image, each > above, image > above, perceptual, above=above, known=known)
        for each in images.values()]
    rows[0] |= {"f1": likeness.f1, "f1_1px": likeness.f1_1px, "iou": likeness.iou, "ssim_inside": likeness.ssim,
                "noise_ratio": likeness.noise_ratio, "verdict": Verdict.of(likeness, len(code), target).kind,
                "camera": ", ".join(f"{name} {value if isinstance(value, str) else format(value, '.3g')}"
                                    for name, value in camera.facts(len(image)).items())}
    return images, pd.DataFrame(rows)
