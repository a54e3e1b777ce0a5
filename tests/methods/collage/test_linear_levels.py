"""Grey levels in proportion to the density of points: the tone, its derivatives, the population search."""

import numpy as np
import pytest
import torch
from collage_helpers import params
from scipy.ndimage import gaussian_filter

from fractal_exp import invert
from fractal_exp.cameras.linear import LEAST_POINTS, Linear
from fractal_exp.cameras.points import attractor_points
from fractal_exp.errors import InputError
from fractal_exp.ifs import affine
from fractal_exp.ifs.code import IFS
from fractal_exp.images.levels import TargetImage
from fractal_exp.likeness import Likeness
from fractal_exp.methods.collage.image.counts import FromCounts
from fractal_exp.methods.collage.image.jacobian import WEIGHT
from fractal_exp.methods.collage.image.objective import ImageObjective
from fractal_exp.methods.collage.measure.population import Population
from fractal_exp.methods.collage.method import Collage
from fractal_exp.methods.collage.params import CameraParams
from fractal_exp.methods.collage.stages.base import SearchProblem
from fractal_exp.methods.collage.stages.crossing import Crossing

SIDE, BLUR_PX, POINTS = 64, 1.2, 60_000
CODE = IFS(torch.tensor([[[0.55, -0.2], [0.2, 0.5]], [[0.1, 0.45], [-0.5, 0.1]], [[0.4, 0.1], [0.0, -0.35]]]),
           torch.tensor([[-0.25, 0.25], [0.45, 0.1], [-0.1, -0.5]]), torch.tensor([0.55, 0.3, 0.15]))
CAMERA = {"blur_px": BLUR_PX, "points_per_pixel": POINTS / SIDE**2}


def counted(points: np.ndarray, side: int = SIDE, blur_px: float = BLUR_PX) -> np.ndarray:
    """What an image of points is: drawn by NumPy and SciPy alone."""
    counts, _, _ = np.histogram2d(-points[:, 1], points[:, 0], side, [[-1, 1], [-1, 1]])
    return gaussian_filter(counts, blur_px, mode="constant") if blur_px else counts


