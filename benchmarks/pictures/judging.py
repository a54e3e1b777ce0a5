"""How well a code is recovered, or a shape drawn: masks with one pen, maps one by one, and distances of points."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import torch
from PIL import Image, ImageDraw

from fractal_exp import render
from fractal_exp.errors import InputError
from fractal_exp.evaluation.code_error import displacements
from fractal_exp.evaluation.inside import LIT, f1_dark
from fractal_exp.ifs.code import IFS
from fractal_exp.rendering.still import render_with_info
from fractal_exp.rendering.tone import usual_mode

from .figures import Truth

RESOLUTION = 256
SHAPE_LEVEL = 0.1          # of the highest level of a picture: what lies above it is its shape
FOUND_PX = 1.0             # a true map is found if one of the code moves the attractor's points no farther from it
EQUIVALENT_F1 = 0.995      # within a pixel, of the drawings of two codes of one attractor
SUPERSAMPLE = 8            # subpixels along a pixel, of polygons
WITHIN_PX = 2.0            # of a density map: a point of the truth is covered by one of the code that is no farther
COMPARED_POINTS = 2048


def drawing(code: IFS, resolution: int = RESOLUTION) -> np.ndarray:
    """The pixels (R,R) that a code of the canvas lights, whatever its probabilities: it is drawn by area. Nothing for
    a code that cannot be drawn."""
    try:
        return render_with_info(replace(code, probabilities=None), resolution=resolution)[0].numpy() > 0
    except InputError:
        return np.zeros((resolution, resolution), bool)


def true_drawing(truth: Truth, resolution: int = RESOLUTION) -> np.ndarray:
    """The pixels (R,R) that the truth, on the canvas, lights."""
    mask = np.any([drawing(code, resolution) for code in truth.codes], axis=0)
    if truth.solids is not None:
        fine = Image.new("1", (SUPERSAMPLE * resolution,) * 2)
        pen = ImageDraw.Draw(fine)
        for corners in np.floor((truth.solids * [1, -1] + 1) * (SUPERSAMPLE * resolution / 2)):
            pen.polygon([tuple(corner) for corner in corners.tolist()], fill=1)
        parts = np.asarray(fine).reshape(resolution, SUPERSAMPLE, resolution, SUPERSAMPLE)
        mask |= parts.any((1, 3))
    return mask


def thickened(mask: np.ndarray) -> np.ndarray:
    """A mask dilated by 3×3: the pen that all drawings are compared with."""
    from scipy import ndimage

    return ndimage.binary_dilation(mask, np.ones((3, 3)))


def iou(a: np.ndarray, b: np.ndarray) -> float:
    """Intersection over union of two masks, 1 if both are empty."""
    either = int((a | b).sum())
    return int((a & b).sum()) / either if either else 1.0


def f1_within_a_pixel(found: np.ndarray, true: np.ndarray) -> float:
    """F1 of two masks, each against the other's 3×3 dilation; 1 if both are empty, 0 if one is."""
    if not (found.any() and true.any()):
        return float(found.any() == true.any())
    precision, recall = (found & thickened(true)).sum() / found.sum(), (true & thickened(found)).sum() / true.sum()
    return float(2 * precision * recall / (precision + recall)) if precision + recall else 0.0


def shape_of(image: np.ndarray) -> np.ndarray:
    """The mask (R,R) of a picture's shape, white on black."""
    return image > SHAPE_LEVEL * image.max()


