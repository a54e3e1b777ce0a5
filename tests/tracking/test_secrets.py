"""No password and no token of a server's address comes to lie in a file, a run or what is printed."""

import http.server
import json
import threading

import pytest
from commands import run_here

from fractal_exp import tracking
from fractal_exp.cli import composed as train
from fractal_exp.cli.folders import FitFolder
from fractal_exp.tracking import store
from fractal_exp.tracking.addresses import shown

PASSWORD, TOKEN = "pa55-phrase", "t0ken-word"
TRAIN = ["scale=smoke", "resolution=32", "iterations=6", "checkpoint_every=2", "anneal_every=3", "threads=1",
         "name=fit", "target=known", "target.name=sierpinski_triangle", "evaluation.points_in_view=20000"]


@pytest.mark.parametrize("text", [
    f"http://me:{PASSWORD}@127.0.0.1:9/?token={TOKEN}", f"refused (https://me:{PASSWORD}@host/a?b={TOKEN}&c=d)",
    f"HTTPConnectionPool(host='h', port=9): Max retries exceeded with url: /?token={TOKEN}/api (Caused by",
    f"http://me:{PASSWORD}@ss@host/",
])
def test_addresses_are_shown_without_secrets(text):
    assert PASSWORD not in shown(text) and TOKEN not in shown(text)


def test_the_folder_of_a_fit_knows_its_server_without_the_password(tmp_path):
    folder = FitFolder.open(tmp_path, "fit")
    folder.remember_run(f"http://me:{PASSWORD}@host:5000", "0123")
    assert PASSWORD not in (tmp_path / "fit" / "run.json").read_text()
    assert folder.run_to_resume(f"http://me:{PASSWORD}@host:5000") is None, "there is nothing to go on from"
    folder.checkpoint.write_bytes(b"")
    assert folder.run_to_resume("http://me:changed@host:5000") == "0123"
    assert folder.run_to_resume("http://me:changed@other:5000") is None
    (tmp_path / "fit" / "run.json").write_text(json.dumps({"uri": f"http://me:{PASSWORD}@host:5000", "run_id": "45"}))
    assert folder.run_to_resume("http://host:5000") == "45", "of an earlier version"


class Fickle(http.server.BaseHTTPRequestHandler):
    """A server that answers a search, as the first question, and then breaks every connection or refuses."""

    asked = 0

    def answer(self) -> None:
        type(self).asked += 1
        if self.asked > 2:
            self.send_error(403, "you may not")
            return
        self.send_response(200)
        self.end_headers()
        self.wfile.write(b"{}")

    do_GET = do_POST = answer

    def log_message(self, *args) -> None: ...


def test_nothing_that_is_written_or_printed_holds_a_secret(tmp_path, capfd, caplog, recwarn):
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Fickle)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    for port in (server.server_port, 9):  # one that answers and refuses, one that nobody serves
        uri = f"http://me:{PASSWORD}@127.0.0.1:{port}/?token={TOKEN}"
        status, printed = run_here(train, *TRAIN, f"output={tmp_path}", server=uri)
        assert status != 0 and "sierpinski_triangle" in printed
        written = [path for path in tmp_path.rglob("*") if path.is_file()]
        said = printed, *capfd.readouterr(), caplog.text, *(str(each.message) for each in recwarn)  # pytest kept these
        for text in (*said, *(path.read_bytes().decode(errors="replace") for path in written)):
            assert PASSWORD not in text and TOKEN not in text, text
    server.shutdown()


def test_a_run_and_what_is_undelivered_hold_no_secret(uri, start):
    secret = f"http://me:{PASSWORD}@host/?token={TOKEN}"
    with pytest.raises(ConnectionError), start(note=f"by {secret}") as run:
        run.log({"eval/f1": 0.5})
        raise ConnectionError(f"cannot reach {secret}")
    data = store.connect(uri).get_run(run.run_id).data
    assert "f1 0.500" in data.tags["mlflow.note.content"]
    for text in (str(data.tags), tracking.read_artifact(uri, run.run_id, "traceback.txt").decode()):
        assert PASSWORD not in text and TOKEN not in text, text