def played(code: IFS, seed: int, count: int = POINTS) -> np.ndarray:
    """Points of a chaos game that is not the package's."""
    rng, linear, offset = np.random.default_rng(seed), code.linear.double().numpy(), code.offset.double().numpy()
    chances = code.sampling_probabilities().double().numpy()
    x, kept = np.zeros((count // 100, 2)), []
    for _ in range(130):
        letters = rng.choice(len(code), len(x), p=chances / chances.sum())
        x = np.einsum("tij,tj->ti", linear[letters], x) + offset[letters]
        kept.append(x)
    return np.concatenate(kept[30:])


@pytest.fixture(scope="module")
def image() -> torch.Tensor:
    drawn = counted(played(CODE, 1))
    return torch.from_numpy((drawn / drawn.max()).astype(np.float32))


def judge(image: torch.Tensor, **options) -> ImageObjective:
    given = params(**{"camera": CAMERA} | options)
    return ImageObjective(image, Linear(given.camera, image), given)


@pytest.mark.parametrize("blur_px", [0.0, 1.0, 2.0])
def test_a_linear_image_is_a_histogram_under_a_blur(blur_px):
    code = CODE.similar(1, (0.5, 0.3))  # a part of it beyond the canvas
    levels = Linear(CameraParams(blur_px=blur_px, points_per_pixel=1.0), brightness=0.2)
    points = attractor_points(affine.from_code(code), code.sampling_probabilities(), round(LEAST_POINTS * SIDE**2), 7)
    points = points.double().numpy()
    assert (np.abs(points) > 1).any()
    expected = counted(points, blur_px=blur_px)
    torch.testing.assert_close(levels.render(code, SIDE, 7).double().numpy(), 0.2 * expected / expected.mean(),
                               rtol=1e-3, atol=1e-4)


def test_an_image_that_is_shrunk_has_the_blur_and_the_noise_of_the_whole_one(image):
    levels = Linear(params(camera=CAMERA).camera, image)
    assert levels.blur_px(SIDE // 2) == BLUR_PX / 2 and levels.points(SIDE // 2) == pytest.approx(POINTS)
    small = judge(levels.shrunk(image, SIDE // 2))
    shrunk = ImageObjective(small.image, levels, small.params)
    assert shrunk.error(shrunk.render(CODE)) == pytest.approx(shrunk.noise(CODE), rel=0.35)


@pytest.mark.parametrize("points_per_pixel", [4.0, 40.0])
def test_counting_errors_of_blurred_counts_have_one_variance(points_per_pixel):
    quarters = torch.tensor([[-0.5, -0.5], [-0.5, 0.5], [0.5, -0.5], [0.5, 0.5]])
    flat = IFS(torch.eye(2).expand(4, 2, 2) / 2, quarters)  # all of the canvas evenly
    levels = Linear(CameraParams(blur_px=BLUR_PX, points_per_pixel=points_per_pixel), brightness=0.5)
    n = levels.subpixels(SIDE, SIDE)
    stable = torch.stack([levels.stabilized(levels.noisy(flat, SIDE, seed), n) for seed in range(20)])
    inner = slice(6, SIDE - 6)  # some blur is lost over the edge
    assert float(4 * n * stable[:, inner, inner].var(0).mean()) == pytest.approx(1, abs=0.15)


def test_sharpening_undoes_most_of_a_blur(image):
    measure = judge(image).levels.measure(image)
    assert float(measure.sum()) == pytest.approx(1, abs=1e-4)
    sharp = torch.from_numpy(counted(played(CODE, 2), blur_px=0)).float()
    sharp, seen = sharp / sharp.sum(), image / image.sum()
    smooth = [torch.from_numpy(gaussian_filter(each.numpy(), 0.5)) for each in (sharp, measure, seen)]
    assert float((smooth[1] - smooth[0]).abs().sum()) < 0.7 * float((smooth[2] - smooth[0]).abs().sum())


def test_derivatives_by_maps_and_probabilities_are_those_of_renderings(image):
    picture = judge(image, camera=CAMERA | {"points_per_pixel": 120.0}, gauss_newton={"points_per_cell": 100.0})
    shown = picture.judge(affine.from_code(CODE), CODE.probabilities)
    jacobian = FromCounts(picture, shown, range(3), 0)
    assert [unit[:2] for unit in jacobian.units if unit[1] == WEIGHT] == [(0, 6), (1, 6), (2, 6)]
    _, rows = next(iter(jacobian.grids(picture, shown)))
    for k, (_, j, _) in enumerate(jacobian.units):
        nudge = torch.zeros(len(jacobian.units))
        nudge[k] = 0.5
        fro, to = (picture.render(affine.to_code(jacobian.moved(sign * nudge), jacobian.weighed(sign * nudge)))
                   for sign in (-1, 1))
        change = (picture.stabilized(to)[0] - picture.stabilized(fro)[0]).flatten()
        alike = torch.nn.functional.cosine_similarity(rows[:, k], change, dim=0)
        assert float(alike) > (0.9 if j == WEIGHT else 0.95)
        assert float(rows[:, k].norm() / change.norm()) == pytest.approx(1, abs=0.2)


def test_tied_probabilities_stay_tied(image):
    picture = judge(image)
    jacobian = FromCounts(picture, picture.judge(affine.from_code(CODE)), [0], 0)
    assert len(jacobian.units) == 6 and jacobian.weighed(torch.ones(6)) is None


def test_a_code_is_found_from_its_density_alone(image):
    density = image.double().numpy() * 1e-3  # of any scale
    found = invert(density, levels="linear", maps=3, frame="keep", resolution=SIDE, camera=CAMERA,
                   population={"first": 200, "size": 24}, moves={"polish_ends": 4, "polish_starts": 2})
    points = torch.from_numpy(played(CODE, 3, 2000)).float()
    sent = [points @ each.linear.mT + each.offset[:, None] for each in (CODE, found.code)]
    away = (sent[0][:, None] - sent[1][None]).square().sum(-1).mean(-1).sqrt() * SIDE / 2
    nearest = away.min(1)
    assert sorted(nearest.indices.tolist()) == [0, 1, 2] and float(nearest.values.max()) < 0.3
    assert found.code.probabilities[nearest.indices].tolist() == pytest.approx([0.55, 0.3, 0.15], abs=0.02)
    assert found.likeness.noise_ratio < 2 and found.history[0].name == "population"


def test_a_likeness_is_that_under_the_camera_of_the_image(image):
    target = TargetImage.of(image, "linear")
    known, wrong = (Likeness.of(CODE, target, params=CameraParams(**CAMERA | {"blur_px": blur}))
                    for blur in (BLUR_PX, 0.5))
    assert known.noise_ratio < 1.3 and wrong.noise_ratio > 2


def test_a_resumed_population_goes_on_as_if_it_had_never_stopped(image):
    picture = judge(image)
    given = picture.params.updated(maps=3, population={"first": 20, "size": 6, "generations": 12})
    masses = picture.levels.measure(image)
    search = Crossing(masses, picture, given)
    now, kept = search.start(), []
    for number in range(22):
        now = search.step(now, number)
        kept.append(now)
    assert kept[-1].error <= kept[0].error and search.number == 1
    for done in (11, 21):
        resumed = Crossing(masses, picture, given, done=done)
        again = kept[done - 1]
        for number in range(done, 22):
            again = resumed.step(again, number)
        assert torch.equal(again.maps, now.maps) and again.error == now.error


def test_a_population_only_gets_better_and_stays_sorted(image):
    given = params(maps=3, population={"first": 30, "size": 10})
    some = Population(judge(image).levels.measure(image), 3, given)
    before = some.errors.clone()
    for _ in range(3):
        some.advance()
        assert some.maps.shape == (10, 3, 6) and torch.equal(some.errors, some.errors.sort().values)
    assert float(some.errors[0]) <= float(before[0]) and float(some.errors.mean()) < float(before.mean())


def test_populations_are_for_linear_images_of_a_given_number_of_maps(image):
    def crossed(image: torch.Tensor, **options) -> bool:
        given = params(**options)
        return SearchProblem(image, Linear(given.camera, image), given).is_crossed

    assert crossed(image, maps=3)
    assert not crossed(image) and not crossed(image, maps=9) and not crossed(image, maps=3, population={"most_maps": 0})


@pytest.mark.parametrize(("camera", "message"), [
    ({"blur_px": -1.0}, "camera.blur_px must be at least 0"),
    ({"blur_px": float("inf")}, "camera.blur_px must be a finite number"),
    ({"points_per_pixel": 0.0}, "camera.points_per_pixel must be at least 0.1"),
])
def test_a_camera_that_cannot_be_is_refused(camera, message):
    with pytest.raises(InputError, match=message):
        Collage(camera=camera)


@pytest.mark.parametrize("counts", [np.full((64, 64), 3.0), -np.eye(64), np.full((64, 64), np.nan)])
def test_what_is_no_density_is_refused(counts):
    with pytest.raises(InputError, match="must be finite, at least 0 and not all equal"):
        invert(counts, levels="linear", maps=3, frame="keep")
