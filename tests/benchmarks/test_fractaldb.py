"""The codes of FractalDB-1k: how they are read, and that every truth lies where its picture is."""


import numpy as np
import pytest

from benchmarks.pictures import __main__ as command
from benchmarks.pictures import fractaldb, judging, tables
from benchmarks.pictures.sets import SETS
from fractal_exp import InputError
from fractal_exp.images.reading import read_target

KINDS = "fractaldb_grey", "fractaldb_dots"
TABLES = {  # a b c d e f p: one whose maps all contract, one with a stretching map, and one that does on average only
    "00007": [[0.5, 0.2, -0.1, 0.5, 0.5, 0.1, 0.5], [0.4, -0.3, 0.3, 0.4, -0.6, 0.2, 0.25],
              [0.3, 0.1, 0, 0.6, 0.2, -0.8, 0.25]],
    "00010": [[0.5, 1.2, 0, 0.5, 0.5, 0.1, 0.5], [0.4, 0, 0.1, 0.4, -0.6, 0.2, 0.5]],
    "00013": [[1.01, 0, 0, 0.3, 0.1, 0.2, 0.1], [0.7, 0.2, -0.2, 0.7, 0.4, 0.1, 0.5],
              [0.6, -0.3, 0.3, 0.6, -0.6, 0.2, 0.4]]}


@pytest.fixture
def made(tmp_path, monkeypatch):
    """A file of three codes, named by the environment."""
    rows = np.full((3, 4, 7), np.nan)
    for each, table in zip(rows, TABLES.values(), strict=True):
        each[:len(table)] = table
    np.savez(tmp_path / "codes.npz", rows=rows, name=[*TABLES])
    monkeypatch.setenv(fractaldb.VARIABLE, str(tmp_path / "codes.npz"))
    fractaldb._dotted.cache_clear()
    yield tmp_path / "codes.npz"
    fractaldb._dotted.cache_clear()


def test_folder_and_file_hold_the_same_codes_and_odd_numbers_are_for_reporting(made, tmp_path):
    (tmp_path / "csv0").mkdir()
    for name, table in TABLES.items():
        np.savetxt(tmp_path / "csv0" / f"{name}.csv", table, delimiter=",")
    assert fractaldb.load(tmp_path) == fractaldb.codes() and len(fractaldb.codes()["00010"]) == 2
    assert fractaldb.codes()["00010"].linear[0].tolist() == [[0.5, pytest.approx(1.2)], [0, 0.5]]
    assert fractaldb.roles() == {"00007": "reporting", "00010": "tuning", "00013": "reporting"}
    assert [code.contraction.kind for code in fractaldb.codes().values()] == ["norm", "norm", "average"]


@pytest.mark.parametrize("name", TABLES)
@pytest.mark.parametrize("kind", KINDS)
def test_the_true_code_lies_on_its_picture(made, kind, name):
    set_ = SETS[kind]
    read = read_target(set_.picture(name), 256, **set_.options)
    truth = set_.truth(name, read)
    scores = set_.score(name, truth, read)
    assert scores["exact"] and scores["f1_truth"] == 1 and scores["density_sse"] < 2 * scores["floor_sse"]
    image = read.image.numpy()
    lit = image > 0
    drawn, beside = (judging.thickened(set_.shown(truth.similar(1, (shift, 0.0)), image)[1] > 0)
                     for shift in (0, 8 / 256))
    assert (lit & drawn).sum() > 0.965 * lit.sum() and drawn.sum() < 1.05 * judging.thickened(lit).sum()
    assert (lit & beside).sum() < (lit & drawn).sum() - 0.015 * lit.sum()
    wrong = set_.score(name, truth.similar(0.9, (0.0, 0.0)), read)
    assert not wrong["recovered"] and wrong["density_sse"] > 5 * wrong["floor_sse"]


def test_dots_fill_the_picture_up_to_the_margin(made):
    image = fractaldb.dots("00007")
    rows, columns = np.nonzero(image)
    assert image.shape == (362, 362) and set(np.unique(image)) == {0, 127}
    assert {rows.min(), columns.min()} <= {5, 6} and (rows.max(), columns.max()) == (355, 356)


def test_tables_tell_codes_by_how_their_maps_contract(made):
    set_ = SETS["fractaldb_grey"]
    fits = []
    for name in TABLES:
        read = read_target(set_.picture(name), 256, **set_.options)
        fits.append({"maps": 3, "core_seconds": 1.0, **set_.score(name, set_.truth(name, read), read)})
    table = set_.tables(tables.pd.DataFrame(fits))["By contraction"]
    assert dict(zip(table["maps that contract"], table["n"], strict=True)) == {
        "every map, in every direction": 1, "in a norm, but a map stretches": 1, "on average only": 1}


def test_without_the_codes_the_set_says_what_to_set(monkeypatch, tmp_path):
    monkeypatch.delenv(fractaldb.VARIABLE, raising=False)
    with pytest.raises(SystemExit, match=f"--fractaldb or {fractaldb.VARIABLE}"):
        command.main(["fractaldb_dots", "--report"])
    (tmp_path / "notes.csv").write_text("a word\n")
    (tmp_path / "empty").mkdir()
    for path, message in (tmp_path, "a word"), (tmp_path / "empty", "no file ends in .csv"), (
            tmp_path / "none.npz", "No such file"):
        with pytest.raises(InputError, match=f"holds no codes of FractalDB: .*{message}.*csv_rate0.2_category1000"):
            fractaldb.load(path)
