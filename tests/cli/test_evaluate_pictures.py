"""fractal-evaluate of a picture against a picture: scores to the edges, in any kind of file, and what is refused."""

import numpy as np
import pandas as pd
import pytest
import torch
from commands import refusal
from PIL import Image, ImageOps
from skimage.metrics import peak_signal_noise_ratio, structural_similarity

from fractal_exp import InputError, View, codes, render
from fractal_exp.cli import evaluate as app
from fractal_exp.evaluation.inside import ssim_inside
from fractal_exp.evaluation.pictures import compare_pictures
from fractal_exp.ifs import attractor
from fractal_exp.images.pixels import write_image
from fractal_exp.images.reading import read_grey

FERN = attractor.normalize(codes.known("fern"))


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Two drawings of one view, and where the second one is shifted by a pixel."""
    monkeypatch.chdir(tmp_path)
    for name, seed in (("truth", 0), ("again", 1)):
        write_image(tmp_path / f"{name}.png", render(FERN, View(zoom=1.3), resolution=(64, 96), seed=seed))
    write_image(tmp_path / "shifted.png", np.roll(np.asarray(Image.open("truth.png")), 1, 1))
    return tmp_path


def judged(*arguments):
    app.main([*arguments, "--truth", "truth.png", "--out", "judged"])
    return pd.read_csv("judged/pictures.csv", index_col="picture")


def test_a_picture_has_the_scores_of_the_definitions(folder, capsys):
    table = judged("again.png", "shifted.png", "truth.png", "--perceptual", "fractal")
    truth, again = (np.asarray(Image.open(f"{name}.png")) / 255 for name in ("truth", "again"))
    row, a, b = table.loc["again.png"], again > 0, truth > 0
    assert row.f1 == pytest.approx(2 * (a & b).sum() / (a.sum() + b.sum())) and row.f1 < row.f1_1px
    assert row.iou == pytest.approx((a & b).sum() / (a | b).sum())
    assert row.psnr == pytest.approx(peak_signal_noise_ratio(truth, again, data_range=1), rel=1e-5)
    assert row.ssim_inside == pytest.approx(ssim_inside(torch.from_numpy(again), torch.from_numpy(truth)), rel=1e-4)
    maps = structural_similarity(truth, again, gaussian_weights=True, use_sample_covariance=False, data_range=1,
                                 full=True)[1]
    assert row.ssim == pytest.approx(maps[5:-5, 5:-5].mean(), rel=1e-5)
    assert row.fractal_distance < table.loc["shifted.png"].fractal_distance < table.loc["all black"].fractal_distance
    shifted, same = table.loc["shifted.png"], table.loc["truth.png"]
    assert shifted.f1 < 0.95 and shifted.f1_1px > 0.99 and shifted.ssim < row.ssim
    assert same.f1 == same.iou == same.ssim == 1 and same.psnr == 100 and same.fractal_distance == 0
    told = capsys.readouterr().out
    for words in ("against truth.png, 96×64 px", "again.png: white shape on black", "distance: fractal", "all white"):
        assert words in told
    assert (folder / "judged" / "report.txt").read_text() in told
    assert Image.open(folder / "judged" / "strips" / "2-shifted.png").width > 900


def test_a_picture_is_taken_the_other_way_where_told(folder, capsys):
    table = judged("again.png", "--invert", "true")
    assert table.f1["again.png"] > 0.99 and table.f1["all white"] > 0.75, "the ground is the shape"
    assert "again.png: black shape on white: inverted, as asked" in capsys.readouterr().out
    told = refusal(app, "fern", "--truth", "fern", "--invert", "true")
    assert "--invert changes nothing where codes with codes are compared" in told


def test_black_on_white_transparent_and_coloured_pictures_say_how_they_are_read(folder, capsys):
    grey = Image.open("truth.png")
    ImageOps.invert(grey).save("black.png")
    clear = Image.new("LA", grey.size, 255)
    clear.putalpha(grey)
    clear.save("clear.png")
    Image.merge("RGB", [grey] * 3).save("coloured.png")
    table = judged("black.png", "clear.png", "coloured.png")
    assert (table.f1[:3] == 1).all() and (table.psnr[:3] > 80).all() and table.f1["all white"] < 0.5
    told = capsys.readouterr().out
    assert "black.png: black shape on white: inverted" in told and "clear.png: the shape is in the alpha" in told


def test_lit_is_what_is_brighter_than_the_background_and_the_errors_of_a_file(tmp_path):
    square = np.full((64, 64), 60, np.uint8)
    square[20:40, 20:40] = 220
    levels, lit, notes = read_grey(square)
    assert lit.sum() == 400 and levels[0, 0] == pytest.approx(60 / 255) and "lit is what is brighter than 0.24" in notes
    square[square == 60] = 0
    Image.fromarray(square).save(tmp_path / "a.jpg", quality=50)
    levels, lit, notes = read_grey(tmp_path / "a.jpg")
    assert lit.sum() == 400 < (levels > 0).sum() and "lit is what is brighter than 0.25" in notes


@pytest.mark.parametrize(("arguments", "message"), [
    (["small.png"], "small.png has 50×50 px, truth.png 96×64 px; draw it anew (fractal-render --size 96x64) or scale"),
    (["ten.png"], "must be at least 16 px on each side, got 10×10"),
    (["no.png"], "cannot read the picture"),
    (["again.png", "--resolution", "64"], "--resolution changes nothing where pictures are compared; leave it out"),
    (["again.png", "--align", "none"], "--align changes nothing where pictures"),
])
def test_what_a_user_can_mend_is_one_line(folder, arguments, message):
    grey = Image.open("truth.png")
    for name, side in (("small", 50), ("ten", 10)):
        grey.resize((side, side)).save(f"{name}.png")
    line = refusal(app, *arguments, "--truth", "truth.png", "--out", "judged")
    assert message in line and not (folder / "judged").exists()


def test_pictures_of_other_shapes_and_too_small_ones_are_refused():
    with pytest.raises(InputError, match=r"one shape \(H, W\), got \(20, 30\) and \(30, 20\)"):
        compare_pictures(torch.rand(20, 30), torch.rand(30, 20))
    with pytest.raises(InputError, match="SSIM needs pictures of at least 11 px a side, got 30×10"):
        compare_pictures(torch.rand(10, 30), torch.rand(10, 30))
