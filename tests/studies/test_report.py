"""Tables from tracked runs: known numbers in, known tables out."""

import json

import numpy as np
import pandas as pd
import pytest
from commands import refusal
from mlflow import MlflowClient
from places import ROOT
from studies_helpers import keep_sweep

from benchmarks import comparisons
from fractal_exp import InputError, tracking
from fractal_exp.cli import report as app
from fractal_exp.studies import course, report, report_text
from fractal_exp.studies.published import TABLES

F1 = {"full": [.6, .8, .7], "naive": [.5, .9, None], "no_ssim": [.6, .8, .7]}  # by fractal; None: that job failed


@pytest.fixture(scope="module")
def output(tmp_path_factory):
    """A store with a sweep of three rows on three fractals, one job failed and one never begun, and an older sweep."""
    folder = tmp_path_factory.mktemp("store")
    uri = tracking.prepare_store(folder)
    log(uri, folder, "smoke-old", {"full": [.1]}, None)
    log(uri, folder, "smoke-new", F1, "ablations")
    return folder


def log(uri, folder, name, scores, published, perceptual="none"):
    def fit(job, number, row):
        if (value := scores[row][int(number)]) is None:
            job.finish("FAILED", ValueError("of 100% & more_"))
            return
        job.log({"eval/f1": value, "eval/psnr": 10 * value, "train/loss": 1.0, "time/fit_seconds": 2.0 + int(number),
                 "trivial/white_f1": .4, "trivial/black_f1": .1})
        if perceptual == "fractal":
            job.log({"eval/fractal_distance": 1 - value})
        job.image("result", np.full((8, 8), value, np.float32))
        job.image("zoomed", np.zeros((8, 8), np.float32))
        job.finish()

    jobs = [f"{i},{row}" for i in range(len(scores["full"])) for row in scores]
    keep_sweep(uri, folder, name, jobs, fit, baseline="full", published=published, planned=("9,full",),
               perceptual=perceptual)


@pytest.fixture(scope="module")
def sweep(output):
    return report.read_sweep(f"sqlite:///{output / 'mlflow.db'}", "study")


def test_a_sweep_is_read_in_the_order_of_its_plan_with_what_never_began(sweep):
    assert sweep.name == "smoke-new" and sweep.metrics == ["f1", "psnr"]
    assert list(sweep.jobs["job"][:4]) == ["0,full", "0,naive", "0,no_ssim", "1,full"]
    assert sweep.jobs["status"].value_counts().to_dict() == {"FINISHED": 8, "FAILED": 1, "ABSENT": 1}
    assert report_text.failures(sweep) == ["2,naive: failed: ValueError: of 100% & more_", "9,full: absent"]


def test_means_spread_wins_and_time_are_those_of_the_jobs(sweep):
    table = report.summary(sweep).set_index("row")
    measured = table[table["source"] == "measured"]
    assert list(measured.index) == ["full", "naive", "no_ssim"]
    full, naive = measured.loc["full"], measured.loc["naive"]
    assert full["f1"] == pytest.approx(.7) and full["psnr"] == pytest.approx(7) and full["f1_std"] == pytest.approx(.1)
    assert .599 < full["f1_low"] < .7 < full["f1_high"] < .801
    assert full["seconds"] == pytest.approx(3) and naive["seconds"] == pytest.approx(2.5)
    assert (naive["finished"], naive["failed"], naive["unfinished"]) == (2, 1, 0)
    assert (naive["wins"], naive["compared"]) == (1, 2), "on the fractals that both have"
    assert (measured.loc["no_ssim"]["wins"], measured.loc["no_ssim"]["compared"]) == (0, 3), "a tie is no win"
    assert np.isnan(full["wins"]) and np.isnan(full["gain"])
    assert naive["gain"] == pytest.approx(0) and naive["gain_low"] == pytest.approx(-.1), "-.1 and .1, paired"
    assert measured.loc["no_ssim"][["gain", "gain_low", "gain_high"]].tolist() == [0, 0, 0]
    assert report.same_rows(sweep) == [["full", "no_ssim"]]


