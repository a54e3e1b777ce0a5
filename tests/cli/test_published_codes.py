"""fractal-evaluate --published: files in the form of the authors' program, with codes of our own, are read as data and
judged beside the published row."""

import collections
import json
import pickle
import sys
import types

import numpy as np
import pandas as pd
import pytest
import torch
from commands import refusal
from PIL import Image
from torch import nn

from fractal_exp import IFS, InputError
from fractal_exp.cli import evaluate as app
from fractal_exp.cli.published_codes import gather
from fractal_exp.evaluation import evaluate
from fractal_exp.evaluation.summary import bootstrap_interval
from fractal_exp.ifs import attractor
from fractal_exp.methods.chaotic.released import QR
from fractal_exp.rendering.still import render
from fractal_exp.studies.published import TABLES
from fractal_exp.suite import random_suite

SMALL = ["--resolution", "64", "--points", "200000"]
RESULT = "output/best_optimized_ifs_code.pth"


class EasyDict(dict):
    """As the package easydict's: what is set is an item and an attribute."""

    __module__ = "easydict"

    def __setattr__(self, name, value):
        super().__setattr__(name, value)
        self[name] = value


class LipschtizLinear(nn.Module):
    """Holds what the program's holds: free entries, not parameters of torch."""

    __module__ = "system.blocks"

    def __init__(self, **values):
        super().__init__()
        self.device = torch.device("cpu")
        for name, value in values.items():
            setattr(self, name, value.clone().requires_grad_())


class ContractiveFunction(nn.Module):
    __module__ = "system.blocks"

    def __init__(self, **values):
        super().__init__()
        self.ll = LipschtizLinear(**values)


@pytest.fixture(autouse=True)
def program(monkeypatch):
    """The program's classes under the names by which it pickles them. They are gone while its files are read."""
    modules = {"easydict": [EasyDict], "system.blocks": [ContractiveFunction, LipschtizLinear]}

    def write(path, functions):
        code = EasyDict()
        code.contractive_functions, code.p = functions, torch.full((len(functions),), 1 / len(functions))
        path.parent.mkdir(parents=True, exist_ok=True)
        with monkeypatch.context() as during:
            during.setitem(sys.modules, "system", types.ModuleType("system"))
            for module, classes in modules.items():
                during.setitem(sys.modules, module, types.ModuleType(module))
                for each in classes:
                    setattr(sys.modules[module], each.__name__, each)
            torch.save(code, path)
    return write


def entries(seed, count=10):
    random = torch.Generator().manual_seed(seed)
    shapes = {"au": (2, 2), "av": (2, 2), "psigmas": (2,), "lbias": (2,)}
    return {name: torch.randn(count, *shape, generator=random) for name, shape in shapes.items()}


def functions(values):
    count = len(values["lbias"])
    return [ContractiveFunction(**{name: value[i] for name, value in values.items()}) for i in range(count)]


def decoded(raw):
    maps = QR().decode({"u": raw["au"], "singular": raw["psigmas"], "v": raw["av"], "offset": raw["lbias"]})
    return IFS(maps.linear, maps.offset)


def write_target(folder, name, code, picture=True):
    (folder / "ifs_codes").mkdir(parents=True, exist_ok=True)
    (folder / "ifs").mkdir(exist_ok=True)
    (folder / "ifs_codes" / f"{name}.json").write_text(json.dumps(
        {"ifs_m": code.linear.tolist(), "ifs_t": code.offset.tolist(), "ifs_p": [1 / len(code)] * len(code)}, indent=2))
    if picture:
        grey = render(attractor.normalize(code), resolution=64, points_in_view=200_000, seed=5)
        Image.fromarray((grey[..., None] * 255).byte().expand(64, 64, 3).numpy()).save(folder / "ifs" / f"{name}.png")


@pytest.fixture
def download(tmp_path, program, monkeypatch):
    """Three targets, the second without a picture, the third without an optimised code. Of the first, the code is the
    true one."""
    monkeypatch.chdir(tmp_path)
    data, zero, (one, two) = tmp_path / "there" / "full_dataset", decoded(entries(0)), random_suite(2)
    write_target(data, "fdb_0", zero)
    write_target(data, "fdb_1", one, picture=False)
    write_target(data, "fdb_11", two)
    program(tmp_path / "there" / "ours_cf" / "fdb_0" / RESULT, functions(entries(0)))
    program(tmp_path / "there" / "ours_cf" / "fdb_1" / RESULT, functions(entries(1)))
    return tmp_path / "there"


def test_codes_are_read_as_the_program_means_them_without_its_classes(download, program):
    found, alone = gather(download)
    assert [each.name for each in found] == ["fdb_0", "fdb_1"] and alone == ["fdb_11"]
    for seed, code in ((0, found[0].code), (0, found[0].aim.truth), (1, found[1].code)):
        expected = attractor.normalize(decoded(entries(seed)))
        torch.testing.assert_close(code.linear, expected.linear, rtol=1e-4, atol=1e-5)
        torch.testing.assert_close(code.offset, expected.offset, rtol=1e-4, atol=1e-4)
        assert code.probabilities is None, "drawn by |det| + 0.01, as the program's evaluation does"
    assert found[0].aim.file == "fdb_0.png" and found[0].aim.picture.shape == (64, 64)
    assert found[1].aim.picture is None
    assert "system.blocks" not in sys.modules, "the program's classes are not there"


