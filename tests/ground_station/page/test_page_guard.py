"""Promises of the page's web server: only its own pages, at its secret address, reach the fleet."""

import http.client
import json
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from urllib.parse import quote

import pytest
from support.bus import free_port
from support.scripted import ScriptedVehicle
from support.waiting import wait_for
from websockets.exceptions import InvalidStatus
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Origin

from rcopterx.ground_station import page
from rcopterx.ground_station.page.guard import PageServer, kept_key
from rcopterx.ground_station.page.page import FleetPage, PageFrame
from rcopterx.ground_station.scripting.fleet import Fleet

ACCEPTED, BAD, FORBIDDEN = 202, 400, 403
FROM_PAGE = {"X-Rcopterx": "page"}
KEY = "Zm9yIHRlc3RzIG9ubHksIG5vdCByYW5kb20"
QUIET_S = 0.3


@pytest.fixture
def frame() -> Iterator[PageFrame]:
    running = PageFrame(free_port(), "lab", KEY)
    yield running
    running.server.stop()


@pytest.fixture
def server(frame: PageFrame) -> PageServer:
    return frame.server


@contextmanager
def connected(
    server: PageServer, path: str | None = None, host: str | None = None, origin: str | None = None
) -> Iterator[ClientConnection]:
    """A WebSocket as the script of the page opens it, with some of the request replaced."""
    place = f"{KEY}/feed" if path is None else path
    with connect(
        f"ws://{f'127.0.0.1:{server.port}' if host is None else host}/{place}",
        sock=socket.create_connection(("127.0.0.1", server.port)),
        origin=None if origin is None else Origin(origin),
        max_size=None,
    ) as client:
        yield client


def fetched(server: PageServer, path: str, **headers: str) -> tuple[int, bytes]:
    """Status and body of a page; without `Host`, with the header that browsers send."""
    client = http.client.HTTPConnection("127.0.0.1", server.port, timeout=60)
    client.request("GET", path, headers=headers)
    answer = client.getresponse()
    body = answer.read()
    client.close()
    return answer.status, body


def asked(server: PageServer, what: str, arguments: dict[str, object], **headers: str) -> int:
    """Status of a request as the page sends it."""
    content = quote(json.dumps({"do": what, "arguments": arguments}))
    return fetched(server, f"/{KEY}/do?{content}", **headers)[0]


def test_the_page_opens_at_its_address_and_nowhere_else(server: PageServer) -> None:
    status, body = fetched(server, f"/{KEY}/")
    assert status == 200
    assert b"<html" in body
    assert server.address == f"http://127.0.0.1:{server.port}/{KEY}/"
    for path in (
        "/",
        "/index.html",
        f"/?key={KEY}",
        f"/{KEY[:-1]}/",
        f"/{KEY}/index.html",
        f"/{KEY}/../index.html",
        f"/{KEY}/../page.py",
        f"/{KEY}/vendor/../../page.py",
        "/%ff",
    ):
        status, body = fetched(server, path)
        assert status == FORBIDDEN
        assert b"rcopterx ground" in body
        assert KEY.encode() not in body


def test_all_that_the_page_loads_is_served_by_itself_and_is_small(server: PageServer) -> None:
    document = fetched(server, f"/{KEY}/")[1].decode()
    assert "http://" not in document
    assert "https://" not in document
    folder = Path(page.__path__[0]) / "web"
    sizes = [len(document)]
    for path in (path for path in folder.rglob("*") if path.suffix in (".js", ".css")):
        status, body = fetched(server, f"/{KEY}/{path.relative_to(folder)}")
        assert (status, body) == (200, path.read_bytes())
        sizes.append(len(body))
    assert sum(sizes) < 1_200_000


def test_another_page_can_neither_embed_the_page_nor_read_its_address(server: PageServer) -> None:
    client = http.client.HTTPConnection("127.0.0.1", server.port, timeout=60)
    client.request("GET", f"/{KEY}/")
    headers = client.getresponse().headers
    client.close()
    assert "frame-ancestors 'none'" in headers["Content-Security-Policy"]
    assert headers["Referrer-Policy"] == "no-referrer"
    assert headers["Cache-Control"] == "no-store"


def test_a_port_in_use_is_passed_over() -> None:
    port = free_port()
    with socket.create_server(("127.0.0.1", port)):
        other = PageFrame(port, "lab", KEY)
        assert other.server.port > port
        other.server.stop()


def test_a_page_ends_at_once_while_browsers_and_strangers_are_connected() -> None:
    ending = PageFrame(free_port(), "lab", KEY)
    with socket.create_connection(("127.0.0.1", ending.server.port)), connected(ending.server) as client:
        client.recv(timeout=60)
        from_s = time.monotonic()
        ending.server.stop()
        assert time.monotonic() - from_s < 4.0


def test_a_secret_is_long_random_private_and_kept_for_the_next_page(tmp_path: Path) -> None:
    path = tmp_path / "page.key"
    key = kept_key(path)
    assert len(key) >= 40
    assert path.stat().st_mode & 0o777 == 0o600
    assert kept_key(path) == key
    assert kept_key(tmp_path / "watch.key") != key


