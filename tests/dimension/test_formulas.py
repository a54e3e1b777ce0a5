"""Dimensions of codes against closed forms, and what is said of them."""

import math
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
import torch
from scipy.optimize import brentq

from fractal_exp import IFS, InputError, codes
from fractal_exp.dimension.affinity import affinity
from fractal_exp.dimension.samples import MEASURES, of_points

GOLDEN = (math.sqrt(5) - 1) / 2
CORNERS = [[0, 0], [1, 0], [0, 1], [1, 1]]


def copies(*ratios: float, places, probabilities=None) -> IFS:
    """Copies x -> r x + (1 - r) place: each has its place for its fixed point."""
    r, at = torch.tensor(ratios), torch.tensor(places, dtype=torch.float32)
    return IFS(torch.eye(2) * r[:, None, None], at * (1 - r)[:, None],
               None if probabilities is None else torch.tensor(probabilities))


HALVES, QUARTER = copies(*[.5] * 4, places=CORNERS), copies(.5, .5, .5, .25, places=CORNERS)
LINE = copies(.5, .5, places=[[0, 0], [math.cos(.4), math.sin(.4)]])
PRODUCT = IFS(torch.diag(torch.tensor([1 / 3, 1 / 4])).expand(4, 2, 2),
              torch.tensor(CORNERS) * torch.tensor([2 / 3, 3 / 4]))
GASKET = codes.known("sierpinski_triangle")
UNEVEN = replace(GASKET, probabilities=torch.tensor([.6, .3, .1]))

KNOWN = [(codes.known("koch_curve"), 1.26186), (QUARTER, 1.72368), (codes.known("sierpinski_carpet"), 1.89279),
         (GASKET, 1.58496), (LINE, 1), (HALVES, 2), (codes.known("cantor_dust"), 1.26186),
         (codes.known("heighway_dragon"), 2), (codes.known("gosper_island"), 2), (codes.known("pentaflake"), 1.86172),
         (codes.known("rauzy"), 2), (copies(.5, .25, .25, places=CORNERS[:3]), 1)]


@pytest.mark.parametrize(("code", "value"), KNOWN)
def test_the_similarity_dimension_is_exact_where_the_pieces_do_not_overlap(code, value):
    found = code.dimension()
    assert (found.kind, found.standing) == ("similarity", "exact") and found.low == found.value == found.high
    assert found.value == pytest.approx(value, abs=1e-5)
    assert str(found) == f"{found.value:.4f}, exact"
    assert replace(found, kind="affinity") == code.dimension("affinity")


@pytest.mark.parametrize(("code", "why"), [
    (copies(*[1 / 3] * 3, places=[[0, 0], [1, 0], [3, 0]]), "two words are one map"),  # 0·9 + 3 = 1·3 + 0
    (copies(GOLDEN, GOLDEN, places=CORNERS[:2]), "two words are one map"),
    (copies(.5, .3, places=CORNERS[:1] * 2), "two words are one map"),               # all of it is one point
    (copies(*[.5] * 3, places=[[0, 0], [0, 0], [1, 0]]), "two words are one map"),
    (copies(.6, .6, .6, places=CORNERS[:3]), "at most 2"),
    (copies(.55, .47, .58, places=[[0, 0], [1, .2], [.3, .9]]), "remains open"),
])
def test_where_pieces_overlap_or_may_it_is_an_upper_bound(code, why):
    found = code.dimension()
    assert found.standing == "upper bound" and why in found.condition
    assert str(found) == ("at most 2, pieces overlap (2.15 by formula)" if found.value > 2 else
                          f"{found.value:.4f}, upper bound")
    assert sum(float(r) ** found.value for r in code.singular_values()[:, 0]) == pytest.approx(1, abs=1e-5)


def triangular(rng) -> np.ndarray:
    linear = rng.uniform(-.55, .55, (3, 2, 2))
    linear[:, 1, 0] = 0
    return linear


def by_diagonal(linear: np.ndarray) -> float:
    """The affinity dimension of triangular matrices (Falconer and Miao 2007)."""
    a, b = np.abs(np.diagonal(linear, axis1=1, axis2=2)).T

    def excess(s):
        return max((a**s).sum(), (b**s).sum()) - 1 if s <= 1 else max((a * b ** (s - 1)).sum(),
                                                                      (b * a ** (s - 1)).sum()) - 1

    return brentq(excess, 0, 2)


