"""The page of a code in MLflow's own artifact pane."""

import pytest
from dashboards import running_dashboard

from fractal_exp import codes, tracking
from fractal_exp.ifs import attractor
from fractal_exp.tracking import store


@pytest.mark.slow
def test_the_page_draws_in_the_artifact_pane(tmp_path, open_page):
    page = attractor.normalize(codes.known("fern")).save_html(tmp_path / "code.html")
    uri = tracking.prepare_store(tmp_path)
    with tracking.start_run(uri, "study", "fern", folder=tmp_path, tags={}, params={}, note="A fern.") as run:
        run.artifact("code.html", page)
    client = store.connect(uri)
    [known] = client.search_runs([client.get_experiment_by_name("study").experiment_id])
    opened = open_page((1400, 900))
    with running_dashboard(tmp_path) as (port, _):
        opened.page.goto(f"http://127.0.0.1:{port}/#/experiments/{known.info.experiment_id}/runs/{known.info.run_id}"
                         "/artifacts/code.html")
        pane = opened.page.wait_for_selector("iframe", timeout=60_000)
        opened.drawn(pane.content_frame())
        assert pane.get_attribute("sandbox") == "allow-scripts", "otherwise this is not the pane that was meant"
        assert pane.content_frame().url.startswith("blob:") and pane.content_frame().is_visible("canvas")


@pytest.mark.slow
def test_a_study_reached_by_clicking_leads_to_its_scores(tmp_path, open_page):
    uri = tracking.prepare_store(tmp_path)
    with tracking.start_run(uri, "leaves", "fern", folder=tmp_path, tags={}, params={}) as run:
        run.log({"eval/f1": .75, "eval/lpips": .25})
    opened = open_page((1600, 900))
    with running_dashboard(tmp_path) as (port, _):
        opened.page.goto(f"http://127.0.0.1:{port}/#/experiments")
        opened.page.click("a:has-text('leaves')", timeout=60_000)
        link = opened.page.wait_for_selector("a:has-text('All runs with their scores')", timeout=60_000)
        opened.page.goto(link.evaluate("link => link.href"))  # it opens in a new tab
        for name in ("f1", "lpips"):
            opened.page.wait_for_selector(f".ag-header-cell:has-text('eval/{name}')", timeout=60_000)
