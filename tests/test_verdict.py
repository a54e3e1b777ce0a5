"""How like a code is to a picture, and what `invert` says of it in words."""

from dataclasses import replace

import pytest
import torch

from fractal_exp import codes, suite
from fractal_exp.cameras.camera import Camera
from fractal_exp.ifs import attractor
from fractal_exp.ifs.code import IFS
from fractal_exp.images.levels import meaning_of
from fractal_exp.images.reading import ReadImage
from fractal_exp.likeness import Likeness, redrawn
from fractal_exp.methods.base import time_is_up
from fractal_exp.runtime.deadline import Deadline
from fractal_exp.verdict import Verdict

SHAPE = torch.zeros(64, 64)
SHAPE[16:48, 8:56] = torch.eye(48)[:32]


CORNERS = torch.tensor([[-1.0, -1.0], [-1.0, 1.0], [1.0, -1.0], [1.0, 1.0]])
PEN = Camera("coverage", tile=0.0, pen=0.008, blur=0.004)


def likeness(f1_1px, noise_ratio=9.0, **inside):
    return Likeness(f1_1px, f1_1px, noise_ratio, f1_1px, **inside)


def square(ratio=0.5):
    """A square of four squares: with a ratio below a half, thin crosses between them are left out, at every scale."""
    return IFS(ratio * torch.eye(2).repeat(4, 1, 1), 0.75 * (1 - ratio) * CORNERS)


def carpet():
    at = torch.cartesian_prod(*[torch.tensor([-1.0, 0.0, 1.0])] * 2)
    return IFS(torch.eye(2).repeat(8, 1, 1) / 3, at[at.abs().sum(1) > 0] / 2)


def t_square(depth, side=256):
    """Squares with squares of half the side around their corners, white on black: the black that is left out is thin,
    and all of it lies within the square that the figure fills in the limit."""
    image = torch.zeros(side, side)

    def draw(x, y, width, depth):
        rows, columns = (slice(round(at - width / 2), round(at + width / 2)) for at in (y, x))
        image[rows, columns] = 1
        for dx, dy in CORNERS.tolist() if depth else []:
            draw(x + dx * width / 2, y + dy * width / 2, width / 2, depth - 1)

    draw(side / 2, side / 2, 0.375 * side, depth)
    return image


def read(image=SHAPE, **facts):
    return replace(ReadImage.of_drawing(image, meaning_of(image)), **facts)


def test_many_maps_that_fit_what_looks_like_noise_recover_nothing_in_a_picture_that_others_drew():
    for levels in ("drawn", "dots", "tonemapped", "coverage"):
        few, many = (Verdict.of(likeness(.9, 1.0), maps, read(levels=levels)) for maps in (8, 128))
        assert (few.kind, many.kind, many.change) == ("recovered", "approximation", {"at_most": 12})
    for levels in ("density", "linear", "binary"):
        assert Verdict.of(likeness(.9, 1.0), 20, read(levels=levels)).kind == "recovered", "no other noise is there"


@pytest.mark.parametrize("kind", ["grey", "binary"])
def test_the_true_code_is_as_like_as_another_rendering_of_it(kind):
    code = attractor.normalize(codes.known("heighway_dragon"))
    target = read(suite.target(code, 128, kind))
    true = Likeness.of(code, target)
    assert 0.7 < true.noise_ratio < 1.4 and true.f1 > 0.97 and true.iou == pytest.approx(true.f1 / (2 - true.f1))
    assert Verdict.of(true, len(code), target) == Verdict(
        "recovered", "recovered: the picture is explained to its noise", "")
    other = Likeness.of(attractor.normalize(codes.known("fern")), target)
    assert other.noise_ratio > 30 and other.f1 < 0.8 and other.f1 < other.f1_1px < 1
    assert Verdict.of(other, 4, target).kind != "recovered"


def test_a_verdict_has_a_kind_words_and_a_remedy():
    verdict = Verdict.of(likeness(0.553), 23, read())
    assert verdict == Verdict("approximation", "approximation with 23 maps; F1 .55 within a pixel; more maps would "
                              "help", "more maps: maps=46, with more time for each", {"maps": 46})
    assert str(verdict) == f"{verdict.words} ({verdict.remedy})"
    none = Verdict.of(likeness(0.2), 3, read())
    assert none.words == "not recovered; F1 .20 within a pixel" and none.remedy
    assert Verdict.of(likeness(0.3, 1.0), 3, read()).kind == "recovered"
    assert "1 map;" in Verdict.of(likeness(0.6), 1, read()).words
    assert "F1 1.00" in Verdict.of(likeness(1), 30, read()).words
    assert Verdict.of(likeness(1), 9, read()).words == "recovered: the shape is explained to within a pixel by 9 maps"


@pytest.mark.parametrize("facts, expected", [
    ({"target": read(unclear="it looks like a page of text")}, "cut one shape out of the picture"),
    ({"target": read(doubtful=True)}, "invert=true, if the shape is what was taken for the background"),
    ({"stopped": "the time limit of 9 s was reached", "options": {"seconds": 9}}, "more time: seconds=36"),
    ({"stopped": time_is_up(Deadline.usual())}, "more time: seconds=240"),
    ({"target": read(scale=5.0)}, "a larger picture: the shape was enlarged 5 times"),
    ({"options": {"maps": 8}}, "more maps: maps=16"), ({"options": {"at_most": 8}}, "more maps: at_most=16")])
def test_the_remedy_is_what_is_most_likely_to_help(facts, expected):
    assert expected in Verdict.of(likeness(0.7), 4, facts.pop("target", read()), **facts).remedy