@pytest.mark.parametrize("seed", range(6))
def test_the_affinity_dimension_of_triangular_maps_is_that_of_their_diagonals(seed):
    rng = np.random.default_rng(seed)
    linear = triangular(rng)
    low, value, high = affinity(linear)
    assert low - 1e-5 <= by_diagonal(linear) <= high + 1e-5 and high - low < 0.1
    assert value == pytest.approx(by_diagonal(linear), abs=0.01)
    basis = rng.normal(size=(2, 2)) + 2 * np.eye(2)   # in which they may stretch: only products need to contract
    turned = basis @ linear @ np.linalg.inv(basis)
    assert affinity(turned)[1] == pytest.approx(value, abs=0.01)


def test_the_affinity_dimension_is_the_limit_of_sums_over_words():
    linear = np.random.default_rng(3).normal(size=(3, 2, 2)) * .35
    low, value, high = affinity(linear)

    def root(letters):
        words = [np.linalg.multi_dot([linear[i] for i in word]) for word in product(range(3), repeat=letters)]
        a, b = np.linalg.svd(np.stack(words), compute_uv=False).T
        return brentq(lambda s: (a ** min(s, 1) * b ** max(s - 1, 0)).sum() - 1, 0, 2)

    four, eight = root(4), root(8)          # both above the limit, by about 1 / letters
    assert low <= value <= high < eight < four
    assert 2 * eight - four == pytest.approx(value, abs=0.01)


def test_a_product_of_cantor_sets_has_less_than_its_affinity_dimension():
    found = PRODUCT.dimension()
    assert (found.kind, found.standing) == ("affinity", "upper bound") and "keep a direction" in found.condition
    assert found.value == pytest.approx(1 + math.log(4 / 3, 4), abs=1e-4)
    assert found.low - 1e-6 <= 1 + math.log(4 / 3, 4) <= found.high + 1e-6
    of_boxes = math.log(2, 3) + math.log(2, 4)         # Bedford and McMullen: two columns, two boxes in each
    assert found.value > of_boxes + 0.07


def test_takagis_curve_contracts_only_as_a_whole():
    shears = np.array([[[.5, 0], [1, .5]], [[.5, 0], [-1, .5]]])
    low, value, high = affinity(shears)
    assert low - 1e-5 <= 1 <= high + 1e-3 and value == pytest.approx(1, abs=1e-3)


def test_the_fern_has_an_affinity_dimension_between_its_leaf_and_the_plane():
    found = codes.known("fern").dimension()
    assert found.kind == "affinity" and 1.8 < found.low <= found.value <= found.high < 1.87
    assert "no pieces overlap" in found.condition and found.high - found.low < 1e-3


def test_more_than_the_plane_means_that_pieces_overlap():
    assert "at most 2" in codes.known("maple_leaf").dimension().condition


def test_the_measures_dimensions_are_their_formulas():
    p = np.array([.6, .3, .1])
    information, correlation = UNEVEN.dimension("information"), UNEVEN.dimension("correlation")
    assert information.value == pytest.approx(-(p * np.log2(p)).sum(), abs=1e-6) and information.standing == "exact"
    assert correlation.value == pytest.approx(-np.log2((p**2).sum()), abs=1e-6) and correlation.standing == "exact"
    assert 1.585 > information.value > correlation.value
    assert GASKET.dimension("correlation").value == pytest.approx(math.log2(3), abs=1e-6)
    r, q = np.array([.5, .5, .5, .25]), np.array([.3, .3, .3, .1])
    uneven = replace(QUARTER, probabilities=torch.from_numpy(q))
    assert (q**2 * r ** -uneven.dimension("correlation").value).sum() == pytest.approx(1, abs=1e-5)
    assert uneven.dimension("information").value == pytest.approx(q @ np.log(q) / (q @ np.log(r)), abs=1e-5)