def test_trivial_and_published_rows_stand_apart_and_are_the_papers(sweep):
    table = report.summary(sweep)
    trivial = table[table["source"] == "trivial"].set_index("row")
    assert trivial.loc["all white", "f1"] == pytest.approx(.4) and trivial.loc["all black", "f1"] == pytest.approx(.1)
    published = table[table["source"] == "published"].set_index("row")
    assert list(published.index) == list(TABLES["ablations"].rows)
    assert published.loc["no_mip", ["f1", "iou", "psnr", "ssim", "lpips"]].tolist() == [.363, .286, 9.08, .525, .512]
    assert published["finished"].isna().all() and published["f1_low"].isna().all()


def test_the_released_method_stands_for_the_published_one():
    def order(scores):
        return report.agreement(pd.DataFrame(
            [{"row": row, "source": "measured", "f1": f1} for row, f1 in scores.items()]
            + [{"row": row, "source": "published", "f1": f1}
               for row, f1 in {"cuckoo": .1, "evolutionary": .2, "chaotic": .3}.items()]))

    searches = {"cuckoo": .2, "evolutionary": .4}
    assert order({**searches, "chaotic_released": .5, "chaotic_written": .1})[::2] == (pytest.approx(1), 3)
    assert order({**searches, "chaotic_released": .3, "chaotic": .5})[0] == pytest.approx(1 / 3)


def test_the_order_of_rows_is_held_against_the_published_one():
    def table(scores):
        return pd.DataFrame([{"row": row, "source": "measured", "f1": f1} for row, f1 in scores.items()]
                            + [{"row": row, "source": "published", "f1": values[0]}
                               for row, values in TABLES["ablations"].rows.items()])

    same = {"no_mip": .1, "no_gradients": .2, "naive": .3, "full": .4, "ours alone": .5}
    assert report.agreement(table(same))[::2] == (pytest.approx(1), 4), "rows of one table alone do not count"
    assert report.agreement(table({**same, "full": .2, "no_gradients": .4}))[0] == pytest.approx(0)
    released = {name if name == "as_released" else f"as_released+{name}": f1 for name, f1 in {
        "no_mip": .1, "no_gradients": .2, "naive": .3, "as_released": .4}.items()}
    assert report.agreement(table(released), "as_released")[::2] == (pytest.approx(1), 4)
    assert np.isnan(report.agreement(table({"full": .4, "naive": .3}))[0])
    assert np.isnan(report.agreement(pd.DataFrame([{"row": "full", "source": "measured"}]))[0]), "no job has a score"
    [said] = report_text.order_of_rows(table(same))
    assert said.startswith("Order of these 4 rows by F1, against the published order: Kendall's tau 1.00")


def test_a_difference_that_excludes_zero_is_bold(sweep):
    table = report.summary(sweep)
    table.loc[table["row"] == "naive", ["gain", "gain_low", "gain_high"]] = -.1, -.15, -.05
    lines = report_text.markdown(sweep, table).partition("Published")[0].splitlines()
    rows = {line.split("|")[1].strip(): line for line in lines if "|" in line}
    assert "**-0.100 [-0.150, -0.050]**" in rows["naive"] and "**" not in rows["no_ssim"]
    assert r"\textbf{-0.100 [-0.150, -0.050]}" in report_text.latex(sweep, table)


def test_the_distance_fractal_has_a_column_beside_the_published_lpips(tmp_path):
    uri = tracking.prepare_store(tmp_path)
    log(uri, tmp_path, "smoke-fractal", F1, "ablations", "fractal")
    sweep = report.read_sweep(uri, "study")
    assert sweep.metrics == ["f1", "psnr", "fractal_distance"]
    table = report.summary(sweep)
    measured, published = (table[table["source"] == source].set_index("row") for source in ("measured", "published"))
    assert measured.loc["full", "fractal_distance"] == pytest.approx(.3) and measured["lpips"].isna().all()
    assert .199 < measured.loc["full", "fractal_distance_low"] < measured.loc["full", "fractal_distance_high"] < .401
    assert published["fractal_distance"].isna().all() and published["lpips"].notna().all()
    text = report_text.markdown(sweep, table)
    ours, papers = (line for line in text.splitlines() if line.startswith("|") and "F1 " in line and "PSNR" in line)
    assert "fractal_distance" in ours and "LPIPS" not in ours
    assert "LPIPS" in papers and "fractal_distance" not in papers
    assert "fractal_distance is no LPIPS, lower is better" in text and "LPIPS with the backbone" not in text
    latex = report_text.latex(sweep, table)
    head = next(line for line in latex.splitlines() if "F1" in line and " & " in line).removesuffix(r" \\").split(" & ")
    assert "LPIPS" in head and r"fractal\_distance" in head


