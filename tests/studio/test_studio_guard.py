"""Who the studio answers, and what it takes from whom."""

import asyncio
import http.client
import json
import re
import signal
import socket
import struct
import time
from concurrent.futures import ThreadPoolExecutor

import pytest
from studio_helpers import START, TOKEN, InThread, served

from fractal_exp.studio import server


@pytest.fixture(scope="module")
def studio(tmp_path_factory):
    """Without a process that searches."""
    pytest.importorskip("websockets", reason="the studio needs `pip install 'fractal-exp[studio]'`")
    with served(tmp_path_factory.mktemp("output"), worker=InThread) as studio:
        yield studio


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


def test_an_upload_that_is_too_large_is_refused_before_it_is_read(studio):
    status, text = studio.ask("POST", f"/{TOKEN}/picture", Content_Length=str(2**40))
    assert status == 413 and "64 MiB at most" in json.loads(text)["why"]
    half = server.LARGEST_UPLOAD // 2 + 1
    chunk = b"%x\r\n%s\r\n" % (half, bytes(half))
    status, text = studio.ask("POST", f"/{TOKEN}/picture", 2 * chunk + b"0\r\n\r\n", Transfer_Encoding="chunked",
                              Content_Length="")
    assert status == 413


def test_the_page_may_load_nothing_from_elsewhere(studio):
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


def raw(studio, text: bytes) -> bytes:
    """The first line of the answer to bytes that no browser would send; empty if there is none."""
    with socket.create_connection(("127.0.0.1", studio.port), timeout=60) as line:
        line.sendall(text)
        return line.recv(4096).split(b"\r\n")[0]


def test_a_browser_is_started_with_an_address_that_works_once(studio):
    for path in (f"/{START}/", f"/{START}x", f"/{START}/static/studio.mjs"):
        assert studio.ask("GET", path)[0] == 403
    assert studio.ask("GET", f"/{START}", Host="evil.example")[0] == 403
    assert studio.ask("POST", f"/{START}")[0] == 403
    line = http.client.HTTPConnection("127.0.0.1", studio.port)
    line.request("GET", f"/{START}")
    answer = line.getresponse()
    assert (answer.status, answer.headers["location"]) == (303, f"/{TOKEN}/")
    assert answer.headers["referrer-policy"] == "no-referrer"
    status, text = studio.ask("GET", f"/{START}")
    assert status == 403 and b"was used already" in text


def test_the_browser_never_has_the_token_among_its_arguments(tmp_path, monkeypatch, capsys):
    from fractal_exp.cli import studio
    from fractal_exp.studio import serving

    opened = []

    def opens_and_ends(address):
        opened.append(address)
        raise KeyboardInterrupt

    monkeypatch.setattr("webbrowser.open", opens_and_ends)
    hangup = signal.getsignal(signal.SIGHUP)
    try:
        with pytest.raises(SystemExit, match="130"):
            studio.main(["--port", "0", "--output", str(tmp_path)])
    finally:
        signal.signal(signal.SIGHUP, hangup)
    token = re.search(r"http://127.0.0.1:\d+/([\w-]+)/", capsys.readouterr().out)[1]
    assert len(token) > serving.TOKEN_BYTES and len(opened) == 1 and token not in opened[0]


def test_odd_paths_are_refused_and_broken_lines_are_no_news(studio, caplog, triangle):
    host = studio.host.encode()
    upgrade = (b"Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
               b"Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nOrigin: http://" + host + b"\r\n")
    for request in (b"GET foo", b"OPTIONS *", b"GET *", b"GET ?", b"GET //", b"GET http://evil.example/"):
        assert b" 40" in raw(studio, request + b" HTTP/1.1\r\nHost: " + host + b"\r\n\r\n"), request
        assert b" 40" in raw(studio, request + b" HTTP/1.1\r\nHost: " + host + b"\r\n" + upgrade + b"\r\n"), request
    with socket.create_connection(("127.0.0.1", studio.port), timeout=60) as line:  # an upload that breaks off
        line.sendall(b"POST /%s/picture HTTP/1.1\r\nHost: %s\r\nOrigin: http://%s\r\n" % (TOKEN.encode(), host, host)
                     + b"Content-Length: 1000\r\n\r\nhalf")
    for _ in range(3):  # pages that go away while they are told
        with socket.create_connection(("127.0.0.1", studio.port), timeout=60) as line:
            line.sendall(b"GET /%s/live HTTP/1.1\r\nHost: %s\r\n" % (TOKEN.encode(), host) + upgrade + b"\r\n")
            line.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))  # ends in a reset
    with studio.tab() as tab:
        end = time.monotonic() + 60
        while (status := studio.send(triangle)[0]) == 409 and time.monotonic() < end:
            time.sleep(0.05)
        assert status == 200, "the upload that broke off holds up no other"
        tab.until(lambda state: state["picture"] and state["task"] == "")
    assert not [each for each in caplog.records if each.exc_info], caplog.text
