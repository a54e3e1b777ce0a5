"""Known answers of the classic codes: dimensions, boxes, areas, fixed points, symmetries."""

import math

import numpy as np
import pytest
from scipy.ndimage import binary_erosion
from scipy.optimize import brentq
from scipy.spatial import cKDTree

from fractal_exp import InputError
from fractal_exp.codes import known, names
from fractal_exp.ifs.attractor import support_function, visible_box

GOLDEN = (1 + math.sqrt(5)) / 2
ROOT3 = math.sqrt(3)

# name: number of maps, similarity dimension by Moran's equation (None where the maps are no similarities)
FACTS = {
    "fern": (4, None),
    "cyclosorus": (4, None),
    "culcita": (4, None),
    "tree": (4, None),
    "maple_leaf": (4, None),
    "spiral": (3, None),
    "sierpinski_triangle": (3, math.log(3, 2)),
    "sierpinski_carpet": (8, math.log(8, 3)),
    "vicsek": (5, math.log(5, 3)),
    "cantor_dust": (4, math.log(4, 3)),
    "hexaflake": (7, math.log(7, 3)),
    "pentaflake": (6, math.log(6, 1 + GOLDEN)),
    "koch_curve": (4, math.log(4, 3)),
    "koch_snowflake": (7, 2),
    "heighway_dragon": (2, 2),
    "twindragon": (2, 2),
    "terdragon": (3, 2),
    "levy_c_curve": (2, 2),
    "gosper_island": (7, 2),
    "rauzy": (3, 2),
}

# name: the attractor's box in closed form
BOXES = {
    "sierpinski_triangle": (0, 0, 1, ROOT3 / 2),
    "sierpinski_carpet": (0, 0, 1, 1),
    "vicsek": (0, 0, 1, 1),
    "cantor_dust": (0, 0, 1, 1),
    "hexaflake": (-1, -ROOT3 / 2, 1, ROOT3 / 2),
    "pentaflake": (-math.cos(math.radians(18)), -math.cos(math.radians(36)), math.cos(math.radians(18)), 1),
    "koch_curve": (0, 0, 1, ROOT3 / 6),
    "koch_snowflake": (-ROOT3 / 2, -1, ROOT3 / 2, 1),
    "heighway_dragon": (-1 / 3, -1 / 3, 7 / 6, 2 / 3),
    "twindragon": (-1 / 3, -2 / 3, 4 / 3, 2 / 3),
    "levy_c_curve": (-1 / 2, -1 / 4, 3 / 2, 1),
}

# name: the attractor's area in closed form
AREAS = {
    "heighway_dragon": 1 / 2,               # of the unit segment
    "twindragon": 1,
    "terdragon": 1 / (2 * ROOT3),
    "gosper_island": ROOT3 / 2,             # a cell of the hexagonal lattice
    "koch_snowflake": 2 * ROOT3 / 5 * 3,    # of a triangle of side sqrt 3
}

# name: a symmetry of the attractor, as a map of the complex plane
SYMMETRIES = {
    "sierpinski_triangle": lambda z: 1 - z.conjugate(),
    "sierpinski_carpet": lambda z: 1j * z.conjugate(),
    "vicsek": lambda z: 1 + 1j * z,
    "cantor_dust": lambda z: 1 + 1j * z,
    "hexaflake": lambda z: np.exp(1j * np.pi / 3) * z,
    "pentaflake": lambda z: np.exp(2j * np.pi / 5) * z,
    "koch_curve": lambda z: 1 - z.conjugate(),
    "koch_snowflake": lambda z: np.exp(1j * np.pi / 3) * z,
    "twindragon": lambda z: 1 - z,
    "terdragon": lambda z: 1 - z,
    "levy_c_curve": lambda z: 1 - z.conjugate(),
    "tree": lambda z: -z.conjugate(),
    "gosper_island": lambda z: np.exp(1j * np.pi / 3) * z,
}


def words(code, most=60_000):
    """Images of the first map's fixed point under all words of one length, as complex numbers."""
    linear, offset = code.linear.double().numpy(), code.offset.double().numpy()
    points = np.linalg.solve(np.eye(2) - linear[0], offset[0])[None]
    while len(points) * len(code) <= most:
        points = (np.einsum("nij,kj->nki", linear, points) + offset[:, None]).reshape(-1, 2)
    return points @ np.array([1, 1j])


