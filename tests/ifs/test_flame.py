"""flam3's `.flame` files: what is written is drawn by flam3 itself, what is read is what it draws, and hostile XML."""

import re
from dataclasses import replace

import numpy as np
import pytest
import torch
from flam3 import DRAWS, SIDE, difference, drawn
from format_files import FLAME, flame, xform
from PIL import Image

from fractal_exp import IFS, Colours, InputError, View, codes, render
from fractal_exp.evaluation.metrics import f1
from fractal_exp.ifs import attractor
from fractal_exp.ifs.formats.colours import Palette
from fractal_exp.ifs.formats.flame import camera_of
from fractal_exp.suite import random_suite


@DRAWS
@pytest.mark.parametrize("code", [codes.known("fern"), codes.known("heighway_dragon"), codes.known("cantor_dust"),
                                  random_suite(8)[7]], ids=["fern", "dragon", "dust", "suite"])
def test_flam3_draws_what_render_draws(tmp_path, code):
    image = drawn(code.save(tmp_path / "code.flame"))
    assert float(f1(image[None], render(code, camera_of(code), resolution=SIDE)[None])) >= 0.95


@DRAWS
def test_what_is_read_is_what_flam3_draws(tmp_path):
    path = tmp_path / "field.flame"
    field = re.sub("<edit.*</edit>", "", FLAME)  # flam3 3.1.1 crashes when it forgets a history
    path.write_text(field.replace("<flame ", '<flame filter="0.1" gamma_threshold="0.01" quality="48" brightness="4" '
                                             'estimator_radius="0" '))
    for index, name in enumerate(["leaf <1>", "#2"]):
        code = IFS.load(path, name)
        image = drawn(path, index=index)
        truth = render(code, View(**code.meta["camera"]), resolution=SIDE)
        truth = truth[(SIDE - len(image)) // 2:(SIDE + len(image)) // 2]  # of a wide frame, the square around it
        assert 0.01 < float((image > 0).float().mean()) < 0.7 and float(f1(image.flip(0)[None], truth[None])) < 0.8
        assert float(f1(image[None], truth[None])) >= 0.95


@DRAWS
def test_flam3_draws_the_maps_in_their_colours(tmp_path):
    code = attractor.normalize(codes.known("sierpinski_triangle"))
    code.save(tmp_path / "code.flame")
    drawn(tmp_path / "code.flame", 128)
    colours = np.asarray(Image.open(next(tmp_path.glob("drawn*.png"))).convert("RGB"), float)
    left, right = (half[half.max(-1) > 100].mean(0) for half in (colours[64:, :64], colours[64:, 64:]))
    assert np.abs(left - right).max() > 40


def own_colours(blends, rgb=((0.9, 0.2, 0.1), (0.1, 0.7, 0.2), (0.2, 0.3, 0.9))):
    code = attractor.normalize(codes.known("sierpinski_triangle"))
    return replace(code, colours=Colours(torch.tensor(rgb), torch.full((3,), blends)))


@DRAWS
def test_flam3_draws_a_codes_own_colours(tmp_path):
    by_last_map = own_colours(1.0)
    assert difference(by_last_map.save(tmp_path / "a.flame"), by_last_map) < 1
    on_a_line = own_colours(0.3, ((0.9, 0.2, 0.1), (0.1, 0.7, 0.2), (0.5, 0.45, 0.15)))  # mixtures are on it too
    assert difference(on_a_line.save(tmp_path / "b.flame"), on_a_line) < 1
    mixed = own_colours(0.6)  # in a triangle, of which a palette holds the corners of corners
    assert difference(mixed.save(tmp_path / "c.flame"), mixed) < 3
    assert difference(tmp_path / "c.flame", by_last_map) > 10


def errors_of(palette, rgb, blend, steps=4000):
    """How far the palette's colours are from the true ones along a chaos game of equal chances, (steps, 3)."""
    rgb, place, colour, errors = np.array(rgb), 0.5, np.full(3, 0.5), []
    for i in np.random.default_rng(0).integers(0, len(rgb), steps):
        place += palette.speeds[i] * (palette.places[i] - place)
        colour = (1 - blend) * colour + blend * rgb[i]
        errors.append(palette.rgb[min(round(256 * place), 255)] / 255 - colour)
    return np.abs(errors[steps // 10:])


def test_a_palette_tells_colours_apart_that_lie_on_no_line():
    rgb = ((0.9, 0.2, 0.1), (0.1, 0.7, 0.2), (0.2, 0.3, 0.9))
    assert errors_of(Palette.of(own_colours(0.6, rgb)), rgb, 0.6).mean() < 0.015


def test_a_file_of_the_field(tmp_path):
    path = tmp_path / "field.flame"
    path.write_text(FLAME)
    code = IFS.load(path, "leaf <1>")
    torch.testing.assert_close(code.probabilities, torch.tensor([0.7, 2, 1]) / 3.7)
    # columns a d, b e, c f of flam3 with y down become rows with y up; linear is a factor, post is applied last
    torch.testing.assert_close(code.linear[0], 0.95 * torch.tensor([[0.85, -0.14], [0.12, 0.8]]))
    torch.testing.assert_close(code.offset[0], 0.95 * torch.tensor([0.1, 0.3]))
    torch.testing.assert_close(code.linear[1], torch.tensor([[0.4 + 0.3 * 0.3, -(-0.3 + 0.3 * 0.35)], [-0.3, 0.35]]))
    torch.testing.assert_close(code.offset[1], torch.tensor([-0.4 + 0.3 * 0.2 + 0.1, -0.2]))
    assert code.meta["name"] == "leaf <1>"
    assert View(**code.meta["camera"]) == View((0.1, 0.2), 160 * 2**0.5 / 320)
    with pytest.raises(InputError, match="holds 3 codes.*'leaf <1>', #2, 'swirl'"):
        IFS.load(path)
    with pytest.raises(InputError, match="flame 'swirl': xform 1 has the variation or parameter 'swirl'"):
        IFS.load(path, "swirl")


def test_a_final_map_moves_the_attractor(tmp_path):
    path = tmp_path / "field.flame"
    path.write_text(FLAME)
    code = IFS.load(path, "#2")
    plain = replace(code, linear=torch.tensor([[[0.7, -0.2], [0.2, 0.6]], [[0.6, 0.2], [-0.3, 0.7]]]),
                    offset=torch.tensor([[0.3, 0], [-0.3, 0]]))
    matrix, shift = torch.tensor([[0.9, -0.3], [0.4, 0.7]]), torch.tensor([0.2, 0.1])
    for i in range(2):  # in flam3's frame, y down: the fixed point of a map goes to that of the conjugated one
        down = torch.tensor([1.0, -1.0])
        fixed = torch.linalg.solve(torch.eye(2) - plain.linear[i], plain.offset[i])
        moved = torch.linalg.solve(torch.eye(2) - code.linear[i], code.offset[i]) * down
        torch.testing.assert_close(moved, matrix @ fixed + shift)


def test_the_camera_shows_the_canvas_or_else_all_of_the_attractor(tmp_path):
    code = codes.known("sierpinski_triangle")
    small = IFS.load(code.save(tmp_path / "a.flame"))
    assert small.meta["camera"] == {"center": [0, 0], "zoom": 1}
    fern = IFS.load(codes.known("fern").save(tmp_path / "b.flame"))
    picture = render(fern, View(**fern.meta["camera"]), resolution=64)
    rows, columns = picture.nonzero().T
    assert 7 <= int(rows.min()) <= 9 and 54 <= int(rows.max()) <= 56
    assert abs(int(columns.min() + columns.max()) - 63) <= 2
    point = IFS([[[0.5, 0], [0, 0.5]]], [[3.0, 3.0]])
    assert camera_of(point) == View((6, 6))


def test_an_encoding_that_is_declared_is_not_believed(tmp_path):
    path = tmp_path / "a.flame"
    path.write_bytes(f'<?xml version="1.0" encoding="utf-7"?>{flame(xform(), name="é")}'.encode())
    assert IFS.load(path).meta["name"] == "é"
    path.write_bytes(f'<?xml version="1.0" encoding="utf-8"?>{flame(xform(), name="é")}'.encode("utf-16"))
    assert IFS.load(path).meta["name"] == "é"
