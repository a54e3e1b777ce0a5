"""Colours of a code: the value, and the code that carries it."""

import json

import pytest
import torch

from fractal_exp import IFS, Colours, InputError, codes

RGB = [[0.9, 0.1, 0.2], [0.0, 0.5, 1.0], [0.3, 0.3, 0.3]]
BLENDS = [0.5, 1.0, 0.0]


def coloured(rgb=RGB, blends=BLENDS) -> IFS:
    triangle = codes.known("sierpinski_triangle")
    return IFS(triangle.linear, triangle.offset, colours=Colours(torch.tensor(rgb), torch.tensor(blends)))


def test_colours_come_back_from_a_file_bit_for_bit(tmp_path):
    code = coloured(torch.rand(3, 3, generator=torch.Generator().manual_seed(1)).tolist(), [1 / 3, 0.7, 1.0])
    back = IFS.load(code.save(tmp_path / "code.json"))
    assert torch.equal(back.colours.rgb, code.colours.rgb) and torch.equal(back.colours.blends, code.colours.blends)
    assert "colours" not in codes.known("fern").to_json()


@pytest.mark.parametrize(("rgb", "blends", "message"), [
    ([[0.1, 0.2]], [1.0], "rgb must have shape"),
    ([0.1, 0.2, 0.3], [1.0], "rgb must have shape"),
    ([[0.1, 0.2, 0.3]], [1.0, 1.0], "blends must have shape"),
    ([[0.1, 0.2, 255]], [1.0], "divide 8-bit colours by 255"),
    ([[0.1, -0.2, 0.3]], [1.0], "must lie in"),
    ([[0.1, 0.2, 0.3]], [1.5], "blends must lie in"),
    ([[0.1, float("nan"), 0.3]], [1.0], "finite"),
    ([[0.1, 0.2, 0.3]] * 2, [0.0, 0.0], "at least one blend"),
])
def test_wrong_colours_are_refused(rgb, blends, message):
    with pytest.raises(InputError, match=message):
        Colours(rgb, blends)


def test_a_code_refuses_colours_of_another_number_of_maps_or_of_another_kind():
    fern = codes.known("fern")
    with pytest.raises(InputError, match="4 maps and colours of 3"):
        IFS(fern.linear, fern.offset, colours=coloured().colours)
    with pytest.raises(InputError, match="must be Colours, got list"):
        IFS(fern.linear, fern.offset, colours=RGB)


@pytest.mark.parametrize(("given", "message"), [
    ([[0, 0, 0]], "rgb and blends, got list"),
    ({"rgb": RGB}, "no blends"),
    ({"rgb": RGB, "blends": BLENDS, "palette": 1}, "unknown keys"),
    ({"rgb": RGB, "blends": ["1", 1, 1]}, "numbers only"),
    ({"rgb": RGB, "blends": [True, 1, 1]}, "numbers only"),
    ({"rgb": RGB[:2], "blends": BLENDS[:2]}, "3 maps and colours of 2"),
    ({"rgb": [[2.0, 0, 0], *RGB[1:]], "blends": BLENDS}, "must lie in"),
])
def test_a_file_with_wrong_colours_is_refused(tmp_path, given, message):
    path = tmp_path / "code.json"
    path.write_text(json.dumps(coloured().to_json() | {"colours": given}))
    with pytest.raises(InputError, match=message):
        IFS.load(path)