def chaos_points(code, count=400_000, steps=60):
    rng = np.random.default_rng(0)
    linear, offset = code.linear.double().numpy(), code.offset.double().numpy()
    weights = np.abs(np.linalg.det(linear))
    x = np.zeros((count, 2))
    for _ in range(steps):
        i = rng.choice(len(code), count, p=weights / weights.sum())
        x = np.einsum("kij,kj->ki", linear[i], x) + offset[i]
    return x


def test_every_code_has_its_facts():
    assert names() == sorted(FACTS) and len(names()) >= 14


@pytest.mark.parametrize("name", names())
def test_count_contraction_and_source(name):
    code = known(name)
    assert len(code) == FACTS[name][0]
    code.check_contractive()
    assert code.meta["name"] == name and code.meta["title"] and code.meta["source"]
    if code.probabilities is not None:
        assert float(code.probabilities.sum()) == pytest.approx(1, abs=1e-6)


@pytest.mark.parametrize("name", [n for n, (_, dimension) in FACTS.items() if dimension])
def test_similarity_dimension_solves_moran(name):
    sigma = known(name).singular_values().double().numpy()
    np.testing.assert_allclose(sigma[:, 0], sigma[:, 1], rtol=1e-5)
    dimension = brentq(lambda s: (sigma[:, 0] ** s).sum() - 1, 0.5, 3)
    assert dimension == pytest.approx(FACTS[name][1], abs=1e-5)


def box_of(code):
    """Of the attractor, by its half planes."""
    heights = support_function(code)
    right, top, left, bottom = heights[::len(heights) // 4]
    return np.array([-left, -bottom, right, top])


@pytest.mark.parametrize("name", BOXES)
def test_box_in_closed_form(name):
    np.testing.assert_allclose(box_of(known(name)), BOXES[name], atol=1e-4)
    np.testing.assert_allclose(visible_box(known(name)), BOXES[name], atol=3e-3)


@pytest.mark.parametrize("name", ["fern", "heighway_dragon"])
def test_few_directions_bound_an_attractor_a_little_less_closely(name):
    close, loose = support_function(known(name)), support_function(known(name), 64, 1e-3)
    excess = loose - close[::16]
    assert excess.min() > -1e-6 and 0 < excess.max() < 0.03 * close.max()


@pytest.mark.parametrize("name", [name if name in ("heighway_dragon", "koch_snowflake") else
                                  pytest.param(name, marks=pytest.mark.slow) for name in AREAS])
def test_area_in_closed_form(name):
    """Such an attractor carries its measure evenly, so the density in its interior is 1 / area."""
    points = chaos_points(known(name))
    low, side = points.min(0), np.ptp(points, axis=0).max()
    cells = 48
    counts, _, _ = np.histogram2d(*((points - low) / side * cells).T, bins=cells, range=[[0, cells]] * 2)
    interior = binary_erosion(counts > 0, np.ones((3, 3)), iterations=2)
    density = np.median(counts[interior]) / len(points) / (side / cells) ** 2
    assert 1 / density == pytest.approx(AREAS[name], rel=0.02)


@pytest.mark.parametrize("name", SYMMETRIES)
def test_symmetry(name):
    """The mirrored or turned attractor lies within one small cylinder of itself, everywhere."""
    points = words(known(name))
    tree = cKDTree(np.column_stack([points.real, points.imag]))
    moved = SYMMETRIES[name](points)
    distance, _ = tree.query(np.column_stack([moved.real, moved.imag]))
    side = max(np.ptp(points.real), np.ptp(points.imag))
    assert distance.max() < 0.02 * side


def test_unknown_name_lists_the_close_ones_and_all():
    with pytest.raises(InputError, match="'sierpinsky_carpet'; did you mean 'sierpinski_carpet'.*known names: .*rauzy"):
        known("sierpinsky_carpet")
    with pytest.raises(InputError, match="no classic code is called 'qqqq'; known names"):
        known("qqqq")
