"""Data sets as files: folders and shards, and that they can be gone on with."""

import io
import json
import tarfile

import numpy as np
import pytest
import torch
from commands import refusal
from PIL import Image

from fractal_exp import codes
from fractal_exp.cli import dataset as app
from fractal_exp.datasets import Fractals, write
from fractal_exp.suite import random_suite

SMALL = ["--size", "32", "--points", "500", "--repeats", "1"]
NAMES = ("fern", "tree")


def fractals(**options) -> Fractals:
    return Fractals([codes.known(name) for name in NAMES], **{"size": 32, "points": 500, "repeats": 1} | options)


def contents(folder) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*"))
            if path.is_file() and path.name != ".lock"}


def test_a_folder_for_each_code_holds_its_pictures_by_number(tmp_path):
    app.main([*NAMES, str(tmp_path / "set"), *SMALL])
    files, expected = contents(tmp_path / "set"), fractals()
    assert set(files) == {"dataset.json", *(f"0000{k}-{name}/{index:02d}.png" for k, name in enumerate(NAMES)
                                            for index in range(100))}
    for index in (0, 99, 100, 137):
        file = files[f"0000{index // 100}-{NAMES[index // 100]}/{index % 100:02d}.png"]
        assert (np.array(Image.open(io.BytesIO(file))) == expected.picture(index)).all()
    record = json.loads(files["dataset.json"])
    assert record["names"] == list(NAMES) and record["size"] == 32 and record["pictures"] == 200


def test_shards_hold_every_picture_once_in_random_order_beside_its_code_s_number(tmp_path):
    app.main([*NAMES, str(tmp_path), *SMALL, "--shards", "90", "--seed", "4"])
    pairs, expected = [], fractals(seed=4)
    assert sorted(contents(tmp_path)) == ["dataset.json", *(f"pictures-00000{k}.tar" for k in range(3))]
    for path in sorted(tmp_path.glob("*.tar")):
        with tarfile.open(path) as shard:
            members = [(member.name.split("."), shard.extractfile(member).read()) for member in shard]
        for ((key, kind), png), ((other, label), number) in zip(members[::2], members[1::2], strict=True):
            assert (key, kind, label) == (other, "png", "cls") and int(number) == int(key) // 100
            pairs.append((int(key), png))
    assert sorted(key for key, _ in pairs) == list(range(200)) and len({key // 100 for key, _ in pairs[:20]}) == 2
    for key, png in pairs[::23]:
        assert (np.array(Image.open(io.BytesIO(png))) == expected.picture(key)).all()


@pytest.mark.parametrize("shards", [None, 60])
def test_what_was_interrupted_goes_on_to_the_same_bytes(tmp_path, monkeypatch, shards):
    write(fractals(), NAMES, tmp_path / "whole", shards)
    drawn, count = Fractals.picture, iter(range(10**6))

    def interrupted(self, index):
        if next(count) == 130:
            raise KeyboardInterrupt
        return drawn(self, index)

    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr(Fractals, "picture", interrupted)
        write(fractals(), NAMES, tmp_path / "set", shards)
    done, told = contents(tmp_path / "set"), []
    there = write(fractals(), NAMES, tmp_path / "set", shards, told.append)
    assert there == (120 if shards else 100) and sum(told) == 200 and told[0] == there
    whole = contents(tmp_path / "whole")
    assert contents(tmp_path / "set") == whole and {"dataset.json"} < set(done) & set(whole) < set(whole)


def test_all_codes_of_folders_files_and_distributions(tmp_path):
    folder = tmp_path / "codes"
    (folder / "below").mkdir(parents=True)
    codes.known("fern").save(folder / "below" / "b.json")
    entries = "one { .5 0 0 .5 0 0 .5 .5 0 0 .5 1 0 .5 }", "two { .5 0 0 .5 0 0 .5 .5 0 0 .5 0 1 .5 }"
    (folder / "a.ifs").write_text("\n".join(entries))
    (folder / ".hidden").write_text("nothing")
    assert [name for name, _ in app.codes_named(str(folder))] == ["one", "two", "b"]
    assert [name for name, _ in app.codes_named(f"{folder / 'a.ifs'}:two")] == [f"{folder / 'a.ifs'}:two"]
    assert [code for _, code in app.codes_named("random:3:7")] == random_suite(3, 7)


def test_it_is_told_what_was_read_and_in_which_order(tmp_path, capsys):
    table = tmp_path / "koch.csv"
    table.write_text(".333,0,0,0,.333,0,.5\n.333,0,.667,0,.333,0,.5\n")
    ((name, code),) = app.codes_named(str(table), "abecdf")
    assert name == "koch" and code.linear[0].tolist() == torch.tensor([[.333, 0], [0, .333]]).tolist()
    assert "koch.csv: 2 maps read" in capsys.readouterr().err


def test_pictures_are_those_of_the_first_epoch_whatever_was_drawn_before(tmp_path):
    later = fractals()
    later.set_epoch(3)
    write(later, NAMES, tmp_path / "later", 60)
    write(fractals(), NAMES, tmp_path / "first", 60)
    assert contents(tmp_path / "later") == contents(tmp_path / "first") and later.epoch == 3


@pytest.mark.parametrize(("words", "message"), [
    (["mixed"], "mixed holds picture.png, which is no file of codes (.json, "),
    (["empty"], "empty holds no file of codes"),
    (["random:0"], "a suite has at least 1 fractal"),
    (["random:x"], "random:COUNT or random:COUNT:SEED, with a count of up to 999999, got 'random:x'"),
    (["ferm"], "did you mean 'fern'?"),
    (["bad.ifs"], "bad.ifs: "),
    (["fern", "--size", "8"], "size must be an integer of at least 16, got 8"),
    (["fern", "--shards", "0"], "shards must be an integer of at least 1, got 0"),
])
def test_what_a_user_can_mend_is_one_line_before_any_work(folder, words, message):
    for name in ("mixed", "empty"):
        (folder / name).mkdir()
    codes.known("fern").save("mixed/fern.json")
    (folder / "mixed" / "picture.png").write_bytes(b"")
    (folder / "bad.ifs").write_text("fern { 1 2 3 }")
    assert message in refusal(app, words[0], "set", *words[1:]) and not (folder / "set").exists()


@pytest.mark.parametrize(("change", "message"), [
    (["--size", "40"], "data set of other size (32 there, 40 here)"),
    (["--seed", "3"], "data set of other seed (0 there, 3 here)"),
    (["--shards", "50"], "data set of other shards (None there, 50 here)"),
])
def test_a_folder_with_a_set_of_other_options_is_left_alone(tmp_path, change, message):
    arguments = ["fern", str(tmp_path), *SMALL, "--jitter", "0"]
    app.main(arguments)
    before = contents(tmp_path)
    for words in ([*arguments, *change], ["tree", *arguments[1:]]):
        error = refusal(app, *words)
        assert (message if words[0] == "fern" else "data set of other codes;") in error
        assert "choose another folder" in error and contents(tmp_path) == before


def test_a_folder_with_other_files_is_left_alone(tmp_path):
    (tmp_path / "mine.txt").write_text("mine")
    assert "holds other files; choose a folder that is empty" in refusal(app, "fern", tmp_path, *SMALL)
    assert set(contents(tmp_path)) == {"mine.txt"}
