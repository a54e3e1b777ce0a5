"""What `invert` returns."""

import io
import json
from dataclasses import asdict, replace

import numpy as np
import pytest
import torch
from known import Known, loading
from PIL import Image

from fractal_exp import IFS, InputError, Inversion, View, codes, evaluation, invert, render, suite
from fractal_exp.cameras.camera import Camera
from fractal_exp.ifs import attractor
from fractal_exp.images.reading import read_target
from fractal_exp.inversion import run
from fractal_exp.methods.base import CodeReconstruction, CurvePoint, Progress, stop_reason

QUICK = {"resolution": 64, "rounds": 1,
         "search": {"restarts": 1, "moves": 2, "detail_moves": 1}, "moves": {"count": 1},
         "growth": {"enabled": False}}
SIZE = (180, 120)  # of the picture, in pixels


def triangle_picture() -> np.ndarray:
    """A Sierpinski triangle of 80 px, black on white, off the middle of a wide picture: (120,180) uint8."""
    shape = render(attractor.normalize(codes.known("sierpinski_triangle")), resolution=107, points_in_view=300_000)
    pixels = np.full(SIZE[::-1], 255, np.uint8)
    pixels[10:117, 70:177] = 255 - np.rint(255 * shape.numpy()).astype(np.uint8)
    return pixels


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    path = tmp_path_factory.mktemp("picture") / "triangle.png"
    Image.fromarray(triangle_picture()).save(path)
    return path


@pytest.fixture(scope="module")
def told() -> list[Progress]:
    return []


@pytest.fixture(scope="module")
def found(path, told) -> Inversion:
    return invert(path, **QUICK, on_step=told.append)


def known(image, stopped="", notes=(), code=None, **options) -> Inversion:
    """`invert` with a method whose answer is the triangle."""
    code = attractor.normalize(codes.known("sierpinski_triangle")) if code is None else code
    told = [Progress(step, step / 3, {"score": 1 / step, "maps": 3.0}, stage=stage)
            for step, stage in enumerate(("look", "look", "polish"), 1)]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("fractal_exp.api.load", loading(CodeReconstruction(code, stopped, notes), told))
        return invert(image, **options)


@pytest.fixture(scope="module")
def kept(path) -> Inversion:
    """The triangle of the picture's file, read as a drawing, with a note and a limit of time."""
    return known(path, notes=("a note",), levels="coverage", seconds=np.float64(9))


def test_collage_search_is_taken_unless_another_method_is_named(found):
    assert found.method == "collage" and len(found.code) >= 2


def test_its_history_is_what_the_method_told(found, told):
    ends = [step for step in told if step.code is not None]
    assert len(found.history) == len(ends) >= 4
    for stage, end in zip(found.history, ends, strict=True):
        assert (stage.name, stage.maps) == (end.stage, len(end.code)) and stage.seconds >= 0
        assert (stage.score, stage.error) == (end.scalars["score"], end.scalars["error"])
    assert sum(stage.seconds for stage in found.history) <= found.seconds
    assert torch.equal(found.code.linear, ends[-1].code.linear)


def test_it_says_why_it_stopped(found):
    assert found.stopped == "the code draws the shape to within a pixel"
    assert known(triangle_picture(), stopped="the error reached 0", resolution=64).stopped == "the error reached 0"
    code = CodeReconstruction(found.code)
    assert stop_reason(code, 60.0, 61.0) == "the time limit of 60 s was reached"
    assert stop_reason(code, 60.0, 20.0) == stop_reason(code, None, 61.0) == "all stages done"


def test_a_code_that_is_far_off_is_warned_of():
    target = suite.target(codes.known("sierpinski_triangle"), 64).numpy()
    assert known(target, resolution=64, frame="keep").warnings == ()
    fern = attractor.normalize(codes.known("fern"))
    found = known(target, resolution=64, frame="keep", stopped="asked to", code=fern)
    assert found.warnings == (f"{found.verdict} (asked to)",) and found.verdict.kind == "not recovered"


def test_notes_and_warnings_of_the_picture_and_of_the_method_are_kept():
    found = known(triangle_picture(), notes=("a symmetry was found",), resolution=256)
    assert "black shape on white: inverted" in found.notes and "a symmetry was found" in found.notes
    assert any("linear interpolation" in warning for warning in found.warnings)


def test_pixels_go_to_the_canvas_and_back(found):
    placement = found.placement
    assert placement.size == SIZE
    corners = placement.to_canvas([(70 + 107 * 0.125, 10 + 107 * 0.125), (70 + 107 * 0.875, 10 + 107 * 0.875)])
    # the triangle spans 75% of the canvas by width; it is less high, and centred
    np.testing.assert_allclose(corners[:, 0], [-0.75, 0.75], atol=0.03)
    assert corners[0, 1] > 0 > corners[1, 1], "y points up"
    points = np.random.default_rng(0).uniform(-1, 1, (5, 3, 2))
    np.testing.assert_allclose(placement.to_canvas(placement.to_pixels(points)), points, atol=1e-12)


