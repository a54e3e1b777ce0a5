"""Colours of a code from a picture."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from known import loading
from PIL import Image, ImageDraw

from fractal_exp import IFS, Colours, InputError, codes, invert, render
from fractal_exp.colouring import colour_error, fitted, fitting, in_colours
from fractal_exp.colouring.fitting import sampled
from fractal_exp.ifs import affine, attractor
from fractal_exp.images import read_target
from fractal_exp.images.painted import Painted
from fractal_exp.inversion import Inversion, write
from fractal_exp.methods.base import CodeReconstruction
from fractal_exp.rendering.colour import on_ground, own_ground

FERN = attractor.normalize(codes.known("fern"))
TRUE = Colours([[0.36, 0.25, 0.15], [0.1, 0.62, 0.3], [0.85, 0.8, 0.1], [0.9, 0.25, 0.3]], [0.9, 0.15, 0.5, 0.7])


@pytest.fixture(scope="module")
def drawn() -> np.ndarray:
    """The coloured fern, (192,192,4) uint8 with its opacity."""
    image = render(replace(FERN, colours=TRUE), resolution=192, points_in_view=2_000_000, mode="colour", seed=9)
    return np.rint(255 * image.numpy()).astype(np.uint8)


@pytest.fixture(scope="module")
def picture(drawn) -> np.ndarray:
    """The coloured fern on white, (192,192,3) uint8."""
    return laid(drawn, (1.0, 1.0, 1.0))


def laid(drawn: np.ndarray, ground: tuple[float, float, float]) -> np.ndarray:
    return np.rint(255 * on_ground(torch.from_numpy(drawn / 255), ground).numpy()).astype(np.uint8)


def painted(pixels: np.ndarray) -> Painted:
    return Painted.of(read_target(pixels, 192, frame="keep", clean=False))


def test_the_true_colours_are_found(drawn):
    seen = painted(drawn)
    code = fitted(replace(FERN, colours=None), seen)
    assert torch.equal(code.linear, FERN.linear) and torch.equal(code.probabilities, FERN.probabilities)
    assert "name" in FERN.meta and code.meta == {**FERN.meta, "ground": "#000000"}
    assert colour_error(code, seen) < 0.5
    assert (code.colours.rgb - TRUE.rgb).abs().max() < 0.02
    assert (code.colours.blends - TRUE.blends).abs().max() < 0.05
    wrong = replace(FERN, colours=Colours(TRUE.rgb[[1, 2, 3, 0]], TRUE.blends))
    assert colour_error(wrong, seen) > 10


@pytest.mark.slow
def test_sixteen_maps_have_the_colours_of_four(drawn):
    """A code of all words of two letters: no colours of such maps are quite those of the letters."""
    words = replace(affine.to_code(affine.compositions(affine.from_code(FERN), affine.from_code(FERN))),
                    probabilities=torch.outer(FERN.probabilities, FERN.probabilities).flatten(), meta={})
    seen = painted(drawn)
    sample = sampled(words, seen, 0)
    alike = min(fitting.alike(sample, blend).cost for blend in fitting.ALIKE)
    assert fitting.improved(sample, fitting.alike(sample, 0.55).x).cost < alike / 10
    assert colour_error(fitted(words, seen), seen) < 2


def test_the_derivatives_are_those_of_differences(drawn):
    sample = sampled(FERN, painted(drawn), 0)
    rgb, blends = TRUE.rgb.double().numpy(), TRUE.blends.double().numpy()
    weights, slopes = sample.walked(rgb, blends)
    assert np.abs(weights.sum(1) - 1).max() < 1e-9  # a mean of the maps' colours
    for m in range(4):
        step = 1e-4 * np.eye(4)[m]
        up, down = (sample.walked(rgb, blends + sign * step)[0] @ rgb for sign in (1, -1))
        # The first colours, before the points that count, depend on the blends too, but are forgotten by then.
        assert np.abs((up - down) / 2e-4 - slopes[:, m]).max() < 1e-3


@pytest.mark.parametrize("ground", [(1.0, 1.0, 1.0), (0.0, 0.0, 0.0), (0.9, 0.95, 1.0)], ids=["white", "black", "pale"])
def test_colours_are_found_on_any_ground(drawn, ground):
    """The opacity must be guessed, at the edges of thin leaves: no better error can be asked for than the truth's."""
    seen = painted(laid(drawn, ground))
    assert np.abs(seen.ground - ground).max() < 0.01
    code = fitted(FERN, seen)
    assert np.abs(np.subtract(own_ground(code), ground)).max() < 0.01
    error = colour_error(code, seen)
    assert error < colour_error(replace(FERN, colours=TRUE), seen) + 0.2 < 6