@pytest.mark.parametrize("path", ["", "?key=x", "wrong", "wrong/feed", f"{KEY}x/feed"])
def test_a_websocket_without_the_secret_is_refused(server: PageServer, path: str) -> None:
    with pytest.raises(InvalidStatus) as refused, connected(server, path):
        pass
    assert refused.value.response.status_code == FORBIDDEN


@pytest.mark.parametrize(
    "origin", ["http://evil.example", "http://127.0.0.1:1", "https://127.0.0.1:{port}", "null", "file://"]
)
def test_a_foreign_page_that_knows_the_secret_is_refused(server: PageServer, origin: str) -> None:
    named = origin.format(port=server.port)
    with pytest.raises(InvalidStatus) as refused, connected(server, origin=named):
        pass
    assert refused.value.response.status_code == FORBIDDEN


@pytest.mark.parametrize("name", ["127.0.0.1", "localhost"])
def test_pages_of_the_server_itself_connect(server: PageServer, name: str) -> None:
    host = f"{name}:{server.port}"
    with connected(server, host=host, origin=f"http://{host}") as client:
        assert client.recv(timeout=60)


@pytest.mark.parametrize("host", ["evil.example:{port}", "127.0.0.1.evil.example:{port}", "evil.example"])
def test_a_name_that_was_rebound_to_this_computer_is_refused(server: PageServer, host: str) -> None:
    named = host.format(port=server.port)
    assert fetched(server, f"/{KEY}/feed", Host=named)[0] == FORBIDDEN
    with pytest.raises(InvalidStatus) as refused, connected(server, host=named, origin=f"http://{named}"):
        pass
    assert refused.value.response.status_code == FORBIDDEN


def test_strangers_leave_no_tracebacks_in_the_terminal(
    server: PageServer, caplog: pytest.LogCaptureFixture
) -> None:
    client = http.client.HTTPConnection("127.0.0.1", server.port, timeout=60)
    client.putrequest("BREW", "/")
    client.endheaders()
    # Releases of websockets differ: some close the connection without an answer, others refuse the method.
    status = BAD
    with suppress(OSError, http.client.HTTPException):
        status = client.getresponse().status
    assert status >= BAD
    fetched(server, "/")
    assert not [record for record in caplog.records if "handshake" in record.getMessage()]


@pytest.mark.parametrize("steers", [True, False], ids=["control", "watch-only"])
def test_a_page_that_only_watches_has_nothing_to_press(
    fleet: Fleet, vehicles: dict[str, ScriptedVehicle], steers: bool
) -> None:
    frame = PageFrame(free_port(), "lab", KEY, steers=steers)
    server = frame.server
    try:
        FleetPage(fleet, frame).update(time.monotonic())
        document = fetched(server, f"/{KEY}/")[1]
        assert (b'id="kill"' in document) is steers
        assert (b"kill.js" in document) is steers
        assert (b'name="land"' in document) is steers
        statuses = [
            asked(server, what, arguments, **FROM_PAGE)
            for what, arguments in (("land", {"name": None}), ("kill", {}))
        ]
        if steers:
            assert statuses == [ACCEPTED, ACCEPTED]
            wait_for(lambda: all(one.state == "killed" for one in vehicles.values()), "not killed")
            wait_for(lambda: "do" not in {one.name for one in threading.enumerate()}, "requests last")
        else:
            assert statuses == [FORBIDDEN, FORBIDDEN]
            time.sleep(QUIET_S)
            assert all(one.kills == [] and one.requests == [] for one in vehicles.values())
    finally:
        server.stop()


def test_what_a_browser_sends_to_the_socket_does_nothing(
    frame: PageFrame, fleet: Fleet, vehicles: dict[str, ScriptedVehicle]
) -> None:
    FleetPage(fleet, frame)
    with connected(frame.server) as client:
        client.send(json.dumps({"do": "kill", "arguments": {}}))
        time.sleep(QUIET_S)
    assert all(one.kills == [] for one in vehicles.values())


def test_a_link_to_a_request_does_nothing(
    frame: PageFrame, fleet: Fleet, vehicles: dict[str, ScriptedVehicle]
) -> None:
    FleetPage(fleet, frame)
    assert asked(frame.server, "kill", {}) == FORBIDDEN
    time.sleep(QUIET_S)
    assert all(one.kills == [] for one in vehicles.values())


def test_a_request_that_the_page_does_not_have_is_answered_with_a_reason(
    frame: PageFrame, fleet: Fleet
) -> None:
    FleetPage(fleet, frame)
    assert asked(frame.server, "explode", {}, **FROM_PAGE) == BAD
    assert asked(frame.server, "land", {"name": "h9"}, **FROM_PAGE) == BAD


def test_kill_is_refused_and_not_lost_before_the_fleet_is_there(frame: PageFrame) -> None:
    assert asked(frame.server, "kill", {}, **FROM_PAGE) == FORBIDDEN


def test_the_document_has_kill_and_the_state_before_any_script_runs(frame: PageFrame, fleet: Fleet) -> None:
    assert "waiting for the fleet" in fetched(frame.server, f"/{KEY}/")[1].decode()
    FleetPage(fleet, frame).update(time.monotonic())
    document = fetched(frame.server, f"/{KEY}/")[1].decode()
    assert document.index('id="kill"') < document.index("Take off") < document.index("ready to take off")
    assert document.index("ready to take off") < document.index("<canvas")
