"""Pictures that a recursion drew, and what the search for its code begins with."""

import math

import numpy as np
import torch
from collage_helpers import PARAMS
from PIL import Image, ImageDraw

from fractal_exp.cameras.kinds import levels_of
from fractal_exp.ifs import affine, attractor
from fractal_exp.images.levels import DRAWN
from fractal_exp.methods.collage.image.objective import ImageObjective
from fractal_exp.methods.collage.stages.base import SearchProblem
from fractal_exp.methods.collage.stages.construction import Construction

SIDE, RATIO, DEPTH = 128, 0.6, 6
PIXEL = 2 / SIDE
FOOT, TOP = (0.0, -0.7), (0.0, -0.1)


def tree(ratio=RATIO):
    """A trunk and two branches, 30 degrees to each side: a tree that a recursion draws."""
    maps = [[0, 0, 0, .3, 0, .7 * FOOT[1]]]
    for sign in (1, -1):
        cos, sin = ratio * math.cos(math.pi / 6), sign * ratio * math.sin(math.pi / 6)
        maps.append([cos, -sin, sin, cos, TOP[0] + sin * FOOT[1], TOP[1] - cos * FOOT[1]])
    found = torch.tensor(maps)
    for _ in range(20):  # until the whole tree, flattened, is the trunk
        height = float(attractor.visible_box(affine.to_code(found))[3]) - FOOT[1]
        found[0, 3] = (TOP[1] - FOOT[1]) / height
        found[0, 5] = FOOT[1] * (1 - found[0, 3])
    return affine.to_code(found)


def drawing(depth=DEPTH, width_px=1.6, thinning=False, fine=8):
    """The recursion drawn by Pillow, white on black (SIDE, SIDE)."""
    picture = Image.new("L", (fine * SIDE,) * 2)
    pen = ImageDraw.Draw(picture)

    def grow(foot, direction, left, width):
        top = foot + direction
        ends = [((x + 1) * fine * SIDE / 2, (1 - y) * fine * SIDE / 2) for x, y in (foot, top)]
        pen.line(ends, fill=255, width=round(width * fine))
        for sign in (1, -1) if left else ():
            cos, sin = RATIO * math.cos(math.pi / 6), sign * RATIO * math.sin(math.pi / 6)
            turned = np.array([cos * direction[0] - sin * direction[1], sin * direction[0] + cos * direction[1]])
            grow(top, turned, left - 1, width * (RATIO if thinning else 1))

    grow(np.array(FOOT), np.array(TOP) - np.array(FOOT), depth, width_px)
    return at(np.asarray(picture, np.float32) / 255)


def lines(code, depth, width_px, fine=8):
    """The segment between the fixed points of the first and the last map, under all words of a depth: (SIDE, SIDE)."""
    maps = affine.from_code(code).double()
    ends = [torch.linalg.solve(torch.eye(2).double() - one[:4].reshape(2, 2), one[4:]) for one in (maps[0], maps[-1])]
    parts = torch.stack(ends)[None]
    for _ in range(depth):
        parts = torch.cat([parts @ one[:4].reshape(2, 2).T + one[4:] for one in maps])
    picture = Image.new("L", (fine * SIDE,) * 2)
    pen = ImageDraw.Draw(picture)
    for start, end in ((parts * torch.tensor([1.0, -1])).add(1) * (fine * SIDE / 2)).tolist():
        pen.line([tuple(start), tuple(end)], fill=255, width=round(width_px * fine))
    return at(np.asarray(picture, np.float32) / 255)


def triangles(depth, side=4 * SIDE):
    """The gasket's construction as polygons, white on black, the frame of `GASKET` (side, side)."""
    corners = np.array([[-.75, -.375 * math.sqrt(3)], [.75, -.375 * math.sqrt(3)], [0, .375 * math.sqrt(3)]])
    parts = [corners]
    for _ in range(depth):
        parts = [(part + part[k]) / 2 for part in parts for k in range(3)]
    picture = Image.new("L", (side, side))
    draw = ImageDraw.Draw(picture)
    for part in parts:
        draw.polygon([((x + 1) * side / 2 - .5, (1 - y) * side / 2 - .5) for x, y in part], fill=255)
    return np.asarray(picture) / np.float32(255)


def at(image, side=SIDE):
    step = len(image) // side
    return torch.from_numpy(image.reshape(side, step, side, step).mean((1, 3)))


def objective(image, **camera):
    params = PARAMS.updated(camera=camera)
    return ImageObjective(image, levels_of(image, DRAWN, params.camera), params)


def stage(image, **options):
    params = PARAMS.updated(**options)
    return Construction(SearchProblem(image, levels_of(image, DRAWN, params.camera), params))


def ended(stage, state, most_moves):
    """The state after a stage that is wanted and makes all its moves."""
    assert stage.is_wanted(state)
    state = stage.open(state)
    while not stage.is_settled(state) and state.step < most_moves:
        state = stage.move(state)
    return stage.close(state)
