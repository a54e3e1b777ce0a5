"""Maps whose images are lines."""

import math
from dataclasses import replace

import pytest
import torch
from collage_helpers import CAMERA, objective

from fractal_exp import codes, suite
from fractal_exp.cameras.points import attractor_points
from fractal_exp.ifs import affine, attractor
from fractal_exp.methods.collage.moves.reorient import CanvasLine, Light, profiled


def light(target, rest):
    return Light(target, rest, CAMERA.supersample, CAMERA.points_per_pixel)


def rotated(maps, degrees):
    """The code (N,6) of the attractor turned about the origin."""
    turn = math.radians(degrees)
    rotation = torch.tensor([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
    linear = rotation @ maps[:, :4].unflatten(1, (2, 2)) @ rotation.T
    return torch.cat([linear.flatten(1), maps[:, 4:] @ rotation.T], 1)


@pytest.mark.parametrize("degrees", [0, 30, 90, 200])
def test_the_light_along_a_line_tells_which_way_it_lies(degrees):
    tree = affine.from_code(replace(codes.known("tree"), probabilities=None))
    true = affine.from_code(attractor.normalize(affine.to_code(rotated(tree, degrees))))
    stem = int(affine.volumes(true).argmin())
    turn = math.radians(90 + degrees)  # the stem's direction
    direction = torch.tensor([math.cos(turn), math.sin(turn)])
    wrong = rotated(torch.tensor([[0, 0, 0.37, 0.33, 0, -0.335]]), degrees)[0]  # the same line, not the same projection
    image, maps = suite.target(affine.to_code(true), 256), true.clone()
    maps[stem, :4], maps[stem, 4:] = wrong[:4], true[stem, 4:] + 0.04 * direction
    given = objective(image)
    shown = given.judge(maps)
    points = attractor_points(maps, shown.probabilities, 50_000, 0)
    rest = given.without(shown, [stem])
    found = profiled(maps[stem], float(shown.probabilities[stem]), points, light(image, rest.image), 2)[0]
    assert found.dtype == maps.dtype
    row = direction @ found[:4].view(2, 2)  # along the line
    assert float(row @ direction / row.norm()) > math.cos(math.radians(15))
    ends, wanted = ((points @ each[:4].view(2, 2).T + each[4:]) @ direction for each in (found, true[stem]))
    for end in (torch.amin, torch.amax):
        assert float(end(ends, 0)) == pytest.approx(float(end(wanted, 0)), abs=0.1)


def test_a_course_follows_its_line_over_the_pixels():
    size, points = 64, torch.randn(500, 2, generator=torch.Generator().manual_seed(0)).double()
    for line in ([0.0, 0, 0.2, 0.1, 0.3, -0.1], [0.2, 0.1, 0.06, 0.03, 0.1, -0.4], [-0.03, 0.02, 0.15, -0.1, 0, 0.2]):
        line = torch.tensor(line).double()
        course = CanvasLine.of(line, points)
        image = points @ line[:4].view(2, 2).T + line[4:]
        seen = image[(image.abs() < 1).all(1)]
        drawn = torch.zeros(size, size).double()
        drawn[((1 - seen[:, 1]) / 2 * size).long(), ((1 + seen[:, 0]) / 2 * size).long()] = 1
        assert course.pixels(drawn, 1).sum() == drawn.sum()  # every lit pixel is on the line or beside it
        rows = ((1 + seen[:, course.main]) / 2 * size).long().unique()
        assert course.pixels(drawn, 1).sum(1).nonzero().flatten().tolist() == rows.tolist()
        row = line[:4].view(2, 2)[course.main]
        torch.testing.assert_close(course.map(row, line[4 + course.main]), line, atol=1e-6, rtol=0)


@pytest.mark.parametrize("line", [[0.0] * 6, [0.0, 0, 0, 0, 0.3, 0.1]])
def test_an_image_that_is_a_point_has_no_profile(line):
    points, black = torch.rand(100, 2), torch.zeros(64, 64)
    assert profiled(torch.tensor(line), 0.1, points, light(black, black), 2).shape == (0, 6)


def test_the_ways_a_line_may_lie_are_contractive():
    flat = torch.rand(100, 2) * torch.tensor([0.001, 1])  # other directions would have to stretch it
    bright = torch.zeros(64, 64)
    bright[32] = 0.05
    found = profiled(torch.tensor([0.0, 0.9, 0, 0, 0, 0]), 0.1, flat, light(bright, torch.zeros(64, 64)), 9)
    assert len(found) > 0 and float(affine.largest_singular(found).max()) < 1
