"""What a new kind of camera must have: it is tried, chosen, and listed everywhere."""

import re

import pytest
import torch
from camera_helpers import CAMERAS, SIDE
from places import ROOT

from fractal_exp import InputError, codes
from fractal_exp.cameras.camera import KNOWN, VALUES
from fractal_exp.cameras.comparison import Comparison
from fractal_exp.cameras.estimate import estimated
from fractal_exp.cameras.kinds import KINDS, kind_of, levels_of, of_others
from fractal_exp.cameras.levels import Levels
from fractal_exp.cameras.params import CameraParams
from fractal_exp.cli import reading
from fractal_exp.ifs import attractor
from fractal_exp.images.levels import DRAWN, MEANINGS

PARAMS = CameraParams()
FERN, GASKET = (attractor.normalize(codes.known(name)) for name in ("fern", "sierpinski_triangle"))


@pytest.mark.parametrize("kind", of_others())
def test_a_picture_that_a_camera_drew_is_seen_as_one_of_its_kind(kind):
    image = kind_of(kind)(PARAMS, torch.zeros(SIDE, SIDE), CAMERAS[kind]).render(FERN, SIDE, 1)
    found = estimated(image, levels_of(image, DRAWN, PARAMS), FERN, 0)
    assert found and found.kind == kind


def test_every_kind_has_its_own_name_and_all_that_it_may_know():
    for name in KINDS:
        kind = kind_of(name)
        assert kind.kind == name and set(kind.values) <= set(VALUES)
        assert kind.is_exact == (kind.candidates is Levels.candidates), "what is tried is estimated"
    assert set(KNOWN) <= {value for name in of_others() for value in kind_of(name).values}
    assert all(PARAMS.known(name) is None for name in KNOWN), "a parameter for each"


def test_a_code_that_no_camera_can_draw_has_none():
    image = torch.rand(SIDE, SIDE)
    assert estimated(image, kind_of("strokes")(PARAMS, image), GASKET, 0) is None, "no map of a gasket is flat"


@pytest.mark.parametrize("known, message", [
    ({"pen_px": 1.0, "gain": 0.3}, r"camera\.gain and camera\.pen_px must not be given together.*got 0\.3, 1\.0"),
    ({"pen_px": 1.0, "gamma": 2.0, "blur_px": 0.5}, r"camera\.gamma and camera\.pen_px and camera\.blur_px must not")])
def test_known_values_that_no_kind_has_together_are_refused(known, message):
    with pytest.raises(InputError, match=message):
        levels_of(torch.zeros(SIDE, SIDE), DRAWN, CameraParams(**known))


def test_every_list_of_the_meanings_of_grey_levels_is_the_same():
    assert set(MEANINGS) - {"auto"} == {name for name in KINDS if kind_of(name).beside is None}
    assert reading.LEVELS == MEANINGS
    page = (ROOT / "fractal_exp" / "studio" / "static" / "studio.html").read_text()
    assert tuple(re.findall(r'value="(\w+)"', re.findall(r'<select id="levels">.*?</select>', page)[0])) == MEANINGS
    levels = re.findall(r"^## Levels$.*?^## ", (ROOT / "docs" / "cameras.md").read_text(), re.MULTILINE | re.DOTALL)[0]
    assert {"auto", *re.findall(r"^\| `(\w+)` \|", levels, re.MULTILINE)} == set(MEANINGS)


def test_the_shape_of_a_faint_picture_is_what_lies_above_half_of_its_highest_level():
    """As of chalk on a board, drawn so finely that no pixel is a quarter white."""
    chalk = kind_of("coverage")(PARAMS, torch.zeros(SIDE, SIDE), CAMERAS["coverage"]).render(GASKET, SIDE, 1)
    for strength, above in ((1.0, 0.25), (0.2, 0.1 * float(chalk.max()))):
        drawn = Comparison(strength * chalk, levels_of(strength * chalk, DRAWN, PARAMS))
        assert drawn.levels.lit_above == pytest.approx(above)
        assert drawn.likeness(strength * chalk) == 1.0
        assert drawn.likeness(torch.zeros_like(chalk)) == 0.0
