"""The benchmark of photographs: which pictures it takes, how it scores them, and what it records."""

import numpy as np
import pytest
from PIL import Image

from benchmarks import photographs


@pytest.fixture
def plants(tmp_path):
    """A folder as of the package of stamps, with clouds in the place of its pictures."""
    y, x = np.mgrid[-1:1:64j, -1:1:64j]
    grey = 255 * (0.5 + 0.3 * np.sin(7 * x + 2 * y)) * (x**2 + y**2 < 0.6)
    for name in (*photographs.TUNING, "trees/oak", "trees/pine", "flowers/rose", "flowers/tulip"):
        path = tmp_path / f"{name}.png"
        path.parent.mkdir(exist_ok=True)
        Image.fromarray(grey.astype(np.uint8)).save(path)
    return tmp_path


def test_pictures_for_reporting_are_others_than_those_for_tuning(plants):
    tuning, reporting = (photographs.pictures(role, 2, plants) for role in ("tuning", "reporting"))
    assert [path.stem for path in tuning] == ["birch", "liberia-palm"]
    assert [path.stem for path in reporting] == ["rose", "oak"] and not {*tuning} & {*reporting}


def test_without_the_pictures_it_says_where_they_are_from(tmp_path):
    with pytest.raises(SystemExit, match="install the Debian package tuxpaint-stamps-default"):
        photographs.pictures("tuning", 2, tmp_path)


def test_more_maps_are_more_like_the_photograph(plants):
    small = {"resolution": 64, "growth": {"counts": (8,), "steps": 100}}
    lines = [photographs.fit(plants / "trees/oak.png", maps, **small)[1] for maps in (21, 48)]
    means = photographs.table(lines)
    assert means["21"]["ssim"][0] < means["48"]["ssim"][0] <= 1 and means["48"]["psnr"][0] > 15
    assert all(line["picture"] == "trees/oak" and "approximation" in line["verdict"] for line in lines)
