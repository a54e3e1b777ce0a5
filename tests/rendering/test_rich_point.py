"""Where a film zooms to unless told."""

import numpy as np
import pytest

from fractal_exp import IFS, View, codes
from fractal_exp.ifs import attractor
from fractal_exp.rendering import zoom as rich
from fractal_exp.rendering.still import render_with_info
from fractal_exp.rendering.weighing import address_tree
from fractal_exp.rendering.zoom import _look, _richness, _without_noise, rich_point
from fractal_exp.suite import random_suite

DRAGON = attractor.normalize(codes.known("heighway_dragon"))
TREE = address_tree(DRAGON)
SLOWLY = np.array([[.172, -.731, -.297, -.278, .612, -.202, .141],
                   [-.086, -.843, -.191, .612, .401, .464, .114],
                   [-.967, .088, .765, .516, .081, .752, .302],
                   [-.630, .325, -.701, -.897, -.535, .711, .424],
                   [-.580, -.231, .452, .241, -.130, .848, .019]])  # a b c d e f p


@pytest.mark.slow
def test_a_film_of_the_dragon_follows_its_border():
    dull = _without_noise(_look(TREE, attractor.random_point(DRAGON), 1e4))
    assert dull.min() == 1, "a random point lies where all is filled"
    point = rich_point(DRAGON, 0, end_zoom=1e4)
    assert point == rich_point(DRAGON, 0, end_zoom=1e4) != rich_point(DRAGON, 1, end_zoom=1e4)
    for zoom in (10, 100, 1e3, 1e4):
        assert 0.05 < float(_without_noise(_look(TREE, point, zoom)).mean()) < 0.95
    assert not render_with_info(DRAGON, View(point, 1e5), resolution=16, points_in_view=1000)[1].empty


@pytest.mark.slow
@pytest.mark.parametrize("index", [0, 57])
def test_a_film_of_a_code_that_flattens_does_not_end_in_stripes(index):
    """About almost every point of such a code, deep views show parallel lines."""
    code = attractor.normalize(random_suite(index + 1)[index])
    zooms, tree = np.geomspace(20, 2e5, 5), address_tree(code)
    stripes = [min(_richness(_look(tree, attractor.random_point(code, seed), float(zoom))) for zoom in zooms)
               for seed in range(4)]
    point = rich_point(code, 0, end_zoom=1e6)
    assert min(_richness(_look(tree, point, float(zoom))) for zoom in zooms) > max(1, 4 * max(stripes))


@pytest.mark.slow
def test_a_film_of_a_code_that_contracts_on_average_only_goes_where_it_can_be_drawn_the_longest(monkeypatch):
    """No bound is certain there, so that most words meet a deep view: few looks are worth their while."""
    code = attractor.normalize(IFS(SLOWLY[:, :4].reshape(-1, 2, 2), SLOWLY[:, 4:6], SLOWLY[:, 6]))
    assert code.contraction.kind == "average"
    seen: dict[tuple[tuple[float, float], float], float] = {}

    def look(tree, point, closer):
        lit = _look(tree, point, closer)
        seen[point, closer] = _richness(lit)
        return lit

    monkeypatch.setattr(rich, "_look", look)
    point = rich_point(code, 0, end_zoom=2000)
    zooms = [float(each) for each in np.geomspace(2, 2000, rich.DEPTHS)]

    def depth(point: tuple[float, float]) -> int:
        rows = [seen.get((point, each), 0) for each in zooms]
        return rows.index(0) if 0 in rows else len(rows)

    candidates = {each for each, closer in seen if closer == zooms[0]}
    assert depth(point) == max(map(depth, candidates)) > min(map(depth, candidates))
    assert len([closer for _, closer in seen if closer > 100]) < 40 < len(candidates) * len(zooms)