@pytest.mark.parametrize("of", [np.asarray, str])
def test_the_overlay_marks_what_is_missing_and_what_is_too_much(of, kept, tmp_path):
    picture = triangle_picture()
    found = kept if of is str else known(picture)
    written = tmp_path / "overlay.png"
    for code in (found.code, found.code.similar(1.0, (0.3, 0.0))):
        overlay = np.asarray(replace(found, code=code).overlay(written, opacity=1.0))
        assert np.array_equal(np.asarray(Image.open(written)), overlay)
        assert overlay.shape[1:] == (SIZE[0], 3) and overlay.shape[0] > SIZE[1], "there is a legend below"
        red, blue = overlay[:SIZE[1], :, 0].astype(int), overlay[:SIZE[1], :, 2].astype(int)
        missing, extra = red - blue > 100, blue - red > 50
        assert code is not found.code or missing.sum() < 20, "the right code lacks next to nothing"
    assert missing.sum() > 200 and extra.sum() > 300
    assert (picture[missing] < 192).mean() > 0.9 and (picture[extra] > 192).mean() > 0.7


def test_the_overlay_of_a_coloured_picture_is_marked_on_greys():
    picture = np.zeros((*SIZE[::-1], 4), np.uint8)
    picture[..., 1], picture[..., 3] = 255 - triangle_picture(), 255
    picture[:5] = 0  # transparent, laid on black as the shape is white
    overlay = np.asarray(known(picture).overlay(opacity=0.001))[:SIZE[1]]
    assert np.ptp(overlay.astype(int), axis=2).max() <= 1
    assert np.corrcoef(overlay[..., 0].ravel(), picture[..., 1].ravel())[0, 1] > 0.999


def test_it_is_rendered_and_judged_like_a_code():
    found = known(triangle_picture(), levels="coverage", resolution=64)  # a drawing has no tone
    view = View((0.1, 0.2), 3.0)
    assert torch.equal(found.render(view, resolution=64), render(found.code, view, resolution=64))
    frame = evaluation.evaluate(found, codes.known("sierpinski_triangle"), resolution=64, points_in_view=20_000)
    assert frame["f1"].min() > 0.9


@pytest.mark.parametrize("name", ["folder", "leaf.json"])
def test_it_is_saved_with_all_facts_and_read_as_a_code(kept, path, tmp_path, name):
    found, written = kept, kept.save(tmp_path / name)
    whole = written / "inversion.json" if name == "folder" else written
    for file in [whole, *([written / "code.json"] if name == "folder" else [])]:
        assert torch.equal(IFS.load(file).linear, found.code.linear)
    facts = json.loads(whole.read_text())["meta"]["inversion"]
    assert facts == found.facts()
    assert facts["likeness"] == asdict(found.likeness) and facts["verdict"] == asdict(found.verdict)
    assert facts["placement"] == {"size": list(SIZE), "crop_box": list(found.placement.crop_box)}
    code, picture = facts["dimension"]["code"], facts["dimension"]["picture"]
    assert code == asdict(found.code.dimension()) and code["value"] == pytest.approx(np.log2(3), abs=1e-5)
    assert picture["kind"] == "boxes" and picture["low"] < code["value"] < picture["high"]
    assert found.dimension == f"code 1.5850, exact (similarity); picture {found.dimensions['picture']} (boxes)"
    assert facts["source"] == str(path) and facts["stopped"] == "all stages done" and "a note" in facts["notes"]
    assert [stage["name"] for stage in facts["stages"]] == ["look", "polish"] and facts["options"]["seconds"] == 9
    if name == "folder":
        assert "inversion" not in json.loads((written / "code.json").read_text())["meta"]


def test_a_notebook_shows_it_and_its_code(found):
    for thing in (found, found.code):
        picture = Image.open(io.BytesIO(thing._repr_png_()))
        assert np.asarray(picture).std() > 10
    assert repr(codes.known("fern")) == "IFS('fern', 4 maps)" and repr(found.code) == f"IFS({len(found.code)} maps)"
    wild = IFS(torch.eye(2)[None] * 2, torch.zeros(1, 2))
    assert wild._repr_png_() is None and repr(wild) == "IFS(1 map)"