def test_half_a_pixel_of_colour_is_no_paler_colour():
    """A disc of one colour with smooth edges: its edge pixels are partly covered, and wholly of that colour."""
    large = Image.new("RGB", (800, 800), "white")
    ImageDraw.Draw(large).ellipse((150, 150, 650, 650), fill=(200, 30, 60))
    smooth = np.asarray(large.resize((100, 100), Image.Resampling.BOX))
    clear = np.dstack([np.full((100, 100, 3), [200, 30, 60]), 255 * disc(100)]).astype(np.uint8)
    for pixels in (smooth, clear):
        seen = Painted.of(read_target(pixels, 100, frame="keep"))
        own = seen.cover[..., None] * [200 / 255, 30 / 255, 60 / 255] + (1 - seen.cover[..., None]) * seen.ground
        assert np.abs(seen.seen - own)[seen.lit].max() < 0.02
        assert seen.lit.sum() == pytest.approx(np.pi / 4 * (100 * 5 / 8) ** 2, rel=0.02)


def disc(side: int) -> np.ndarray:
    y, x = (np.mgrid[:side, :side] + 0.5 - side / 2) / side
    return np.hypot(x, y) < 5 / 16


def test_finer_pictures_are_compared_finely_and_one_without_its_source_in_greys(picture):
    target = read_target(np.repeat(np.repeat(picture, 3, 0), 3, 1), 128)
    assert len(Painted.of(target).seen) in (256, 384, 512)
    assert Painted.of(replace(target, source=None)).is_grey and not Painted.of(target).is_grey


def test_no_colours_where_code_and_picture_share_no_pixel(picture):
    point = IFS(torch.zeros(1, 2, 2), torch.tensor([[0.9, 0.9]]))
    assert fitted(point, painted(picture)) is None


def known(picture, colour: bool) -> Inversion:
    """`invert` with a method whose answer is the fern."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("fractal_exp.api.load", loading(CodeReconstruction(FERN, "asked to")))
        return invert(picture, resolution=192, frame="keep", colour=colour)


@pytest.fixture(scope="module")
def coloured(picture) -> Inversion:
    return known(picture, colour=True)


def test_invert_with_colour_keeps_the_shape(picture, coloured, tmp_path):
    plain = known(picture, colour=False)
    assert plain.code.colours is None and plain.likeness.colour is None and "CIEDE2000" not in str(plain)
    assert torch.equal(plain.code.linear, coloured.code.linear) and plain.likeness.f1 == coloured.likeness.f1
    assert 0 < coloured.likeness.colour < 6 and "apart (CIEDE2000)" in str(coloured)
    assert coloured.options["colour"] is True and "colour" not in plain.options
    back = Inversion.load(coloured.save(tmp_path / "fern"))
    assert back.likeness == coloured.likeness and torch.equal(back.code.colours.rgb, coloured.code.colours.rgb)
    coloured.render(resolution=64, mode="colour", path=tmp_path / "fern.png")
    pixels = np.asarray(Image.open(tmp_path / "fern.png"))
    assert pixels.shape == (64, 64, 3) and pixels[0, 0].tolist() == [255, 255, 255]


def test_a_code_with_colours_is_redrawn_in_them_on_the_ground_of_its_picture(coloured, picture, tmp_path):
    found = coloured
    write(found, tmp_path)
    redrawn = np.asarray(Image.open(tmp_path / "redrawn.png")).astype(float)
    assert redrawn.shape == picture.shape and redrawn[0, 0].tolist() == [255, 255, 255]
    grey = 255 * (1 - found.redrawn().numpy()[..., None])
    shape = found.target.image.numpy() > 0.2
    assert np.abs(redrawn - picture)[shape].mean() < 0.7 * np.abs(grey - picture)[shape].mean()
    assert found.redrawn().shape == (192, 192), "what is compared with the target stays grey"
    with pytest.raises(InputError, match="colours"):
        replace(found, code=FERN).redrawn(colour=True)


def test_ink_beside_the_points_has_the_colour_of_the_nearest_point():
    """Two points, red on the left and blue on the right, drawn with a pen as wide as half of the canvas."""
    halves = IFS(torch.zeros(2, 2, 2), torch.tensor([[-0.5, 0.0], [0.5, 0.0]]), colours=Colours(
        [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]], [1.0, 1.0]))
    drawn = in_colours(torch.ones(16, 16), halves, (1.0, 1.0, 1.0))
    assert drawn[:, :8].reshape(-1, 3).unique(dim=0).tolist() == [[1, 0, 0]]
    assert drawn[:, 9:].reshape(-1, 3).unique(dim=0).tolist() == [[0, 0, 1]]
    dark = torch.zeros(16, 16)
    assert in_colours(dark, halves, (0.0, 0.5, 1.0)).reshape(-1, 3).unique(dim=0).tolist() == [[0, 0.5, 1]]
    aside = replace(halves, offset=halves.offset + 5)
    assert in_colours(dark, aside, (1.0, 1.0, 1.0)).eq(1).all()


def test_colour_is_checked_before_any_work(picture, monkeypatch):
    with pytest.raises(InputError, match="colour must be True or False, got 'yes'"):
        invert(picture, colour="yes")
    monkeypatch.setattr("fractal_exp.runtime.extras.find_spec", lambda name: None)
    with pytest.raises(InputError, match="skimage is not installed; pip install"):
        invert(picture, colour=True)
