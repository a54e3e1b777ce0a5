"""The tone of a picture whose grey levels are a density: kept with its code, and found again in every view."""

import logging
from argparse import Namespace
from dataclasses import replace

import numpy as np
import pytest
import torch
from commands import refusal
from PIL import Image

from fractal_exp import IFS, Colours, InputError, Inversion, View, codes, render
from fractal_exp.cameras.camera import Camera
from fractal_exp.cameras.kinds import kind_of
from fractal_exp.cameras.params import CameraParams
from fractal_exp.cli import drawing
from fractal_exp.cli import render as render_app
from fractal_exp.ifs import attractor
from fractal_exp.images.painted import Painted
from fractal_exp.images.reading import ReadImage
from fractal_exp.inversion import Work, conclude, write
from fractal_exp.inversion.road import coloured
from fractal_exp.methods.base import CodeReconstruction
from fractal_exp.rendering.colour import on_ground, own_ground
from fractal_exp.rendering.film import frames
from fractal_exp.rendering.morph import morph
from fractal_exp.rendering.still import render_tiles
from fractal_exp.rendering.tone import Tone, own_tone, softened, tone_of, usual_mode
from fractal_exp.rendering.toned import Toned
from fractal_exp.rendering.zoom import zoom_path

SIDE = 160
FERN = attractor.normalize(codes.known("fern"))
CAMERAS = {"dots": Camera("dots", gain=0.05, blur=1 / SIDE),
           "tonemapped": Camera("tonemapped", gain=0.1, gamma=2.2, blur=1 / SIDE),
           "linear": Camera("linear", blur=1 / SIDE)}
CURVES = {"dots": (1.0, False), "tonemapped": (2.2, False), "linear": (1.0, True)}
TONE = {"light": 0.3, "gamma": 1.5, "linear": False}
TONED = replace(FERN, meta={"tone": TONE})
COLOURS = Colours([[0.1, 0.5, 0.1], [0.2, 0.8, 0.3], [0.9, 0.7, 0.1], [0.6, 0.2, 0.7]], [1, 0.3, 0.6, 0.6])
PAINTED = replace(FERN, meta={"tone": TONE | {"cover": 0.7}, "ground": "#fff8e7"}, colours=COLOURS)
INSIDE = -0.16, -0.1  # a point of the fern, with fronds around it


def found(kind: str) -> Inversion:
    """The fern, found in a picture that a camera of this kind drew."""
    brightness = {"brightness": 0.05} if kind == "linear" else {}
    levels = kind_of(kind)(CameraParams(), torch.zeros(SIDE, SIDE), CAMERAS.get(kind), **brightness)
    image = levels.render(FERN, SIDE, 1)
    return conclude(Work(CodeReconstruction(FERN, camera=CAMERAS.get(kind))),
                    ReadImage.of_drawing(image.clamp(0, 1), kind), name="known")


def psnr(image, truth) -> float:
    return float(-10 * (image - truth).square().mean().log10())


def lit_mean(image) -> float:
    return float(image[image > 0.05].mean())


@pytest.mark.parametrize("kind", CAMERAS)
def test_a_code_is_drawn_as_its_picture_was_and_so_are_copies_in_it(kind):
    result = found(kind)
    redrawn, drawn = result.redrawn().clamp(0, 1), result.render(resolution=SIDE)
    assert psnr(drawn, redrawn) > 25
    assert psnr(result.render(resolution=SIDE, mode="occupancy"), redrawn) < (20 if kind == "tonemapped" else 16)
    tone = tone_of(result.code)
    assert (tone.gamma, tone.linear) == CURVES[kind]
    for zoom in (16, 256):
        view = result.render(View(attractor.random_point(FERN, 3), zoom), resolution=SIDE)
        assert abs(lit_mean(view) - lit_mean(drawn)) < 0.05
        assert float((view > 0.98).float().mean()) < 0.2, "nothing is a white cloud"
    finer = result.render(resolution=3 * SIDE, points_in_view=2_000_000)
    assert abs(lit_mean(finer) - lit_mean(drawn)) < 0.05, "pixels and points change nothing"


def test_pictures_that_are_no_density_of_others_have_no_tone():
    for kind in ("density", "binary"):
        result = found(kind)
        assert "tone" not in result.code.meta and usual_mode(result.code) == "occupancy"
        assert torch.equal(result.render(resolution=32), render(FERN, resolution=32))


def test_the_tone_of_another_picture_does_not_stay():
    image = render(FERN, resolution=64)
    result = conclude(Work(CodeReconstruction(TONED)), ReadImage.of_drawing(image, "density"), name="known")
    assert result.code.meta == {}


