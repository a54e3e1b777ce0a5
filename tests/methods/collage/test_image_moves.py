"""The picture as the judge of codes: polish, and moves of single maps."""

from dataclasses import replace

import pytest
import torch
from collage_helpers import CAMERA, DENSITY, PARAMS, distances, image_search, objective, tied

from fractal_exp import codes, suite
from fractal_exp.cameras.kinds import kind_of
from fractal_exp.ifs import affine, attractor
from fractal_exp.methods.collage.bins import binned
from fractal_exp.methods.collage.image.gauss_newton import polished
from fractal_exp.methods.collage.image.objective import ImageObjective, reduced
from fractal_exp.methods.collage.measure.births import mirrored, narrowed, reoriented
from fractal_exp.methods.collage.moves import single


def test_a_true_code_is_told_from_a_wrong_one_by_its_picture(triangle):
    code, image = triangle
    picture = objective(image)
    maps = affine.from_code(code)
    true, shifted, fewer = (picture.judge(m).error for m in (maps, maps + 0.002 * torch.eye(3, 6), maps[:2]))
    assert true < 1.2 * picture.noise(code)
    assert true < 0.5 * shifted and shifted < fewer


@pytest.mark.parametrize("levels", ["density", "binary"])
def test_polish_finds_back_to_a_small_part_of_a_pixel_and_never_leads_up(triangle, levels):
    code, _ = triangle
    image = suite.target(code, 128, "grey" if levels == "density" else "binary")
    picture = objective(image, kind_of(levels)(CAMERA))
    maps = affine.from_code(code)
    off = maps + 0.004 * torch.randn(maps.shape, generator=torch.Generator().manual_seed(0))
    start = picture.judge(off)
    found = polished(picture, start, 10)
    assert found.error < 0.5 * start.error
    measure = binned(DENSITY.measure(image), 64)
    away = distances(found.maps, maps, measure).diagonal().max() * 64  # pixels of 128
    assert away < (0.06 if levels == "density" else 0.3)
    assert polished(picture, found, 2).error <= found.error


def test_a_faint_map_that_is_missing_is_found_by_its_picture():
    maps = affine.from_code(codes.known("sierpinski_triangle"))
    small_one = torch.tensor([[0.08, 0.03, -0.02, 0.1, 0.9, 0.6]])
    code = attractor.normalize(affine.to_code(torch.cat([maps, small_one])))
    image, true = suite.target(code, 128), affine.from_code(code)
    search = image_search(image)
    now = search.resume(tied(true[:3]))
    before = now.error
    for number in range(25):
        now = search.step(now, number)
    assert now.error < 0.6 * before and len(now.maps) >= 4


def test_a_reoriented_map_keeps_mean_and_covariance(triangle):
    code, image = triangle
    measure = binned(DENSITY.measure(image), 64)
    old = affine.from_code(code)[0]
    new = reoriented(old, measure, 8, torch.Generator().manual_seed(0))
    linear, was = new[:, :4].unflatten(1, (2, 2)), old[:4].view(2, 2)
    torch.testing.assert_close(linear @ measure.covariance @ linear.mT,
                               (was @ measure.covariance @ was.T).expand(8, 2, 2), atol=2e-5, rtol=1e-3)
    torch.testing.assert_close(linear @ measure.mean + new[:, 4:], (was @ measure.mean + old[4:]).expand(8, 2))


def test_a_map_thinner_than_a_subpixel_is_found_by_its_picture():
    code = attractor.normalize(replace(codes.known("fern"), probabilities=None))
    image, true = suite.target(code, 128), affine.from_code(code)
    stem = int(code.linear.det().abs().argmin())
    rest = true[[i for i in range(4) if i != stem]]
    search = image_search(image)
    now = search.resume(tied(rest))
    before = now.error
    for number in range(12):
        now = search.step(now, number)
    assert now.error < 0.5 * before and len(now.maps) == 4


@pytest.mark.parametrize("order", [2, 3])
@pytest.mark.parametrize("one", [[0.83, 0.04, -0.04, 0.83, 0.0, 0.4], [0.5, 0.3, 0.0, 0.5, 0.1, 0.2],
                                 [0.4, 0.0, 0.0, 0.4, 0.3, 0.0], [0.0, 0.0, 0.0, 0.16, 0.0, 0.3]],
                         ids=["turn", "shear", "scale", "line"])
def test_the_root_of_a_map_applied_often_enough_is_the_map(one, order):
    found, result = affine.root(torch.tensor(one), order), torch.eye(3)
    step = torch.cat([torch.cat([found[:4].view(2, 2), found[4:, None]], 1), torch.tensor([[0.0, 0, 1]])])
    for _ in range(order):
        result = step @ result
    torch.testing.assert_close(torch.cat([result[:2, :2].flatten(), result[:2, 2]]), torch.tensor(one), atol=1e-5,
                               rtol=1e-5)