def shapes(code: IFS, image: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The masks of the picture (R,R) that a code was found on, and of the code's drawing."""
    return shape_of(image), drawing(code, len(image))


def redrawn(code: IFS, image: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The picture (R,R) that a code was found on, and the code drawn as a still of it: with its tone, if it has one."""
    return image, render(code, resolution=len(image), mode=usual_mode(code)).numpy()


def light_and_dark(code: IFS, image: np.ndarray) -> dict[str, float | None]:
    """F1 within a pixel of the light, and of the dark inside the outline, of a code's still against the picture (R,R)
    that it was found on; None where nothing is dark inside."""
    shape, still = (torch.from_numpy(each) for each in redrawn(code, image))
    return {"f1_light": f1_within_a_pixel((still > LIT).numpy(), (shape > LIT).numpy()),
            "f1_dark": f1_dark(still, shape)}


def likeness(code: IFS, image: np.ndarray) -> dict[str, float]:
    """F1 within a pixel of a code's drawing against the picture (R,R) that it was found on."""
    shape, drawn = shapes(code, image)
    return {"f1_input": f1_within_a_pixel(drawn, shape)}


def iou_within_a_pixel(found: np.ndarray, true: np.ndarray) -> float:
    """The best IoU of two drawings (2R,2R), brought to (R,R) pixels and thickened there, where the first is shifted by
    up to a pixel, in half pixels: a frame that is half a pixel off costs thin figures a tenth."""
    target = thickened(_halved(true))
    padded = np.pad(found, 2)
    side = len(found)
    return max(iou(thickened(_halved(padded[r:r + side, c:c + side])), target) for r in range(5) for c in range(5))


def _halved(mask: np.ndarray) -> np.ndarray:
    side = len(mask) // 2
    return mask.reshape(side, 2, side, 2).any((1, 3))


def against_truth(code: IFS, truth: Truth, resolution: int = RESOLUTION) -> dict[str, float | bool | int | None]:
    """How a code compares with the truth, both on one canvas.

    iou: of both drawings with a pen of 3 px. iou_1px: the same at the best shift of up to a pixel. f1_truth: F1 within
    a pixel. exact, equivalent, recovered: see `against_code`; None where the truth has no code.
    """
    fine = drawing(code, 2 * resolution), true_drawing(truth, 2 * resolution)
    found, true = (_halved(each) for each in fine)
    likeness = f1_within_a_pixel(found, true)
    maps = dict.fromkeys(("missed", "exact", "equivalent", "recovered")) if truth.code is None else against_code(
        code, truth.code, likeness, resolution)
    return {"iou": iou(thickened(found), thickened(true)), "iou_1px": iou_within_a_pixel(*fine), "f1_truth": likeness,
            "true_maps": None if truth.code is None else len(truth.code), **maps}


def against_code(code: IFS, truth: IFS, likeness: float, resolution: int = RESOLUTION) -> dict[str, bool | int]:
    """Whether a code is the true one, both on one canvas; likeness: F1 within a pixel of their drawings.

    missed: true maps without a map of the code that moves the true attractor's points within 1 px on average, by the
    assignment that finds most. exact: none missed, and no map too many. equivalent: not exact, but no more maps than
    the truth, and a likeness of at least .995: another code of the same attractor, as far as a pixel tells. recovered:
    one of both.
    """
    from scipy.optimize import linear_sum_assignment

    near = (displacements(code, truth, resolution) <= FOUND_PX).numpy()
    missed = len(truth) - int(near[linear_sum_assignment(near, maximize=True)].sum())
    exact = missed == 0 and len(code) == len(truth)
    equivalent = not exact and len(code) <= len(truth) and likeness >= EQUIVALENT_F1
    return {"missed": missed, "exact": exact, "equivalent": equivalent, "recovered": exact or equivalent}


def point_distances(found: np.ndarray, true: np.ndarray, pixel: float, rng: np.random.Generator) -> dict[str, float]:
    """Distances between 2 048 of each of two sets of points (P,2), in their unit.

    chamfer: ½ sqrt(mean d² there + mean d² back). hd95: the larger of both 95% quantiles. covered: the share of true
    points within 2 px of a found one; pixel: the side of a pixel.
    """
    from scipy.spatial import KDTree

    a, b = (points[rng.choice(len(points), min(COMPARED_POINTS, len(points)), replace=False)]
            for points in (found, true))
    to_true, to_found = KDTree(b).query(a)[0], KDTree(a).query(b)[0]
    return {"chamfer": float(np.sqrt(np.square(to_true).mean() + np.square(to_found).mean()) / 2),
            "hd95": float(max(np.quantile(to_true, 0.95), np.quantile(to_found, 0.95))),
            "covered": float((to_found <= WITHIN_PX * pixel).mean())}