def test_files_keep_the_tone_and_every_file_of_a_result_shows_it(tmp_path):
    result = found("dots")
    write(result, tmp_path)
    for code in (IFS.load(tmp_path / "code.json"), Inversion.load(tmp_path).code):
        assert tone_of(code) == tone_of(result.code)
    small = Image.open(tmp_path / "rendering.png").resize((SIDE, SIDE), Image.Resampling.BOX)
    assert psnr(torch.from_numpy(np.asarray(small) / 255), result.redrawn()) > 25


@pytest.mark.parametrize("wrong", [
    7, "bright", None, [], {}, {"gamma": 1.0}, {"light": float("nan")}, {"light": float("inf")}, {"light": -0.1},
    {"light": 0}, {"light": 1.5}, {"light": "0.3"}, {"light": True}, {"light": 10**400}, {"light": [0.3]},
    {"light": 0.3, "gamma": 0}, {"light": 0.3, "gamma": 1e9}, {"light": 0.3, "gamma": None},
    {"light": 0.3, "linear": "no"}, {"light": 0.3, "linear": 1}, {"light": 0.3, "gain": 1}], ids=repr)
def test_a_note_that_is_no_tone_is_left_out_and_refused_where_it_is_asked_for(wrong, caplog):
    code = replace(FERN, meta={"tone": wrong})
    with caplog.at_level(logging.WARNING):
        assert usual_mode(code) == "occupancy" and own_tone(code) is None
    assert len(caplog.text) < 1000 and "left out" in caplog.text
    with pytest.raises(InputError, match="tone"):
        render(code, resolution=16, mode="tone")


def test_a_code_without_a_tone_and_tiles_are_refused_before_anything_is_drawn():
    with pytest.raises(InputError, match='no tone to draw with.*mode="density"'):
        render(FERN, resolution=10**9, mode="tone")
    with pytest.raises(InputError, match="whole view"):
        render_tiles(TONED, resolution=16, mode="tone")


@pytest.mark.parametrize("tone", [Tone(0.3), Tone(0.5, 2.2), Tone(0.4, 1, True), Tone(0.9), Tone(0.01, 0.5)], ids=str)
def test_an_exposure_gives_the_light_whatever_the_scale(tone):
    density = softened(render(FERN, resolution=128, mode="density"))
    exposure = tone.exposure(density)
    assert Tone.of_picture(tone.grey(density, exposure)).light == pytest.approx(tone.light, rel=0.01)
    assert tone.exposure(1000 * density) == pytest.approx(exposure / 1000, rel=1e-3)
    assert not Toned(tone).drawn(torch.zeros(8, 8)).any()
    assert Tone.of_picture(torch.zeros(8, 8)) is None


def test_a_thin_line_that_is_far_denser_leaves_the_rest_of_a_view_visible():
    density = torch.ones(64, 64)
    density[:, 32] = 1e4
    drawn = Toned(Tone(0.3)).drawn(density)
    assert 0.2 < float(drawn[:, :30].mean()) < 0.4


def test_frames_of_a_zoom_have_the_tone_and_do_not_flicker():
    views = zoom_path(attractor.random_point(FERN, 3), 24, end_zoom=256)
    film = list(frames(TONED, views, resolution=96, mode="tone"))
    levels = np.array([lit_mean(each) for each in film])
    whole = lit_mean(render(TONED, resolution=96, mode="tone"))
    assert levels[0] == pytest.approx(whole, abs=0.03) and np.abs(np.diff(levels)).max() < 0.05
    with pytest.raises(InputError, match="no tone"):
        frames(FERN, views, mode="tone")


def test_a_morph_goes_from_tone_to_tone():
    other = replace(attractor.normalize(codes.known("tree")), meta={"tone": {"light": 0.5}})
    assert tone_of(morph(TONED, other, 0.5)) == Tone(0.4, 1.25)
    assert "tone" not in morph(TONED, FERN, 0.5).meta


def pixels(path) -> np.ndarray:
    return np.asarray(Image.open(path)) / 255


def test_the_command_draws_the_tone_unless_told_otherwise(tmp_path):
    TONED.save(tmp_path / "code.json")

    out = tmp_path / "out.png"
    words = [str(tmp_path / "code.json"), str(out), "--size", "96"]

    def command(*arguments):
        render_app.main([*words, *arguments])
        return pixels(out)

    toned = render(attractor.normalize(TONED), View((0, 0), 2), resolution=96, mode="tone")
    np.testing.assert_allclose(command("--zoom", "2"), toned, atol=0.01)
    plain = render(attractor.normalize(FERN), resolution=96)
    np.testing.assert_allclose(command("--mode", "occupancy"), plain, atol=0.01)
    for arguments, message in ((["--supersample", "4"], "--mode occupancy"), (["--background", "red"], "--mode tone")):
        assert message in refusal(render_app, *words, *arguments)
    FERN.save(tmp_path / "code.json")
    assert "no tone" in refusal(render_app, *words, "--mode", "tone")


