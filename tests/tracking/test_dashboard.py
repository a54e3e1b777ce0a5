"""What the dashboard opens on, and what a run says of itself."""

import json
import urllib.request

import pytest
from dashboards import running_dashboard

from fractal_exp.cli.runs import _params
from fractal_exp.tracking import store


def test_an_experiment_describes_itself_and_default_is_gone(uri, start):
    with start():
        pass
    client = store.connect(uri)
    assert [experiment.name for experiment in client.search_experiments()].count("Default") == 0
    tags = client.get_experiment_by_name("study").tags
    address = f"(./#/experiments/{client.get_experiment_by_name('study').experiment_id}/runs?"
    assert tags["mlflow.note.content"].startswith(f"[All runs with their scores, best F1 first]{address}")
    view = json.loads(tags["mlflow.sharedViewState.scores"])
    assert view["orderByKey"] == "metrics.`eval/f1`" and view["selectedColumns"][0] == "metrics.`eval/f1`"
    assert {"metrics.`eval/lpips`", "metrics.`eval/fractal_distance`"} <= set(view["selectedColumns"])


@pytest.mark.slow
def test_the_dashboard_prints_where_the_newest_runs_are_once_it_answers(uri, start):
    with start():
        pass
    with running_dashboard(store.database_path(uri).parent) as (port, lines):
        identifier = store.connect(uri).get_experiment_by_name("study").experiment_id
        assert f"http://127.0.0.1:{port}/#/experiments/{identifier}/runs?" in lines[-2]
        assert urllib.request.urlopen(f"http://127.0.0.1:{port}/", timeout=60).status == 200
    with pytest.raises(OSError):
        urllib.request.urlopen(f"http://127.0.0.1:{port}/", timeout=5)


def test_params_are_those_of_the_method():
    common = {"target": {"name": "fern"}, "seed": 0, "scale": "smoke", "restarts": 5, "scouting": 100,
              "model": {"maps": 10}, "loss": {"mse": 1.0}, "optimizer": {"lr": 0.1}, "iterations": 6}
    collage = _params(common | {"method": {"_target_": "C", "restarts": 5, "finest": 256, "seed": 0}})
    assert collage == {"target": {"name": "fern"}, "seed": 0, "scale": "smoke", "restarts": 5,
                       "method": {"_target_": "C", "finest": 256}}
    chaotic = _params(common | {"method": {"_target_": "M", "model": {}, "objective": {}, "optimizer": {},
                                           "iterations": 6, "scouting": 100}})
    assert set(chaotic) == {"target", "seed", "scale", "scouting", "model", "loss", "optimizer", "iterations", "method"}
    assert chaotic["method"] == {"_target_": "M"}