@pytest.mark.parametrize(("code", "kind"), [(LINE, "information"), (UNEVEN, "correlation"), *(
    pytest.param(*each, marks=pytest.mark.slow) for each in product([code for code, _ in KNOWN], MEASURES))])
def test_estimates_from_points_hold_the_formula(code, kind):
    estimate, value = of_points(code, kind, 0), min(code.dimension(kind).value, 2)
    if code.meta.get("name") == "heighway_dragon":   # filled, with a fractal edge: too low, as docs/dimension.md says
        assert value - 0.1 < estimate.value < value
        return
    assert estimate.standing == "estimate" and estimate.low <= value <= estimate.high
    assert estimate.value == pytest.approx(value, abs=0.06) and estimate.high - estimate.low < 0.35


@pytest.mark.slow
def test_the_measure_of_mcmullens_carpet_has_its_dimensions():
    places = torch.tensor([[0.0, 0], [1, 1], [2, 0]])
    size = torch.tensor([1 / 3, 1 / 2])
    carpet = IFS(torch.diag(size).expand(3, 2, 2), places * size)
    rows = np.array([2, 1]) / 3                      # of which the first holds two rectangles (Ledrappier and Young)
    entropy = -(rows * np.log(rows)).sum()
    information, correlation = carpet.dimension("information"), carpet.dimension("correlation")
    assert information.low < entropy / math.log(2) + 1 - entropy / math.log(3) < information.high
    renyi = -math.log((rows**2).sum())
    assert correlation.low < renyi / math.log(2) + 1 - renyi / math.log(3) < correlation.high
    assert carpet.dimension().value == pytest.approx(1 + math.log(3 / 2, 3), abs=1e-4)


def test_where_no_formula_holds_points_of_the_seed_are_drawn():
    found = PRODUCT.dimension("information", seed=1)
    assert found.standing == "estimate" and "8 × 50000 points" in found.condition
    assert found.low < math.log(2, 3) + math.log(2, 4) < found.high      # the measure is a product, too
    assert found == PRODUCT.dimension("information", seed=1) != PRODUCT.dimension("information", seed=2)


def test_points_have_dimension_zero():
    one = copies(.5, places=[[3, 4]])
    assert [one.dimension(kind).value for kind in (None, "affinity", "information", "correlation")] == [0] * 4
    assert IFS(torch.diag(torch.tensor([.5, .2]))[None], torch.zeros(1, 2)).dimension().value == 0
    atoms = IFS(torch.cat([GASKET.linear, torch.zeros(1, 2, 2)]), torch.cat([GASKET.offset, torch.ones(1, 2)]))
    assert atoms.dimension().value == pytest.approx(1.58496, abs=1e-5)
    assert atoms.dimension("information").value == 0 and atoms.dimension("information").standing == "exact"
    here = copies(.5, .3, places=CORNERS[:1] * 2)
    assert here.dimension("information").value == 0


def test_what_is_never_drawn_does_not_count():
    more = IFS(torch.cat([GASKET.linear, .9 * torch.eye(2)[None]]), torch.cat([GASKET.offset, torch.zeros(1, 2)]),
               torch.tensor([.5, .25, .25, 0]))
    assert more.dimension() == GASKET.dimension()
    assert more.dimension("information").value == pytest.approx(1.5, abs=1e-6)


def test_what_has_no_dimension_is_refused():
    with pytest.raises(InputError, match="kind must be one of similarity.* did you mean 'correlation'"):
        GASKET.dimension("corelation")
    with pytest.raises(InputError, match='take kind="affinity"'):
        PRODUCT.dimension("similarity")
    with pytest.raises(InputError, match="contract"):
        IFS(2 * GASKET.linear, GASKET.offset).dimension()


def test_a_code_that_contracts_on_average_has_the_dimensions_of_its_measure_alone():
    ratios = torch.tensor([0.3, 1.8, 0.5])
    code = IFS(ratios[:, None, None] * torch.eye(2), torch.tensor([[0.0, 0], [1, 0], [0, 1]]), [0.4, 0.2, 0.4])
    for kind in None, "similarity", "affinity":
        with pytest.raises(InputError, match="on average only"):
            code.dimension(kind)
    assert code.dimension("information").standing == code.dimension("correlation").standing == "estimate"
