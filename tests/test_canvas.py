"""Positions of pixels on the canvas, and the way back."""

import torch

from fractal_exp.ifs.canvas import canvas_to_pixel, pixel_to_canvas


def test_the_corners_and_the_centres_of_pixels_are_where_the_convention_says():
    corners = torch.tensor([[0.0, 0.0], [0.0, 4.0], [4.0, 0.0], [4.0, 4.0]])
    expected = torch.tensor([[-1.0, 1.0], [1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])
    assert torch.equal(pixel_to_canvas(corners, 4), expected)
    assert torch.equal(canvas_to_pixel(expected, 4), corners)
    centre = pixel_to_canvas(torch.tensor([1, 2]) + 0.5, 4)  # row 1, column 2
    assert centre.tolist() == [0.25, 0.25] == [(2 * 2 + 1) / 4 - 1, 1 - (2 * 1 + 1) / 4]


def test_a_point_is_in_the_pixel_that_it_came_from():
    pixels = torch.cartesian_prod(torch.arange(7), torch.arange(7))
    for inside in (0.01, 0.5, 0.99):
        points = pixel_to_canvas((pixels + inside).double(), 7)
        assert torch.equal(canvas_to_pixel(points, 7).long(), pixels)