def drawn_in_tiles(code, mode, size, path) -> np.ndarray:
    """What the command draws with pixels of 64² parts, so that a tile has 128 pixels a side at most."""
    options = Namespace(mode=mode, size=size, out=path, center=None, zoom=None, points=None, supersample=64, seed=0,
                        bits=8, transparent=False, ground=own_ground(code))
    return pixels(drawing.draw_still(code, options))


@pytest.mark.parametrize(("size", "shape"), [("200", 200), ("300x140", (140, 300))])
def test_a_still_of_several_tiles_has_no_seams(tmp_path, size, shape):
    density = render(FERN, resolution=90, mode="density")
    for height in (1, 40, 90):
        bands = torch.cat(list(drawing.softened_bands(iter(density.split(height)), Toned(Tone(0.3)))))
        assert torch.equal(bands, softened(density))
    tiled = drawn_in_tiles(TONED, "tone", size, tmp_path / "a.png")
    assert np.abs(tiled - render(TONED, resolution=shape, mode="tone").numpy()).max() < 0.1


def test_a_code_in_colours_covers_as_much_as_the_shape_did_in_its_picture():
    for view in (View(), View(INSIDE, 8)):
        image = render(PAINTED, view, resolution=96, mode="colour")
        assert Tone.of_picture(image[..., 3]).light == pytest.approx(0.7, abs=0.02)
        tinted = render(PAINTED, view, resolution=96, mode="tinted")
        density = render(PAINTED, view, resolution=96, mode="density")
        assert tinted[..., 3].mean() == pytest.approx(1, abs=0.02) and psnr(tinted[..., 3] / 16, density / 16) > 25
        dense = density > 1  # where the neighbours' points hardly change the mean colour
        assert (image[dense][:, :3] - tinted[dense][:, :3]).abs().mean() < 0.05


def test_without_a_cover_colours_are_as_opaque_as_the_points_lie():
    bare = replace(PAINTED, meta={"tone": TONE})
    assert torch.equal(render(bare, resolution=64, mode="colour"),
                       render(replace(bare, meta={}), resolution=64, mode="colour"))


@pytest.mark.parametrize(("size", "shape"), [("140", 140), ("96x260", (260, 96))])
def test_stills_tiles_and_films_in_colour_have_the_cover(tmp_path, size, shape):
    ground = (1.0, 248 / 255, 231 / 255)
    image = on_ground(render(PAINTED, resolution=shape, mode="colour"), ground).numpy()
    film = next(iter(frames(PAINTED, [View()], resolution=shape, mode="colour")))
    assert np.abs(film.numpy() - image).mean() < 0.01
    assert np.abs(drawn_in_tiles(PAINTED, "colour", size, tmp_path / "a.png") - image).mean() < 0.02
    with pytest.raises(InputError, match='mode="tinted"'):
        render_tiles(PAINTED, resolution=96, mode="colour")


def test_colours_found_in_a_picture_bring_its_cover_with_them():
    result = found("dots")
    grey = result.target.image.numpy()
    cover = np.where(grey > 0.02, 0.8, 0).astype(np.float32)
    seen = np.stack([cover * 0.2, cover * 0.8, cover * 0.3], -1)
    code = coloured(result, Painted(seen, np.zeros(3), cover, cover > 0.5)).code
    assert tone_of(code).cover == pytest.approx(0.8, abs=0.01) and tone_of(code).light == tone_of(result.code).light
    drawn = render(code, resolution=SIDE, mode="colour")
    lit = drawn[..., 3] > 0.5
    assert (drawn[lit][:, :3].mean(0) - torch.tensor([0.2, 0.8, 0.3])).abs().max() < 0.03


def test_a_film_in_colour_has_no_cover_unless_all_its_codes_have_one():
    bare = replace(PAINTED, meta={"ground": "#fff8e7"})
    mixed = list(frames([PAINTED, bare], [View(), View()], resolution=64, mode="colour"))
    plain = list(frames([bare, bare], [View(), View()], resolution=64, mode="colour"))
    assert all(torch.equal(one, other) for one, other in zip(mixed, plain, strict=True))