def test_a_bar_is_shown_where_it_is_asked_for(capsys):
    known(triangle_picture(), resolution=64)
    assert capsys.readouterr().err == ""
    known(triangle_picture(), progress=True, resolution=64)
    assert "100%" in (shown := capsys.readouterr().err) and "polish" in shown
    with pytest.raises(InputError, match="progress must be True or False, got 'yes'"):
        invert(triangle_picture(), progress="yes")


def test_a_saved_inversion_is_loaded(kept, tmp_path):
    folder = kept.save(tmp_path / "found")
    for place in (folder, folder / "inversion.json"):
        loaded = Inversion.load(place)
        assert torch.equal(loaded.code.linear, kept.code.linear) and loaded.facts() == kept.facts()
        torch.testing.assert_close(loaded.target.image, kept.target.image, atol=1e-5, rtol=0)
    np.testing.assert_allclose(*(np.asarray(each.overlay()).astype(int) for each in (loaded, kept)), atol=1)
    assert "inversion" not in loaded.code.meta


def test_a_folder_of_an_older_version_is_read(kept, tmp_path):
    """It knew neither the meaning of the levels nor the camera nor the inside, and its curve had no codes."""
    found = replace(kept, curve=(CurvePoint(3, 0.9, 36, codes.known("sierpinski_triangle")),))
    whole = found.save(tmp_path / "old") / "inversion.json"
    data = json.loads(whole.read_text())
    facts = data["meta"]["inversion"]
    del facts["levels"], facts["camera"], facts["curve"][0]["code"]
    for name in ("ssim", "ssim_chance", "f1_dark", "ssim_share"):
        del facts["likeness"][name]
    facts["options"]["camera"], facts["verdict"]["kind"] = {"pens": 3}, "not self-similar"
    whole.write_text(json.dumps(data))
    old = Inversion.load(tmp_path / "old")
    assert old.target.levels == found.target.levels and old.camera.kind == found.camera.kind and old.curve == ()
    assert old.verdict.kind == "not recovered" and old.likeness.ssim is None and not old.likeness.is_outline
    assert old.redrawn().shape == found.target.image.shape


def test_what_is_no_saved_inversion_is_refused(kept, tmp_path):
    folder = kept.save(tmp_path / "found")
    codes.known("fern").save(tmp_path / "inversion.json")
    with pytest.raises(InputError, match="is not an inversion of this version"):
        Inversion.load(tmp_path)
    whole = (folder / "inversion.json").read_text()
    data = json.loads(whole)
    del data["meta"]["inversion"]["likeness"]["f1"]
    (folder / "inversion.json").write_text(json.dumps(data))
    with pytest.raises(InputError, match="inversion.json is damaged: 'likeness.f1': Field required; invert"):
        Inversion.load(folder)
    (folder / "inversion.json").write_text(whole)
    (folder / "target.png").unlink()
    with pytest.raises(InputError, match="target.png"):
        Inversion.load(folder)


def test_how_the_picture_is_read_can_be_told():
    found = known(triangle_picture(), invert=True, threshold=0.5, clean=False, resolution=64)
    assert "black shape on white: inverted, as asked" in found.notes and "binary at the threshold 0.5" in found.notes
    assert found.options["threshold"] == found.facts()["reading"]["threshold"] == 0.5
    found = known(triangle_picture(), crop=np.array([60, 4, 178, 118]), resolution=64)
    assert found.target.crop == found.options["crop"] == (60, 4, 178, 118)
    assert found.facts()["options"]["crop"] == [60, 4, 178, 118] and found.placement.size == SIZE


def test_an_interruption_returns_the_best_code_so_far():
    target = read_target(triangle_picture(), 64, levels="coverage")
    camera = Camera("coverage", tile=0.0, pen=1 / 64, blur=1 / 128)
    told = [Progress(step, 0.1 * step, stage=str(step), code=attractor.normalize(codes.known(name)), camera=camera)
            for step, name in enumerate(("sierpinski_triangle", "fern"), 1)]
    found = run(target, Known(None, told), name="known", keep_interrupted=True)
    assert found.stopped == "interrupted" and found.code == told[0].code
    for some, keeps in ((told, False), ([], True)):
        with pytest.raises(KeyboardInterrupt):
            run(target, Known(None, some), name="known", keep_interrupted=keeps)


def test_a_code_is_kept_though_whom_it_is_told_is_interrupted(path):
    told = []

    def listen(progress):
        if progress.code is not None:
            told.append(progress.code)
            raise KeyboardInterrupt  # as `interruption.check` does once a signal came

    found = invert(path, **QUICK, keep_interrupted=True, on_step=listen)
    assert found.stopped == "interrupted" and torch.equal(found.code.linear, told[-1].linear)
    with pytest.raises(KeyboardInterrupt):
        invert(path, **QUICK, on_step=listen)