@pytest.mark.parametrize(("one", "why"), [
    ([0.5, 0, 0, -0.5, 0.1, 0.1], "a reflection is no square"), ([0.4, 0.9, 0, 0.4, 0, 0], "it does not contract"),
    ([0.0, 0, 0, 0, 0.1, 0.2], "both eigenvalues are 0")])
def test_some_maps_have_no_root(one, why):
    assert affine.root(torch.tensor(one), 2) is None, why


def test_what_precedes_a_map_gives_the_others_back():
    fern = affine.from_code(codes.known("fern"))
    one, others = fern[1], fern[2:]
    linear = one[:4].view(2, 2)
    after = torch.cat([(linear @ others[:, :4].unflatten(1, (2, 2))).flatten(1), others[:, 4:] @ linear.T + one[4:]], 1)
    torch.testing.assert_close(affine.preceded(one, after), others, atol=1e-5, rtol=1e-5)
    assert len(affine.preceded(torch.tensor([0.1, 0, 0, 0.1, 0, 0]), others)) == 0  # none that is contractive
    assert len(affine.preceded(fern[0], others)) == 0  # the stem is singular


def test_a_map_found_squared_is_replaced_by_its_root():
    code = attractor.normalize(replace(codes.known("cyclosorus"), probabilities=None))
    image, true = suite.target(code, 128), affine.from_code(code)
    large = int(affine.volumes(true).argmax())
    linear = true[large, :4].view(2, 2)
    squared = torch.cat([(linear @ linear).flatten(), linear @ true[large, 4:] + true[large, 4:]])
    others = torch.cat([true[:large], true[large + 1:]])
    company = torch.cat([(linear @ others[:, :4].unflatten(1, (2, 2))).flatten(1),
                         others[:, 4:] @ linear.T + true[large, 4:]], 1)
    search = image_search(image)
    shown = search.objective.judge(torch.cat([squared[None], others, company]))
    g = torch.Generator().manual_seed(0)
    found = min((single.with_root(search, shown, g) for _ in range(4)), key=lambda drawn: drawn.error)
    assert found.error < shown.error and len(found.maps) == 4
    search = image_search(image, at_most=3)
    assert all(len(single.rooted(search, shown, 0, order).maps) in (len(shown.maps), 2, 3) for order in (2, 3))


def test_reflections_and_thinner_images_stay_in_place(triangle):
    code, image = triangle
    measure = binned(DENSITY.measure(image), 64)
    old = torch.tensor([[0.3, 0.1, -0.2, 0.15, 0.1, 0.2]])

    def image_of(maps):
        linear = maps[:, :4].unflatten(1, (2, 2))
        return linear @ measure.mean + maps[:, 4:], linear @ measure.covariance @ linear.mT

    mean, covariance = image_of(old)
    others = mirrored(old[0], measure)
    for got, wanted in zip(image_of(others), (mean, covariance), strict=True):
        torch.testing.assert_close(got, wanted.expand_as(got), atol=2e-5, rtol=1e-3)
    dets = [float(m[:4].view(2, 2).det()) for m in (old[0], *others)]
    assert [det / dets[0] for det in dets] == pytest.approx([1, -1, -1, 1], rel=1e-3)
    thin = narrowed(old, measure, 0.1)
    torch.testing.assert_close(image_of(thin)[0], mean)
    was, new = torch.linalg.eigvalsh(covariance[0]), torch.linalg.eigvalsh(image_of(thin)[1][0])
    assert float(new[1] / was[1]) == pytest.approx(1, rel=1e-3)
    assert float(new[0] / was[0]) == pytest.approx(0.01, rel=0.1)


@pytest.mark.parametrize(("kind", "levels", "noises"), [("grey", "density", 1.2), ("binary", "binary", 3)])
def test_a_reduced_picture_is_as_it_would_have_been_drawn(kind, levels, noises):
    code = attractor.normalize(replace(codes.known("fern"), probabilities=None))
    levels, image = kind_of(levels)(CAMERA), suite.target(code, 512, kind)

    def error(picture: ImageObjective) -> float:
        return picture.error(picture.render(code)) / picture.noise(code)

    shrunk = error(objective(levels.shrunk(image, 256), levels))
    known = error(objective(reduced(image, 256, code, levels, PARAMS, 0), levels))
    away = affine.from_code(code) + 2e-4 * torch.randn(4, 6, generator=torch.Generator().manual_seed(0))
    nearly = error(objective(reduced(image, 256, affine.to_code(away), levels, PARAMS, 0), levels))
    assert known < noises and known < 0.7 * shrunk and known < nearly < shrunk