def test_codes_may_lie_beside_each_other_in_a_folder_of_their_own_or_beside_other_methods(download, program):
    for seed, folder in enumerate(("ours_compiled", "there/moments"), 3):
        program(download.parent / folder / "fdb_11.pth", functions(entries(seed)))
    named, alone = gather(download, [str(download.parent / "ours_compiled")])
    assert [each.name for each in named] == ["fdb_11"] and len(alone) == 2
    assert [each.name for each in gather(download)[0]] == ["fdb_0", "fdb_1"], "ours goes by its name"
    other = download / "evolutionary"
    other.mkdir()
    (other / "fdb_1.json").write_text((download / "full_dataset" / "ifs_codes" / "fdb_1.json").read_text())
    [one], _ = gather(download, [str(other)])
    assert one.code == one.aim.truth


def test_the_means_stand_beside_the_published_row(download, capsys):
    app.main(["--published", str(download), "--out", "judged", *SMALL])
    judged = download.parent / "judged"
    per_view = pd.read_parquet(judged / "per_view.parquet")
    rows = per_view[(per_view.method == "result") & (per_view.fractal == "fdb_1")].reset_index(drop=True)
    second = gather(download)[0][1]
    direct = evaluate(second.code, second.aim.truth, resolution=64, points_in_view=200_000, views="released")
    np.testing.assert_allclose(rows.f1, direct.f1, rtol=1e-6)

    table = pd.read_csv(judged / "published.csv").set_index(["row", "metric"])
    assert [table.loc[("published", name), "mean"] for name in ("f1", "iou", "psnr", "ssim")] == [.691, .572, 8.91,
                                                                                                  .449]
    means = per_view[~per_view["empty"]].groupby(["method", "fractal"]).f1.mean()
    summary = pd.read_csv(judged / "summary.csv").query("method == 'result' and zoom_class == 'all'")
    f1 = summary.set_index("metric").loc["f1"]
    np.testing.assert_allclose(table.loc[("measured", "f1")], f1[["mean", "low", "high"]].astype(float))
    np.testing.assert_allclose(table.loc[("measured - published", "f1")].astype(float) + .691,
                               table.loc[("measured", "f1")].astype(float))
    for other in ("ceiling", "all white", "all black"):
        paired = (means["result"] - means[other]).to_numpy()
        np.testing.assert_allclose(table.loc[(f"measured - {other}", "f1")], [paired.mean(),
                                                                              *bootstrap_interval(paired)])
    assert ("measured", "lpips") not in table.index, "none was measured"

    inputs = pd.read_csv(judged / "inputs.csv").set_index("method")
    assert inputs.loc["result", "f1"] > .95 < inputs.loc["ceiling", "f1"], "our drawing is the authors' picture"
    assert sorted(path.name for path in (judged / "strips").iterdir()) == ["fdb_0-picture.png", "fdb_0.png",
                                                                          "fdb_1.png"]
    report = (judged / "report.txt").read_text()
    assert report in capsys.readouterr().out
    for words in ("views=released", "Table 3", "measured - published", "lack it: fdb_11"):
        assert words in report
    assert TABLES["comparisons"].rows["chaotic"][:4] == (.691, .572, 8.91, .449)


def test_a_pickle_that_would_run_something_is_refused(download, tmp_path):
    class Runs:
        def __reduce__(self):
            return (exec, (f"open({str(tmp_path / 'ran')!r}, 'w')",))

    path = download / "ours_cf" / "fdb_1" / RESULT
    torch.save({"contractive_functions": [Runs()]}, path)
    with pytest.raises(InputError, match=r"fdb_1/output/best_optimized_ifs_code\.pth: expected nothing but easydict\."
                                         r"EasyDict.* found (builtins|__builtin__)\.exec; nothing was loaded"):
        gather(download)
    path.write_bytes(pickle.dumps(Runs()))
    with pytest.raises(InputError, match="expected the authors' contractive_functions"):
        gather(download)
    assert not (tmp_path / "ran").exists()


@pytest.mark.parametrize(("content", "message"), [
    ({"other": 1}, r"expected the authors' contractive_functions.*KeyError"),
    (collections.OrderedDict(contractive_functions=[]), r"expected the authors' contractive_functions.*RuntimeError"),
])
def test_another_structure_is_named(download, content, message):
    torch.save(content, download / "ours_cf" / "fdb_1" / RESULT)
    with pytest.raises(InputError, match=message):
        gather(download)


def test_errors_say_what_was_expected_and_found(download, tmp_path, program):
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match="expected one folder ifs_codes .*; found nothing"):
        gather(tmp_path / "empty")
    with pytest.raises(InputError, match=r"expected optimised codes as .*fdb_0.pth.*; found nothing"):
        gather(download, [str(tmp_path / "empty")])
    with pytest.raises(InputError, match="one folder of optimised codes at most, got a, b"):
        gather(download, ["a", "b"])
    program(tmp_path / "odd" / "fdb_99.pth", functions(entries(9)))
    with pytest.raises(InputError, match="targets are fdb_0, fdb_1, fdb_11, the codes fdb_99"):
        gather(download, [str(tmp_path / "odd")])
    program(download / "ours_again" / "fdb_0.pth", functions(entries(9)))
    with pytest.raises(InputError, match=r"expected one folder .*found .*ours_again.*ours_cf.*before --published"):
        gather(download)
    (download / "full_dataset" / "ifs_codes" / "fdb_0.json").write_text('{"matrices": []}')
    with pytest.raises(InputError, match=r"fdb_0.json: expected the matrices ifs_m .* found matrices"):
        gather(download, [str(download / "ours_cf")])


@pytest.mark.parametrize(("arguments", "message"), [
    ([], "name what to judge"),
    (["--published", "there", "--views", "attractor"], "needs --views released"),
    (["--published", "there", "--truth", "suite"], "leave out --truth"),
])
def test_what_does_not_go_together_is_one_line(download, arguments, message):
    assert message in refusal(app, *arguments)
