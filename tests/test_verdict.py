"""How like a code is to a picture, and what `invert` says of it in words."""

from dataclasses import replace

import pytest
import torch

from fractal_exp import codes, suite
from fractal_exp.ifs import attractor
from fractal_exp.images.levels import meaning_of
from fractal_exp.images.reading import ReadImage
from fractal_exp.likeness import Likeness
from fractal_exp.verdict import Verdict

SHAPE = torch.zeros(64, 64)
SHAPE[16:48, 8:56] = torch.eye(48)[:32]


def likeness(f1_1px, noise_ratio=9.0):
    return Likeness(f1_1px, f1_1px, noise_ratio, f1_1px)


def read(image=SHAPE, **facts):
    return replace(ReadImage.of_drawing(image, meaning_of(image)), **facts)


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