def test_the_texts_say_what_was_measured_and_what_was_not(sweep):
    table = report.summary(sweep)
    text = report_text.markdown(sweep, table)
    rows = {line.split("|")[1].strip(): line for line in text.splitlines() if line.startswith("| ")}
    assert "Measured at smoke scale on 3 samples" in text and "Published, not measured here" in text
    assert "frame" not in text
    assert "0.700 [0.6" in text and "2, 1 failed" in text and "1/2" in text and "full, no_ssim" in text
    assert rows["no_mip"].count("0.363") == 1
    latex = report_text.latex(sweep, table)
    assert latex.count(r"\begin{tabular}") == latex.count(r"\end{tabular}") == 1
    body = [line for line in latex.splitlines() if line.endswith(r"\\") and "multicolumn" not in line]
    assert len({line.count(" & ") for line in body}) == 1, "as many cells in every row"
    assert "no\\_mip" in latex and "no_mip" not in latex


def test_the_command_writes_all_files_and_finds_other_sweeps(output, tmp_path, capsys):
    app.main(["study", "--output", str(output), "--out", str(tmp_path)])
    assert "| naive" in capsys.readouterr().out
    assert {path.name for path in tmp_path.iterdir()} == {
        "report.md", "report.tex", "report.csv", "report.png", "jobs.csv", "spread.csv"}
    assert len(pd.read_csv(tmp_path / "jobs.csv")) == 10
    app.main(["study", "--output", str(output), "--sweep", "smoke-old"])
    assert "on 1 sample, mean over views:" in (output / "study" / "smoke-old" / "report.md").read_text()


@pytest.mark.parametrize(("words", "message"), [
    (["nothing"], "has no study 'nothing'"),
    (["study", "--sweep", "smoke-3"], "the study 'study' has no sweep 'smoke-3', and only sweeps have a table"),
    (["study", "--output", "/nowhere"], "no runs are kept in /nowhere; fit something first"),
])
def test_what_is_not_there_is_said(output, words, message):
    assert message in refusal(app, "--output", output, *words)


def test_a_study_of_fits_points_to_the_studies_with_a_table_and_to_the_dashboard(output):
    with tracking.start_run(tracking.prepare_store(output), "fits", "fit", folder=output / "fits"):
        pass
    error = refusal(app, "--output", output, "fits")
    assert "studies with a sweep here: study" in error and "fractal-sweep fits" not in error
    assert f"python -m fractal_exp.tracking dashboard {output} shows the fits" in error


def test_a_report_says_on_which_views_and_how_many_were_empty(tmp_path):
    uri = tracking.prepare_store(tmp_path)

    def fit(run, number, row):
        with run:
            run.log({"eval/f1": 0.5, "views/empty": 2 - int(number), "views/judged": 5 + int(number)})

    for kind, note in (("uniform", True), ("released", False)):
        keep_sweep(uri, tmp_path, kind, ["0,full", "1,full"], fit, "views", published="ablations", views=kind)
        read = report.read_sweep(uri, "views", kind)
        text = report_text.markdown(read, report.summary(read))
        assert read.metrics == ["f1"] and f"views={kind}" in text
        assert "3 of 14 views are empty in truth and result and are left out" in text
        assert ("only rows with views=released may be compared" in text) == note


ABOUT = {"title": "A study", "baseline": None, "published": None}


