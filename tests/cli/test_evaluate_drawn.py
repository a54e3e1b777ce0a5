"""fractal-evaluate of codes against the picture that they should show: the likeness of fractal-invert, in any frame."""

import numpy as np
import pandas as pd
import pytest
from commands import refusal
from PIL import Image, ImageOps
from skimage.metrics import peak_signal_noise_ratio

from fractal_exp import IFS, View, codes, render, tracking
from fractal_exp.cli import evaluate as app
from fractal_exp.ifs import attractor
from fractal_exp.ifs.formats import save
from fractal_exp.images.pixels import write_image
from fractal_exp.images.reading import read_target
from fractal_exp.likeness import Likeness, camera_for, redrawn
from fractal_exp.verdict import Verdict

FERN = attractor.normalize(codes.known("fern"))
MOVED = FERN.similar(0.6, (0.2, -0.1))


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A fern off the middle of a wide picture, black on white; and a moved code of it."""
    monkeypatch.chdir(tmp_path)
    pixels = (255 * render(FERN, View((0.8, 0), 0.8), resolution=(128, 192), points_in_view=400_000).numpy()).round()
    ImageOps.invert(Image.fromarray(pixels.astype(np.uint8))).save("leaf.png")
    MOVED.save("moved.json")
    return tmp_path


def judged(*arguments, truth="leaf.png", resolution=64):
    app.main([*arguments, "--truth", truth, "--resolution", str(resolution), "--out", "judged"])
    return pd.read_csv("judged/inputs.csv", index_col=["fractal", "method"])


def test_a_code_is_placed_by_its_box_and_drawn_as_the_picture_was(folder, capsys):
    table = judged("moved.json", "fern", "--perceptual", "fractal")
    target = read_target("leaf.png", 64)
    camera = camera_for(attractor.normalize(MOVED), target)
    likeness = Likeness.of(attractor.normalize(MOVED), target, camera)
    row = table.loc["moved", "result"]
    for name, value in {"f1": likeness.f1, "f1_1px": likeness.f1_1px, "iou": likeness.iou,
                        "ssim_inside": likeness.ssim, "noise_ratio": likeness.noise_ratio}.items():
        assert row[name] == pytest.approx(value, rel=1e-6), name
    drawn = redrawn(attractor.normalize(MOVED), target, camera).numpy()
    assert row.psnr == pytest.approx(peak_signal_noise_ratio(target.image.numpy(), drawn, data_range=1), rel=1e-4)
    assert row.f1_1px > 0.98 and row.input == "leaf.png" and row.against == "picture"
    assert row.verdict == Verdict.of(likeness, len(MOVED), target).kind
    assert table.loc["fern", "result"].f1_1px > 0.98, "a classic needs no file"
    lit = int((target.image > 0.25).sum())
    white, black = (table.loc["moved", f"all {name}"] for name in ("white", "black"))
    assert white.f1 == pytest.approx(2 * lit / (lit + 64**2), rel=1e-6) and black.f1 == 0
    assert row.fractal_distance < min(white.fractal_distance, black.fractal_distance)
    report = (folder / "judged" / "report.txt").read_text()
    assert report in capsys.readouterr().out
    for words in ("2 codes against the picture leaf.png", "64² pixels", "black shape on white: inverted",
                  f"levels {camera.kind}, ", row.verdict):
        assert words in report
    strip = np.asarray(Image.open(folder / "judged" / "strips" / "moved.png"))
    assert strip.shape[1] > 3 * 300 and strip.max() > 200


def test_with_align_none_a_code_stays_where_it_is(folder):
    FERN.save("fern.json")
    table = judged("moved.json", "fern.json", "--align", "none")
    assert table.loc["moved", "result"].f1_1px < 0.5 and table.loc["moved", "result"].verdict != "recovered"
    assert table.loc["fern", "result"].f1_1px > 0.9


def test_every_kind_of_code_is_taken(folder):
    save([codes.known("tree"), codes.known("fern")], folder / "two.ifs")
    save([codes.known("fern")], folder / "one.flame")
    (folder / "leaf-fractal").mkdir()
    for name in ("code.json", "inversion.json"):  # as fractal-invert leaves them, one code
        FERN.save(folder / "leaf-fractal" / name)
    uri = tracking.prepare_store(folder / "outputs")
    with tracking.start_run(uri, "fits", "fern", folder=folder / "leaf-fractal") as run:
        run.artifact("code.json", folder / "leaf-fractal" / "code.json")
    table = judged("two.ifs:fern", "two.ifs:#1", "one.flame", "leaf-fractal", f"run:{run.run_id}", "--levels",
                   "density", "--track", "judgements")
    results = table.xs("result", level="method")
    assert list(results.index) == ["two-fern", "two-1", "one", "leaf-fractal", run.run_id]
    assert (results.f1_1px.drop("two-1") > 0.9).all() and results.f1_1px["two-1"] < 0.6, "the first is a tree"
    logged = tracking.runs_frame(uri, "judgements").iloc[0]
    assert logged["metrics.input/noise_ratio"] == pytest.approx(results.noise_ratio.mean())


def test_the_picture_is_read_as_it_is_told(folder):
    target = FERN.similar(0.8, (0, 0))
    write_image("canvas.png", render(target, resolution=64, supersample=16))
    bottom = Image.new("L", (64, 128))
    bottom.paste(Image.open("canvas.png"), (0, 64))
    bottom.paste(Image.fromarray(np.full((30, 40), 255, np.uint8)), (10, 10))
    bottom.save("both.png")
    both, one = (judged("fern", "--levels", "density", *words, truth="both.png").loc["fern", "result"]
                 for words in ((), ("--crop", "0", "64", "64", "128")))
    assert both.f1 < 0.7 < 0.85 < one.f1 and one.camera == "levels density"
    inverted = judged("fern", "--invert", "true", "--levels", "density", truth="canvas.png").loc["fern", "result"]
    assert inverted.f1 < 0.8, "the ground is taken for the shape"
    judged("fern", "--threshold", "0.2", "--levels", "density", truth="canvas.png")
    assert "canvas.png: binary at the threshold 0.2" in (folder / "judged" / "report.txt").read_text()


def test_of_a_picture_that_cuts_its_shape_off_only_what_it_shows_is_compared(folder, capsys):
    drawn = render(FERN.similar(1.2, (0, -0.35)), resolution=128, points_in_view=400_000).numpy()
    Image.fromarray((255 * drawn).round().astype(np.uint8)).save("cut.png")
    table = judged("fern", truth="cut.png", resolution=128)
    assert "cut.png: the picture cuts its shape off, and codes are placed by their own boxes; --align none leaves" \
        in capsys.readouterr().out
    target = read_target("cut.png", 128)
    mask = target.known.mask(128).numpy()
    assert not mask.all()
    lit = (target.image.numpy() > 0.25).sum()
    assert table.loc["fern", "all white"].f1 == pytest.approx(2 * lit / (lit + mask.sum()), rel=1e-6)


@pytest.mark.parametrize(("arguments", "message"), [
    (["leaf.png", "moved.json"], "leaf.png is a picture and moved.json is none, and they are compared with a picture "
                                 "in different ways; judge pictures and codes one after another"),
    (["moved.json", "leaf.png"], "judge pictures and codes one after another"),
    (["moved.json", "--views", "uniform"], "--views changes nothing where codes with a picture are compared"),
    (["moved.json", "--resolution", "8"], "resolution must be a whole number of at least 16"),
    (["moved.json", "--crop", "0", "0", "300", "20"], "crop"),
    (["fern", "wide.json"], "must be contractive"),
    (["moved.json", "--published", "."], "--published has truths of its own"),
])
def test_what_a_user_can_mend_is_one_line_before_any_work(folder, arguments, message):
    IFS([[[1.1, 0], [0, 1.1]]], [[0, 0]]).save("wide.json")
    line = refusal(app, *arguments, "--truth", "leaf.png", "--out", "judged")
    assert message in line and not (folder / "judged").exists()
