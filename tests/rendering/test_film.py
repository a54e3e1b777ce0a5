"""Films as files: every format holds grey and coloured frames, and their size is told before they are drawn."""

import imageio.v3 as iio
import numpy as np
import pytest
import torch
from PIL import Image

from fractal_exp import InputError, View, codes, render
from fractal_exp.ifs import attractor
from fractal_exp.rendering.film import AHEAD, forecast, frames, write_film
from fractal_exp.rendering.morph import morph_path
from fractal_exp.rendering.zoom import zoom_path
from fractal_exp.runtime import threads

NAMES = ["a.mp4", "a.webm", "a.gif", "a-%03d.png"]


def moving(shape=(32, 32), count: int = 6) -> list[torch.Tensor]:
    """A square that moves to the right, red where there are colours."""
    pictures = torch.zeros(count, *shape)
    for k in range(count):
        pictures[k, 8:24, 3 * k:3 * k + 12] = torch.tensor([0.9, 0.2, 0.1]) if len(shape) == 3 else 0.9
    return list(pictures)


def read(folder, name) -> np.ndarray:
    if "%" in name:
        return np.stack([np.asarray(Image.open(file).convert("RGB")) for file in sorted(folder.iterdir())])
    return iio.imread(folder / name, index=None if name.endswith("gif") else ...)[..., :3]


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("shape", [(32, 32), (32, 32, 3), (32, 48), (32, 28, 3)],
                         ids=["grey", "colour", "wide", "tall in colour"])
def test_every_format_holds_grey_and_coloured_frames(tmp_path, name, shape):
    pictures = moving(shape)
    path = write_film(tmp_path / name, pictures, fps=20)
    assert path == (tmp_path / name).absolute()
    film = read(tmp_path, name)
    assert film.shape == (6, *shape[:2], 3)
    for frame, picture in zip(film / 255, pictures, strict=True):
        wanted = (picture if len(shape) == 3 else picture[..., None].expand(-1, -1, 3)).numpy()
        assert np.abs(frame - wanted).mean() < 0.05


@pytest.mark.parametrize("name", NAMES)
def test_the_forecast_tells_size_and_length(tmp_path, name):
    course, views = morph_path([codes.known("fern"), codes.known("tree")], 48)

    def draw(part):
        return frames(course[part], views[part], resolution=96, points_in_view=50_000)

    told = forecast(tmp_path / name, draw, 48, fps=20)
    assert not list(tmp_path.iterdir())
    write_film(tmp_path / name, draw(slice(None)), fps=20)
    size = sum(file.stat().st_size for file in tmp_path.iterdir())
    assert told.frames == 48 and told.seconds == pytest.approx(2.4) and told.drawing_seconds > 0
    assert size / 1.6 < told.bytes < 1.6 * size
    assert str(told).startswith("48 frames, 2.4 s of film, about ") and str(told).endswith(" to draw")


@pytest.mark.parametrize("mode", ["occupancy", "density"])
def test_the_same_film_on_any_number_of_threads(mode):
    code = attractor.normalize(codes.known("fern"))
    views = zoom_path(attractor.random_point(code), 6, end_zoom=30)
    try:
        threads.use(1)
        alone = list(frames(code, views, resolution=64, points_in_view=50_000, mode=mode))
    finally:
        threads.use()
    together = list(frames(code, views, resolution=64, points_in_view=50_000, mode=mode))
    assert all(map(torch.equal, alone, together)) and not torch.equal(together[0], together[1])


def test_frames_are_stills_of_their_views():
    """Also where the next view is not like the last one, from which its weight is guessed."""
    code = attractor.normalize(codes.known("heighway_dragon"))
    point = attractor.random_point(code, 2)
    views = [View(point, zoom) for zoom in (1e5, 9e4, 1, 1, 1e3, 2, 1e6)]
    for view, frame in zip(views, frames(code, views, resolution=96, points_in_view=100_000), strict=True):
        still = render(code, view, resolution=96, points_in_view=100_000, seed=77)
        other = render(code, view, resolution=96, points_in_view=100_000, seed=78)
        assert float(frame.mean()) == pytest.approx(float(still.mean()), rel=0.03)
        assert float(((frame - still)**2).mean()) < 1.2 * float(((other - still)**2).mean())


def test_a_film_that_ends_early_draws_no_further():
    drawn = []

    class Course(list):
        def __getitem__(self, number):
            drawn.append(number)
            return super().__getitem__(number)

    film = frames(codes.known("fern"), Course([View()] * 50), resolution=16, points_in_view=100)
    next(film)
    film.close()
    assert 0 in drawn and len(drawn) <= 1 + AHEAD


def test_a_film_that_finds_no_room_is_refused_before_it_is_drawn(tmp_path):
    """No disk holds a film of 10¹⁵ frames."""
    drawn = []

    def draw(part):
        drawn.extend(range(*part.indices(10**15)))
        return moving()[:part.stop - part.start]

    with pytest.raises(InputError, match="10{15} frames would take about .* has .* left; draw fewer frames"):
        forecast(tmp_path / "a.mp4", draw, 10**15)
    assert 0 < len(drawn) < 20 and not list(tmp_path.iterdir())
    with pytest.raises(InputError, match="a GIF of 100000000000 frames would take .* of memory"):
        forecast(tmp_path / "a.gif", lambda part: moving()[:4], 10**11)
