"""Several answers on one sheet: codes of few and of many maps, whole and closer."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from known import Known
from PIL import Image

from fractal_exp import IFS, InputError, codes, render, suite
from fractal_exp.ifs import attractor
from fractal_exp.images.reading import ReadImage
from fractal_exp.inversion import Inversion, run, write
from fractal_exp.inversion.answers import SIDE, offered
from fractal_exp.methods.base import CodeReconstruction, CurvePoint
from fractal_exp.methods.collage.method import Collage
from fractal_exp.rendering.sheets import GAP
from fractal_exp.rendering.tone import NOTE

LEAF = attractor.normalize(codes.known("maple_leaf"))
FEW = {"counts": (4, 16), "steps": 100}


def point(maps: int, likeness: float, code: IFS = LEAF) -> CurvePoint:
    return CurvePoint(maps, likeness, 12 * maps, code)


def leaves(*shares: float) -> Inversion:
    """A leaf and codes that draw it this large, each called more like it than the one before."""
    curve = tuple(point(i + 2, 0.6 + i / 10, LEAF.similar(share, (0.0, 0.0))) for i, share in enumerate(shares))
    answer = CodeReconstruction(curve[-1].code, curve=curve)
    return run(ReadImage.of_drawing(suite.target(LEAF, 96), "density"), Known(answer), name="grown")


def cell(sheet: Image.Image, row: int, column: int) -> np.ndarray:
    """The picture of a cell (S,S), as grey levels."""
    rows = round((sheet.height - GAP) / (SIDE + 2 * GAP + 11))  # a caption is about 11 pixels high
    y = GAP + row * ((sheet.height - GAP) // rows)
    x = GAP + column * (SIDE + GAP)
    return np.asarray(sheet.convert("L"), float)[y:y + SIDE, x:x + SIDE]


def alike(one: np.ndarray, other: np.ndarray) -> float:
    """The correlation of two cells, of parts as large as a pixel of the picture or a little larger."""
    one, other = (each.reshape(SIDE // 8, 8, SIDE // 8, 8).mean((1, 3)) for each in (one, other))
    return float(np.corrcoef(one.ravel(), other.ravel())[0, 1])


@pytest.mark.parametrize("likeness, maps", [
    ([0.3, 0.55, 0.6, 0.7, 0.8, 0.9], [1, 3, 5]),   # the first has no more than the outline
    ([0.6, 0.7, 0.8], [0, 1, 2]),
    ([0.6, 0.8, 0.7, 0.75], [0, 1]),                # more maps that are less alike are no answer
    ([0.1, 0.2, 0.3], [0, 1, 2]),
    ([0.1, 0.7], [1]),
    ([0.7], [0])])
def test_the_simplest_with_the_character_the_middle_and_the_closest_are_offered(likeness, maps):
    curve = [point(index, value) for index, value in enumerate(likeness)]
    assert [each.maps for each in offered(curve)] == maps == [each.maps for each in offered(curve[::-1])]


def test_a_sheet_shows_the_picture_and_codes_whole_and_closer():
    sheet = leaves(0.8, 1.0).answers()
    assert sheet.width == 2 * (SIDE + GAP) + GAP and sheet.height > 3 * SIDE
    picture, smaller, same = (cell(sheet, row, 0) for row in range(3))
    assert alike(picture, same) > 0.95 > 0.9 > alike(picture, smaller)
    patch, closer = cell(sheet, 0, 1), cell(sheet, 2, 1)
    assert alike(patch, closer) > 0.75, "both show the same place"
    assert max(alike(patch[::-1], closer), alike(patch[:, ::-1], closer)) < 0.5
    for row in (1, 2):
        assert 0.2 < (cell(sheet, row, 1) > 128).mean() < 0.8, "something is seen of every code"


def test_a_picture_that_is_grey_inside_has_answers_with_its_tone_and_files_of_them(tmp_path):
    y, x = torch.meshgrid(torch.linspace(-1, 1, 64), torch.linspace(-1, 1, 64), indexing="ij")
    places = ((-0.4, 0.3, 0.7), (0.3, -0.4, 0.5), (0.2, 0.5, 0.3), (-0.1, -0.1, 0.6))
    clouds = torch.stack([level * torch.exp(-((x - a)**2 + (y - b)**2) / 0.03) for a, b, level in places]).sum(0)
    found = run(ReadImage.of_drawing(clouds.clamp(0, 0.9), "dots"), Collage(maps=24, growth=FEW), name="collage")
    assert [each.maps for each in found.curve][:2] == [4, 16] and found.code.meta[NOTE]["light"] > 0.1
    assert all(each.code.meta[NOTE] == found.code.meta[NOTE] for each in found.curve)
    names = write(found, tmp_path)
    assert "answers.png" in names and sorted(names) == sorted(path.name for path in tmp_path.iterdir())
    written = Image.open(tmp_path / "answers.png")
    assert np.array_equal(np.asarray(written), np.asarray(found.answers()))
    drawn = 255 * render(offered(found.curve)[-1].code, resolution=SIDE, mode="tone").numpy()
    assert np.abs(cell(written, len(offered(found.curve)), 0) - drawn).max() <= 1
    small = Inversion.load(tmp_path).curve[0].code.save(tmp_path / "small.json")
    assert len(IFS.load(small)) == 4 and IFS.load(small) == found.curve[0].code
    assert IFS.load(small).meta[NOTE] == found.code.meta[NOTE]


def test_one_number_of_maps_is_no_choice_to_write_down(tmp_path):
    assert "answers.png" not in write(leaves(1.0), tmp_path)
    with pytest.raises(InputError, match="the curve is empty, as no maps were grown; invert.* maps=64"):
        replace(leaves(1.0), curve=()).answers()
