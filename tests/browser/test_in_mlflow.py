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