@pytest.mark.parametrize("levels, expected", [("binary", "levels=coverage instead of binary"),
                                              ("coverage", "levels=auto instead of coverage")])
def test_where_the_shape_is_right_the_levels_may_be_wrong(levels, expected):
    verdict = Verdict.of(likeness(0.97), 4, read(levels=levels))
    assert verdict.remedy == expected and "another meaning of grey levels would help" in verdict.words
    assert expected.startswith(f"levels={verdict.change['levels']} ")


@pytest.mark.parametrize("scale, expected", [(0.4, "resolution=160: the picture was shrunk 2.5 times"),
                                             (0.8, "more maps: maps=8, with more time for each")])
def test_where_all_meanings_of_grey_levels_were_tried_a_finer_image_may_help(scale, expected):
    drawn = SHAPE.clone()
    drawn[drawn > 0] = torch.linspace(0.3, 1, int((drawn > 0).sum()))
    assert Verdict.of(likeness(0.97), 4, read(drawn, scale=scale)).remedy == expected


def test_a_known_truth_decides_whatever_the_picture_says():
    far, near = Verdict.of(likeness(0.2), 3, read()), Verdict.of(likeness(1), 3, read())
    assert far.against_truth(True, False) == Verdict("recovered", "recovered: the true code")
    assert far.against_truth(False, True).words == "recovered: another code of the true attractor"
    assert far.against_truth(False, False) == far and far.kind == "not recovered"
    assert near.kind == "recovered" and near.against_truth(False, False).kind == "approximation"


def test_a_code_no_better_than_a_box_is_none():
    filled = torch.zeros(64, 64)
    filled[16:48, 16:48] = 1
    filled[20:22, 20:40] = 0
    assert Verdict.of(likeness(0.9), 4, read(filled)).kind == "not recovered"
    assert Verdict.of(likeness(0.9), 4, read()).kind == "approximation"


def test_a_picture_without_a_clear_shape_must_be_hit_well():
    unclear = read(unclear="it looks like a page of text")
    verdict = Verdict.of(likeness(0.8), 4, unclear)
    assert verdict.kind == "not recovered" and "(it looks like a page of text)" in verdict.words
    assert Verdict.of(likeness(0.93), 4, unclear).kind == "approximation"


def test_a_verdict_speaks_of_colours_that_are_off():
    verdict = Verdict.of(likeness(1), 9, read())
    assert verdict.with_colours(3.0) == verdict == verdict.with_colours(None)
    off = verdict.with_colours(26.0)
    assert off.kind == "recovered" and "its colours are not the picture's, 26 apart" in off.words


@pytest.mark.parametrize("levels, kind", [("binary", "binary"), ("grey", "density"), ("drawn", "drawn")])
@pytest.mark.parametrize("code, slab", [(square(0.48), square()), (carpet(), square())], ids=["crosses", "carpet"])
def test_a_filled_square_is_not_the_figure_that_leaves_crosses_or_holes_out(levels, kind, code, slab):
    image = (redrawn(code, ReadImage.of_drawing(torch.zeros(192, 192), "drawn"), PEN) if levels == "drawn"
             else suite.target(code, 192, levels))
    target = ReadImage.of_drawing(image, kind)
    right, wrong = (Likeness.of(each, target, PEN if levels == "drawn" else None, seed=5) for each in (code, slab))
    assert Verdict.of(right, len(code), target).kind == "recovered"
    assert Verdict.of(replace(right, noise_ratio=9.0), len(code), target).kind == "recovered", "other random points"
    verdict = Verdict.of(wrong, len(slab), target)
    assert verdict.kind != "recovered" and "SSIM" in verdict.words
    assert (wrong.ssim_share or 0) < 0.7 < (right.ssim_share or 0)
    assert right.ssim == pytest.approx(right.ssim_chance, abs=0.05)


def test_a_filled_square_is_no_t_square():
    target = ReadImage.of_drawing(t_square(6), "drawn")
    found = Likeness.of(square(), target, PEN)
    assert found.f1_1px > 0.985, "to within a pixel, all of the light"
    assert found.f1_dark == pytest.approx(0, abs=0.1), "and none of the dark"
    assert Verdict.of(found, 4, target).kind != "recovered"


def test_a_code_without_the_tone_of_a_grey_picture_is_not_recovered():
    code = attractor.normalize(codes.known("fern"))
    target = read(suite.target(code, 192, "grey"))
    even = replace(code, probabilities=torch.full((4,), 0.25))
    assert Verdict.of(Likeness.of(code, target, seed=3), 4, target).kind == "recovered"
    assert Verdict.of(replace(Likeness.of(even, target, seed=3), f1_1px=1.0), 4, target).kind != "recovered"


def test_where_the_inside_is_lost_neither_more_pixels_nor_the_outline_are_enough():
    drawn = SHAPE.clone()
    drawn[drawn > 0] = torch.linspace(0.3, 1, int((drawn > 0).sum()))
    picture, slab = read(drawn, scale=0.4), likeness(0.99, ssim=0.08, ssim_chance=0.99, f1_dark=0.4, ssim_share=0.3)
    verdict = Verdict.of(slab, 4, picture)
    assert verdict.words == ("approximation of the outline with 4 maps; F1 .99 within a pixel, SSIM .08 inside; "
                             "more maps would help") and verdict.change == {"maps": 8}
    assert Verdict.of(replace(slab, f1_dark=0.9, ssim_share=0.9), 4, picture).kind == "recovered"
    assert Verdict.of(replace(slab, f1_dark=0.8, ssim_share=0.9), 4, picture).kind == "approximation"
    assert "SSIM -.08 inside" in Verdict.of(replace(slab, ssim=-0.08), 4, picture).words