@pytest.mark.parametrize(("name", "content"), [
    ("sweep.json", "{"), ("sweep.json", "[]"), ("sweep.json", "{}"), ("sweep.json", json.dumps({**ABOUT, "title": 1})),
    ("sweep.json", json.dumps({**ABOUT, "published": "no such table"})),
    ("jobs.json", "["), ("jobs.json", "{}"), ("jobs.json", "[1]")])
def test_a_damaged_sweep_is_said_in_one_line(name, content, tmp_path):
    uri = tracking.prepare_store(tmp_path)
    keep_sweep(uri, tmp_path, "s", [], lambda *_: None)
    [kept] = tmp_path.glob(f"mlartifacts/**/{name}")
    kept.write_text(content)
    with pytest.raises(InputError, match=rf"the artifact {name} of the run \w+ .*; the same fractal-sweep") as error:
        report.read_sweep(uri, "study")
    assert "\n" not in str(error.value)


def test_the_mean_course_begins_where_all_have_a_code_and_keeps_the_last_one():
    part = pd.DataFrame([("a", 1.0, .2), ("a", 4.0, .6), ("b", 2.0, .4), ("b", 16.0, .8)],
                        columns=["sample", "seconds", "f1"])
    moments, f1 = course.mean_course(part)
    at = dict(zip(moments, f1, strict=True))
    assert (moments[0], moments[-1]) == (2, 16) and at[2.0] == pytest.approx(.3) and at[16.0] == pytest.approx(.7)
    assert {round(float(value), 3) for value in f1} == {.3, .5, .7}


def test_quality_over_time_is_read_from_the_jobs_and_drawn(tmp_path):
    from PIL import Image

    uri = tracking.prepare_store(tmp_path)
    log(uri, tmp_path, "smoke-course", {"full": [.6]}, None)
    sweep = report.read_sweep(uri, "study")
    assert not len(course.read_courses(uri, sweep)), "this one keeps none"
    points = [{"seconds": 1.0, "step": 4, "f1": .5}, {"seconds": 3.0, "step": 8, "f1": .6}]
    [job] = sweep.jobs.loc[sweep.jobs["status"] == "FINISHED", "run_id"]
    MlflowClient(uri).log_text(job, json.dumps(points), "course.json")
    courses = course.read_courses(uri, sweep)
    assert courses.to_dict("list") == {"row": ["full"] * 2, "sample": ["fractal 0"] * 2, "seconds": [1, 3],
                                       "f1": [.5, .6], "step": [4, 8]}
    (tmp_path / "course.png").write_bytes(course.drawn(sweep, courses))
    assert Image.open(tmp_path / "course.png").size == (960, 600)
    MlflowClient(uri).log_text(job, json.dumps({"seconds": 1.0}), "course.json")
    with pytest.raises(InputError, match=r"course.json of the run \w+ is damaged"):
        course.read_courses(uri, sweep)


def test_a_sweep_is_kept_fit_by_fit(tmp_path):
    uri = tracking.prepare_store(tmp_path)
    log(uri, tmp_path, "smoke-kept", {"full": [.6, .8]}, None)
    sweep = report.read_sweep(uri, "study")
    first, client = sweep.jobs["run_id"][0], MlflowClient(uri)
    for name, value in {"code.json": {"linear": []}, "inversion.json": {"meta": {"inversion": {"stopped": "done"}}},
                        "course.json": [{"seconds": 1.0, "f1": .5}]}.items():
        client.log_text(first, json.dumps(value), name)
    client.log_param(first, "method.seconds", "90.0")
    client.log_param(first, "target.seed", "2025")
    one, other = comparisons.kept(uri, sweep)
    assert (one["row"], one["sample"], one["limit"], one["suite"]) == ("full", "fractal 0", 90, 2025)
    assert one["scores"] == {"f1": .6, "psnr": 6.0, "white/f1": .4, "black/f1": .1} and one["course"] == [[1, .5]]
    assert one["code"] == {"linear": []} and one["stopped"] == "done"
    assert (other["code"], other["limit"], other["stopped"], other["course"]) == (None, None, None, [])
    with pytest.raises(InputError, match="2 finished jobs of 3; the same fractal-sweep study command again goes on"):
        comparisons.keep(tmp_path, "study", None, tmp_path / "kept")
    assert not (tmp_path / "kept").exists(), "an unfinished sweep takes no finished one's place"
    comparisons.keep(tmp_path, "study", None, tmp_path / "kept", so_far=True)
    assert len((tmp_path / "kept" / "fits.jsonl").read_text().splitlines()) == 2
    text = (tmp_path / "kept" / "report.md").read_text()
    assert "on 2 samples" in text and "2 of the 3 fits of the sweep so far." in text
    path = tmp_path / "kept" / "fits.jsonl"
    path.write_text(path.read_text().replace("fractal 0", "fractal 7").replace("fractal 1", "fractal 8"))
    comparisons.keep(tmp_path, "study", None, tmp_path / "kept", so_far=True, add=True)
    text = (tmp_path / "kept" / "report.md").read_text()
    assert "on 4 samples" in text and "2 of the 3 fits of the sweep so far, and 2 of others." in text


