"""Tracked fits of pictures in colour."""

from pathlib import Path

import numpy as np
import pytest
import torch
from PIL import Image
from train_helpers import own_method, train

from fractal_exp import IFS, InputError
from fractal_exp.tracking import read_artifact, runs_frame

RED, BLUE = (200, 30, 20), (20, 60, 190)


@pytest.fixture(scope="module")
def picture(tmp_path_factory) -> Path:
    """A cross on white, red on the left and blue on the right."""
    image = np.full((64, 64, 3), 255, np.uint8)
    for columns, colour in ((slice(10, 32), RED), (slice(32, 54), BLUE)):
        image[28:36, columns] = colour
    image[10:54, 28:32], image[10:54, 32:36] = RED, BLUE
    path = tmp_path_factory.mktemp("picture") / "cross.png"
    Image.fromarray(image).save(path)
    return path


def on_picture(path: Path, output: Path, *others: str) -> dict[str, float]:
    return train("target=image", f"target.path={path}", f"output={output}", *others)


def test_a_fit_in_colour_keeps_and_tracks_colours(picture, tmp_path, capsys):
    scores = on_picture(picture, tmp_path, "colour=true")
    folder, uri = tmp_path / "fits" / "fit", f"sqlite:///{tmp_path / 'mlflow.db'}"
    code, run = IFS.load(folder / "code.json"), runs_frame(uri, "fits").iloc[0]
    assert code.colours is not None and len(code.colours) == len(code) == 10
    error = scores["eval/ciede2000"]
    assert 0 < error < 60 and run["metrics.eval/ciede2000"] == pytest.approx(error)
    assert run["params.colour"] == "True" and "CIEDE2000 " in capsys.readouterr().out
    assert read_artifact(uri, run["run_id"], "code.json") == (folder / "code.json").read_bytes()
    kept = np.asarray(Image.open(folder / "views" / "coloured.png")).astype(int)
    assert kept.shape[1] == 2 * kept.shape[0] and kept.shape[2] == 3
    assert read_artifact(uri, run["run_id"], "views/coloured.png") is not None
    for half in np.hsplit(kept, 2):  # the picture, and the code: red on the left of it and blue on the right
        left, right = np.hsplit(half, 2)
        assert half[0, 0].tolist() == [255, 255, 255]
        assert (left[..., 0] - left[..., 2]).max() > 60 and (right[..., 2] - right[..., 0]).max() > 60

    again = on_picture(picture, tmp_path, "colour=true", "resume=true")
    assert again == scores and "finished; resume=false fits it again" in capsys.readouterr().out
    with pytest.raises(InputError, match="holds a fit of another configuration: colour"):
        on_picture(picture, tmp_path, "resume=true")


@pytest.mark.parametrize(("words", "message"), [
    (["target=suite"], "this target is drawn without any; give picture=FILE, or leave colour out"),
    (["target=retina"], "this target is drawn without any"),
    (["target=image", "target.path={grey}"], r"the shape in .*grey\.png is grey; leave colour out, or give another"),
    (["target=image", "target.path={picture}", "method=super_resolution"],
     "method=super_resolution finds none: it draws the image larger; take another method, or leave colour out"),
])
def test_what_has_no_colours_is_refused_before_the_fit(picture, tmp_path, words, message):
    grey = tmp_path / "grey.png"
    Image.open(picture).convert("L").save(grey)
    with pytest.raises(InputError, match=message):
        train("colour=true", f"output={tmp_path / 'out'}", *(word.format(grey=grey, picture=picture) for word in words))
    assert not (tmp_path / "out").exists()


def test_where_no_pixel_is_shared_the_code_stays_without_colours(picture, tmp_path, capsys):
    beside = IFS(torch.full((2, 2, 2), .01), torch.tensor([[.6, .6], [.5, .6]]))
    scores = on_picture(picture, tmp_path, "tracking=none", "colour=true", *own_method(tmp_path, beside))
    assert "eval/ciede2000" not in scores and "no colours" in capsys.readouterr().out
    assert IFS.load(tmp_path / "fits" / "fit" / "code.json").colours is None
