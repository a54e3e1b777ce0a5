"""Photographs of paper and plots: their truth lies where they show it, and they are read well."""

import numpy as np
import pytest

from benchmarks.pictures import judging, readings
from benchmarks.pictures.sets import SETS
from fractal_exp.images.reading import read_target


@pytest.mark.parametrize("kind, names", [
    ("plots", ["grid-spiral", "jet-tree"]),  # the spiral's arms look like letters
    ("paper", ["shadow-koch_curve-6-orange", "sheet-levy-16-blue", "tilted-heighway-16-green"])])
def test_such_pictures_are_read_well(kind, names, tmp_path):
    text = readings.write(kind, SETS[kind].seen, names, tmp_path)
    assert f"{len(names)} of {len(names)} are read well" in text
    assert (tmp_path / "reading.md").read_text() == f"{text}\n" and (tmp_path / "reading.png").exists()


@pytest.mark.parametrize("kind, name", [("plots", "stretched-culcita"), ("paper", "tilted-heighway-16-green")])
def test_the_true_code_lies_on_its_picture(kind, name):
    chosen = SETS[kind]
    read = read_target(chosen.picture(name), 256)
    drawn = judging.drawing(chosen.truth(name, read))
    assert judging.f1_within_a_pixel(drawn, judging.shape_of(read.image.numpy())) > 0.95
    assert chosen.score(name, chosen.truth(name, read), read)["exact"]


def test_a_name_gives_the_same_picture_again():
    picture = SETS["plots"].seen
    first = picture("dark-terdragon").source
    picture.cache_clear()
    assert np.array_equal(first, picture("dark-terdragon").source)
