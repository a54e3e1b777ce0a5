"""The one road: every code is judged alike, drawn again as its picture was, and written into the same files."""

import pytest
import torch
from camera_helpers import CAMERAS, PIXEL, SIDE
from known import Known

from fractal_exp import codes, suite
from fractal_exp.cameras.camera import Camera, parse_camera
from fractal_exp.cameras.kinds import kind_of
from fractal_exp.cameras.params import CameraParams
from fractal_exp.errors import InputError
from fractal_exp.ifs import attractor
from fractal_exp.images.levels import MEANINGS, TargetImage, decided, meaning_of
from fractal_exp.images.reading import ReadImage
from fractal_exp.inversion import Inversion, Work, conclude, run, write
from fractal_exp.methods.base import CodeReconstruction, Progress
from fractal_exp.methods.collage.method import Collage

CODE = attractor.normalize(codes.known("sierpinski_triangle"))


def knowing(camera=None, interrupted=False) -> Known:
    """A method that tells the code, and is interrupted or has it as its answer."""
    told = Progress(1, 0.5, {"error": 1.0}, stage="first", code=CODE, camera=camera)
    return Known(None if interrupted else CodeReconstruction(CODE, camera=camera), [told])


def drawn(kind: str) -> ReadImage:
    """A target that the camera of this kind drew."""
    brightness = {"brightness": 0.05} if kind == "linear" else {}
    image = kind_of(kind)(CameraParams(), torch.zeros(SIDE, SIDE), CAMERAS[kind], **brightness).render(CODE, SIDE, 1)
    return ReadImage.of_drawing(image.clamp(0, 1), kind)


@pytest.mark.parametrize("kind", CAMERAS)
def test_a_code_is_drawn_again_as_its_picture_was_whatever_the_levels_mean(kind, tmp_path):
    target = drawn(kind)
    found = run(target, knowing(camera=CAMERAS[kind]), name="known")
    off = float((found.redrawn(seed=5) - target.image).abs().mean()) / float(target.image.mean())
    assert found.camera == CAMERAS[kind] and off < 0.2, "another kind of levels is farther off"
    found.save(tmp_path)
    again = Inversion.load(tmp_path)
    assert again.camera.kind == kind and again.target.levels == kind
    torch.testing.assert_close(again.redrawn(seed=5), found.redrawn(seed=5), rtol=0, atol=2e-3)


@pytest.mark.parametrize("kind", ["dots", "coverage"])
def test_the_camera_of_a_method_that_finds_none_is_estimated(kind):
    target = drawn(kind)
    found = run(target, knowing(), name="known")
    assert found.camera.kind == kind and found.camera.is_known and found.likeness.f1_1px > 0.95


def test_every_meaning_of_levels_has_a_camera():
    assert set(CAMERAS) == set(MEANINGS) - {"auto"}


def test_levels_are_decided_once_when_a_target_is_made():
    grey, binary = (suite.target(CODE, SIDE, kind) for kind in ("grey", "binary"))
    assert [meaning_of(each) for each in (grey, binary, grey / 2)] == ["density", "binary", "drawn"]
    assert TargetImage.of(grey).levels == "density" and TargetImage.of(grey, "dots").levels == "dots"
    chosen = TargetImage.of(grey, "dots")
    assert TargetImage.of(chosen) is chosen and TargetImage.of(chosen, "coverage").levels == "coverage"
    with pytest.raises(InputError, match="levels must be one of auto, density.*got 'dost'; did you mean 'dots'"):
        decided("dost", grey)


def test_a_camera_comes_back_from_its_facts():
    for camera in [*CAMERAS.values(), Camera("strokes", depth=4.0, thinning=1.0, pen=PIXEL, blur=0.0)]:
        assert parse_camera(camera.facts(SIDE), SIDE) == camera
    assert CAMERAS["coverage"].facts(SIDE) == pytest.approx(
        {"levels": "coverage", "tile_px": 0, "pen_px": 1, "blur_px": 0.5})


def test_an_interruption_estimates_a_camera_only_where_the_method_has_none():
    target = drawn("dots")
    judged, estimated = (run(target, knowing(camera, interrupted=True), name="known", keep_interrupted=True).camera
                         for camera in (CAMERAS["dots"], None))
    assert judged == CAMERAS["dots"] != estimated and estimated.kind == "dots" and estimated.is_known


def test_a_drawing_that_is_given_away_may_be_changed():
    found = run(drawn("dots"), knowing(camera=CAMERAS["dots"]), name="known")
    found.redrawn().zero_()
    assert found.redrawn().any()


def test_what_is_no_code_is_not_judged():
    with pytest.raises(TypeError, match="which is not a code"):
        conclude(Work(object()), ReadImage.of_drawing(suite.target(CODE, SIDE), "density"), name="picture")


def test_every_result_has_the_same_files(tmp_path):
    found = run(ReadImage.of_drawing(suite.target(CODE, SIDE), "density"), knowing(), name="known")
    names = write(found, tmp_path)
    assert sorted(names) == sorted(each.name for each in tmp_path.iterdir()) == [
        "code.html", "code.json", "inversion.json", "overlay.png", "redrawn.png", "rendering.png", "target.png"]


@pytest.mark.parametrize("levels, camera, message", [
    ("drawn", {"estimate": False, "blur_px": 0.5}, "camera.blur_px must be null if camera.estimate is false"),
    ("dots", {"pen_px": 1.5}, "camera.pen_px must be null if levels is dots, got 1.5"),
    ("coverage", {"gain": 1.0}, "camera.gain must be null if levels is coverage, got 1.0"),
    ("density", {"blur_px": 1.0}, "camera.blur_px must be null if levels is density, got 1.0")])
def test_what_is_known_of_a_camera_must_agree_with_the_levels(levels, camera, message):
    with pytest.raises(InputError, match=message):
        Collage(camera=camera).check(TargetImage.of(suite.target(CODE, SIDE), levels))
