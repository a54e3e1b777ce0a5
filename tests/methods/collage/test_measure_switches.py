"""Each part of the search on the measure, of the camera and of rounding can be switched off."""

from dataclasses import replace

import pytest
import torch
from collage_helpers import DENSITY, PARAMS, measure_search, objective, pen_camera, problem, random, small
from drawn_helpers import drawing, tree

from fractal_exp import suite
from fractal_exp.cameras.estimate import estimated
from fractal_exp.cameras.kinds import levels_of, with_camera
from fractal_exp.ifs import affine
from fractal_exp.images.levels import DRAWN, meaning_of
from fractal_exp.methods.collage.image.camera import polish_under
from fractal_exp.methods.collage.measure.births import candidates, reoriented
from fractal_exp.methods.collage.measure.population import Population
from fractal_exp.methods.collage.simplify.rounding import begun, with_simple_numbers
from fractal_exp.methods.collage.simplify.symmetry import symmetries
from fractal_exp.methods.collage.stages.construction import Construction
from fractal_exp.runtime.deadline import NO_DEADLINE


def determinants(maps):
    return torch.linalg.det(maps[..., :4].unflatten(-1, (2, 2)))


def crowded(triangle):
    """The maps of a code, with another that explains nothing and one map nearly twice."""
    maps = affine.from_code(triangle[0])
    extra = torch.tensor([[0.1, 0, 0, 0.1, 0.0, 0.6]])
    maps = torch.cat([maps, maps[:1] * 1.001, extra])
    return maps, torch.tensor([0.08, 0.16, 0.16, 0.08, 0.001])


@pytest.mark.parametrize(("options", "left"), [({}, 4), ({"search": {"pruning": False}}, 5),
                                               ({"search": {"pruning": False}, "at_most": 4}, 4)], ids=str)
def test_maps_are_pruned_unless_that_is_off_and_there_are_no_more_than_asked_for(options, left, triangle):
    search = measure_search(DENSITY.measure(triangle[1]), **options)
    maps, weights = crowded(triangle)
    assert len(search.pruned(maps, weights, 1.0).maps) == left


def test_maps_with_one_image_are_merged(triangle):
    search = measure_search(DENSITY.measure(triangle[1]))
    assert len(search.merged(search.judged(*crowded(triangle), 1.0)).maps) == 4


@pytest.mark.parametrize("reflections", [True, False])
def test_random_maps_mirror_unless_that_is_off(reflections, triangle):
    masses, params = DENSITY.measure(triangle[1]), PARAMS.updated(births={"reflections": reflections})
    search = measure_search(masses, births={"reflections": reflections})
    measure, births = search.measure, params.births
    born = [candidates(measure.bins, measure.bins, measure, (0.1, 0.5), 40, 20, births, random()),
            reoriented(torch.tensor([0.5, 0.1, 0, 0.4, 0, 0]), measure, 24, random(), reflections=reflections),
            Population(masses, 3, params.updated(population={"first": 48})).maps]
    for maps in born:   # descent turns over a few of a population
        share = float((determinants(maps) < 0).float().mean())
        assert share > 0.3 if reflections else share < 0.1


def test_no_number_is_rounded_where_that_is_off(triangle):
    image = suite.target(replace(triangle[0], probabilities=None), 128)
    start = objective(image).judge(affine.from_code(triangle[0]) * (1 + 1e-5))
    for options, rounded in ({}, True), ({"matrices": False, "lines_tried": 0}, False):
        found = with_simple_numbers(begun(objective(image, rounding=options), start))
        assert bool(found.fixed) == rounded
        assert rounded or found.shown is start


def test_a_shape_without_symmetries_has_the_identity(triangle):
    image = triangle[1].cpu()
    found, alone = (symmetries(image, PARAMS.rounding.updated(symmetries=on)) for on in (True, False))
    assert len(found) > 1 and len(alone) == 1
    assert torch.equal(found[0], alone[0])
    assert sum(float(determinants(each)) < 0 for each in found) == 3, "the mirrors of a triangle"


def test_no_stroke_is_sought_where_that_is_off():
    image = drawing(4)
    for strokes in True, False:
        given = problem(image, levels="drawn", maps=None, camera={"strokes": strokes, "tiles": False})
        assert Construction.may_help(given) == strokes
        seen = objective(image, with_camera(levels_of(image, DRAWN, given.params.camera), pen_camera(0, .01, .01)),
                         camera={"strokes": strokes})
        assert bool(polish_under(seen, seen.judge(affine.from_code(tree())), "strokes", NO_DEADLINE)) == strokes


def test_a_picture_that_others_drew_may_count_as_a_plain_rendering():
    image, off = drawing(4), {"estimate": False}
    params = PARAMS.updated(camera=off)
    assert estimated(image, levels_of(image, meaning_of(image), params.camera), tree(), 0) is None
    assert not Construction.may_help(problem(image, levels="drawn", camera=off))
    found = small(camera=off, moves={"drawn_count": 1}).reconstruct(image)
    assert len(found.code) >= 2 and not found.camera.is_known
