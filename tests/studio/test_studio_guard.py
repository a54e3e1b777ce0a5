"""Who the studio answers, and what it takes from whom."""

import asyncio
import json
from concurrent.futures import ThreadPoolExecutor

import pytest
from studio_helpers import TOKEN

from fractal_exp.studio import server


def test_the_page_and_all_that_it_loads_come_with_the_token_alone(studio):
    status, page = studio.ask("GET", f"/{TOKEN}/")
    assert status == 200 and b"Fractal studio" in page and b"$panel" not in page and b'id="number-a"' in page
    for name in ("studio.mjs", "stage.mjs", "channel.mjs", "editor.mjs", "page.css", "studio.css"):
        assert studio.ask("GET", f"/{TOKEN}/static/{name}")[0] == 200
    for path in ("/", "/wrong/", f"/{TOKEN}x/", "/wrong/static/studio.mjs", "/wrong/target.png", f"//{TOKEN}/"):
        status, text = studio.ask("GET", path)
        assert status == 403 and b"fractal-studio printed" in text


@pytest.mark.parametrize("name", ["../server.py", "..%2fserver.py", "studio.html", "%2e%2e/page.py", "nothing.mjs"])
def test_no_other_file_is_given_away(studio, name):
    assert studio.ask("GET", f"/{TOKEN}/static/{name}")[0] == 404


@pytest.mark.parametrize(("headers", "message"), [
    ({"Origin": "http://evil.example"}, b"another page"), ({"Origin": "null"}, b"another page"),
    ({"Origin": "http://127.0.0.1:1"}, b"another page"), ({"Host": "evil.example"}, b"its own address"),
    ({"Host": "127.0.0.1"}, b"its own address"), ({"Host": "evil.example", "Origin": "http://evil.example"}, b"own"),
])
def test_other_origins_and_hosts_are_refused(studio, headers, message):
    from websockets.exceptions import InvalidStatus

    for method, path in (("GET", f"/{TOKEN}/"), ("POST", f"/{TOKEN}/picture")):
        status, text = studio.ask(method, path, **headers)
        assert status == 403 and message in text
    if "Host" not in headers:
        with pytest.raises(InvalidStatus, match="403"), studio.tab(**headers):
            pass


def test_a_line_needs_the_token_and_an_origin(studio):
    from websockets.exceptions import InvalidStatus
    from websockets.sync.client import connect

    with pytest.raises(InvalidStatus, match="403"), studio.tab(token="wrong"):
        pass
    with pytest.raises(InvalidStatus, match="403"), connect(f"ws://{studio.host}/{TOKEN}/live"):
        pass
    assert studio.ask("POST", f"/{TOKEN}/picture", Origin="")[0] == 403


def test_an_upload_that_is_too_large_is_refused_before_it_is_read(studio, monkeypatch):
    status, text = studio.ask("POST", f"/{TOKEN}/picture", Content_Length=str(2**40))
    assert status == 413 and "64 MiB at most" in json.loads(text)["why"]
    monkeypatch.setattr("fractal_exp.studio.server.LARGEST_UPLOAD", 1000)
    chunk = b"%x\r\n%s\r\n" % (600, bytes(600))
    status, text = studio.ask("POST", f"/{TOKEN}/picture", 2 * chunk + b"0\r\n\r\n", Transfer_Encoding="chunked",
                              Content_Length="")
    assert status == 413


def test_the_page_may_load_nothing_from_elsewhere(studio):
    import http.client

    line = http.client.HTTPConnection("127.0.0.1", studio.port)
    line.request("GET", f"/{TOKEN}/")
    headers = line.getresponse().headers
    assert "default-src 'none'" in headers["content-security-policy"] and headers["referrer-policy"] == "no-referrer"
    assert "frame-ancestors 'none'" in headers["content-security-policy"] and headers["cache-control"] == "no-store"


def test_a_defect_of_the_studio_is_not_blamed_on_the_page():
    class Session:
        def stop(self):
            raise TypeError("a slip of ours")

    def answered(message):
        # In a thread: where a test in Chromium ran before, Playwright's loop is still running in this one.
        with ThreadPoolExecutor(1) as thread:
            return thread.submit(asyncio.run, server._done(Session(), message)).result()

    assert "the studio has a defect (TypeError: a slip of ours)" in answered('{"do": "stop"}')
    assert "load it again" in answered("{")