def test_fits_of_another_day_join_those_that_are_kept(tmp_path, sweep):
    def record(row, sample, f1, resolution=256):
        return {"row": row, "sample": sample, "scale": "smoke", "suite": 2025, "resolution": resolution, "limit": None,
                "seconds": 9.0, "images": None, "scores": {"f1": f1}}

    path = tmp_path / "fits.jsonl"
    kept = [record("full", "fractal 0", .1), record("full", "fractal 5", .9), record("naive", "fractal 5", .5)]
    path.write_text("".join(json.dumps(each) + "\n" for each in kept))
    records, both = comparisons.joined(path, [record("full", "fractal 0", .6)], sweep)
    assert [(each["row"], each["sample"], each["scores"]["f1"]) for each in records] == [
        ("full", "fractal 5", .9), ("naive", "fractal 5", .5), ("full", "fractal 0", .6)]
    table = report.summary(both)
    table = table[table["source"] == report.MEASURED].set_index("row")
    assert table.loc["full", "f1"] == pytest.approx((.6 + .8 + .7 + .9) / 4)
    assert table.loc["naive", "compared"] == 3 and table.loc["naive", "gain"] == pytest.approx((-.1 + .1 - .4) / 3)
    with pytest.raises(InputError, match="leave out --add"):
        comparisons.joined(tmp_path / "none.jsonl", [], sweep)
    with pytest.raises(InputError, match="keep it in another --folder"):
        comparisons.joined(path, [record("full", "fractal 0", .6, resolution=1024)], sweep)


# Table 2, by component and GPU: milliseconds of an iteration at 1024² with 480 000 points, and seconds of a view of 50
# million points. An iteration of the A40, 15 000 times, is the time of Table 3.
ITERATION_MS = {
    "A40": {"generation": 99.5, "rendering": 1.2, "annealing": 2.0, "backward": 116.6},
    "RTX 3090": {"generation": 158.9, "rendering": 1.4, "annealing": 2.7, "backward": 128.2},
}
VIEW_SECONDS = {"A40": {"generation": 4.7, "rendering": 0.1}, "RTX 3090": {"generation": 5.2, "rendering": 0.1}}


def test_an_iteration_of_table_2_is_the_time_of_table_3_and_what_the_page_says():
    a40, rtx = (sum(ITERATION_MS[gpu].values()) for gpu in ("A40", "RTX 3090"))
    assert 15_000 * a40 / 1000 == pytest.approx(TABLES["comparisons"].seconds["chaotic"], rel=.01)
    page = (ROOT / "docs" / "deviations.md").read_text()
    assert f"{a40:.0f} ms an iteration on an A40, {rtx:.0f} on an RTX 3090" in page
    a40, rtx = (sum(VIEW_SECONDS[gpu].values()) for gpu in ("A40", "RTX 3090"))
    assert f"{a40:.1f} s a view on an A40, {rtx:.1f} s on an RTX 3090" in page
