"""Promises of the page's web server: only its own pages, at its secret address, reach the fleet."""

import http.client
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import msgpack
import pytest
import viser
import zstandard
from support.bus import free_port
from support.scripted import ScriptedVehicle
from support.waiting import wait_for
from websockets.exceptions import InvalidStatus
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Origin, Subprotocol

from rcopterx.ground_station.page.guard import PageServer, kept_key
from rcopterx.ground_station.page.page import FleetPage, PageFrame
from rcopterx.ground_station.scripting.fleet import Fleet

ACCEPTED, FORBIDDEN = 202, 403
FROM_PAGE = {"X-Rcopterx": "page"}
PANEL = {
    "GuiHtmlMessage", "GuiTabGroupMessage", "GuiDropdownMessage", "GuiButtonMessage", "GuiSliderMessage",
    "GuiCheckboxMessage", "GuiUplotMessage",
}  # fmt: skip
SCENE = {
    "FrameMessage",
    "GridMessage",
    "IcosphereMessage",
    "LabelMessage",
    "LineSegmentsMessage",
    "BoxMessage",
}
KEY = "Zm9yIHRlc3RzIG9ubHksIG5vdCByYW5kb20"
QUIET_S = 0.3


@pytest.fixture
def server() -> Iterator[PageServer]:
    running = PageServer(free_port(), "lab", KEY)
    yield running
    running.stop()


@contextmanager
def connected(
    server: PageServer, path: str | None = None, host: str | None = None, origin: str | None = None
) -> Iterator[ClientConnection]:
    """A WebSocket as the script of the page opens it, with some of the request replaced."""
    port = server.get_port()
    with connect(
        f"ws://{f'127.0.0.1:{port}' if host is None else host}/{f'{KEY}/view' if path is None else path}",
        sock=socket.create_connection(("127.0.0.1", port)),
        origin=None if origin is None else Origin(origin),
        subprotocols=[Subprotocol(f"viser-v{viser.__version__}")],
        max_size=None,
    ) as client:
        yield client


def fetched(server: PageServer, path: str, **headers: str) -> tuple[int, bytes]:
    """Status and body of a page; without `Host`, with the header that browsers send."""
    client = http.client.HTTPConnection("127.0.0.1", server.get_port(), timeout=60)
    client.request("GET", path, headers=headers)
    answer = client.getresponse()
    body = answer.read()
    client.close()
    return answer.status, body


def test_the_page_opens_at_its_address_and_nowhere_else(server: PageServer) -> None:
    PageFrame(server, "lab")
    for path in (f"/{KEY}/", f"/{KEY}/view/"):
        status, body = fetched(server, path)
        assert status == 200
        assert b"<html" in body
    assert server.address == f"http://127.0.0.1:{server.get_port()}/{KEY}/"
    for path in (
        "/",
        "/index.html",
        f"/?key={KEY}",
        f"/{KEY[:-1]}/",
        f"/{KEY}/index.html",
        f"/{KEY}/../index.html",
        "/%ff",
    ):
        status, body = fetched(server, path)
        assert status == FORBIDDEN
        assert b"rcopterx ground" in body
        assert KEY.encode() not in body


def test_a_secret_is_long_random_private_and_kept_for_the_next_page(tmp_path: Path) -> None:
    path = tmp_path / "page.key"
    key = kept_key(path)
    assert len(key) >= 40
    assert path.stat().st_mode & 0o777 == 0o600
    assert kept_key(path) == key
    assert kept_key(tmp_path / "watch.key") != key


@pytest.mark.parametrize("path", ["", "?key=x", "wrong", "wrong/view", f"{KEY}/other"])
def test_a_websocket_without_the_secret_is_refused(server: PageServer, path: str) -> None:
    with pytest.raises(InvalidStatus) as refused, connected(server, path):
        pass
    assert refused.value.response.status_code == FORBIDDEN


@pytest.mark.parametrize(
    "origin", ["http://evil.example", "http://127.0.0.1:1", "https://127.0.0.1:{port}", "null", "file://"]
)
def test_a_foreign_page_that_knows_the_secret_is_refused(server: PageServer, origin: str) -> None:
    named = origin.format(port=server.get_port())
    with pytest.raises(InvalidStatus) as refused, connected(server, origin=named):
        pass
    assert refused.value.response.status_code == FORBIDDEN


@pytest.mark.parametrize("name", ["127.0.0.1", "localhost"])
def test_pages_of_the_server_itself_connect(server: PageServer, name: str) -> None:
    host = f"{name}:{server.get_port()}"
    with connected(server, host=host, origin=f"http://{host}") as client:
        assert client.recv(timeout=60)


@pytest.mark.parametrize("host", ["evil.example:{port}", "127.0.0.1.evil.example:{port}", "evil.example"])
def test_a_name_that_was_rebound_to_this_computer_is_refused(server: PageServer, host: str) -> None:
    named = host.format(port=server.get_port())
    assert fetched(server, f"/{KEY}/view", Host=named)[0] == FORBIDDEN
    with pytest.raises(InvalidStatus) as refused, connected(server, host=named, origin=f"http://{named}"):
        pass
    assert refused.value.response.status_code == FORBIDDEN


def test_the_greeting_of_viser_shows_no_address_without_the_secret(
    server: PageServer, capsys: pytest.CaptureFixture[str]
) -> None:
    PageServer(free_port(), "lab", KEY).stop()
    assert "http" not in capsys.readouterr().out


def test_strangers_leave_no_tracebacks_in_the_terminal(
    server: PageServer, caplog: pytest.LogCaptureFixture
) -> None:
    client = http.client.HTTPConnection("127.0.0.1", server.get_port(), timeout=60)
    client.putrequest("BREW", "/")
    client.endheaders()
    with pytest.raises((OSError, http.client.HTTPException)):
        client.getresponse()
    fetched(server, "/")
    assert not [record for record in caplog.records if "handshake" in record.getMessage()]


def test_no_public_tunnel_is_opened_at_the_request_of_a_browser(
    server: PageServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened: list[object] = []
    monkeypatch.setattr("viser._viser.ViserTunnel", lambda *arguments: opened.append(arguments))
    with connected(server) as client:
        client.send(msgpack.packb({"type": "ShareUrlRequest"}))
        time.sleep(QUIET_S)
    assert opened == []


def test_a_viser_that_does_not_use_the_guard_is_not_used(monkeypatch: pytest.MonkeyPatch) -> None:
    stopped: list[PageServer] = []
    monkeypatch.setattr("viser.ViserServer.__init__", lambda *_, **__: None)
    monkeypatch.setattr("viser.ViserServer.stop", lambda page: stopped.append(page))
    with pytest.raises(RuntimeError, match="cannot be protected"):
        PageServer(free_port(), "lab", KEY)
    assert len(stopped) == 1


def messages_of(client: ClientConnection) -> list[dict[str, Any]]:
    """All messages that a browser receives until the page is complete."""
    messages: list[dict[str, Any]] = []
    while not any(message["type"] == "ReplayDoneMessage" for message in messages):
        data = client.recv(timeout=60)
        assert isinstance(data, bytes)
        size = int.from_bytes(data[8:16], "little")
        packed = zstandard.ZstdDecompressor().decompress(
            data[16 : 16 + size], max_output_size=int.from_bytes(data[:8], "little")
        )
        messages += msgpack.unpackb(packed, strict_map_key=False)["messages"]
    return messages


def press_everything(client: ClientConnection) -> int:
    """Press every button that a browser has received from viser; return how many."""
    buttons = [message for message in messages_of(client) if message["type"] == "GuiButtonMessage"]
    for button in buttons:
        press = {"type": "GuiUpdateMessage", "updates": {"value": True}, "uuid": button["uuid"]}
        client.send(msgpack.packb(press))
    return len(buttons)


@pytest.mark.parametrize("steers", [True, False], ids=["control", "watch-only"])
def test_a_page_that_only_watches_has_nothing_to_press(
    server: PageServer,
    fleet: Fleet,
    vehicles: dict[str, ScriptedVehicle],
    steers: bool,
) -> None:
    FleetPage(fleet, PageFrame(server, "lab", steers=steers))
    assert (b"<button" in fetched(server, f"/{KEY}/")[1]) is steers
    with connected(server) as client:
        client.send(msgpack.packb(CAMERA))
        pressed = press_everything(client)
        asked = [fetched(server, f"/{KEY}/{what}", **FROM_PAGE)[0] for what in ("land", "kill")]
        if steers:
            assert pressed > 3
            assert asked == [ACCEPTED, ACCEPTED]
            wait_for(lambda: all(one.state == "killed" for one in vehicles.values()), "not killed")
            wait_for(
                lambda: not {"land", "kill"} & {one.name for one in threading.enumerate()}, "requests last"
            )
        else:
            assert (pressed, asked) == (0, [FORBIDDEN, FORBIDDEN])
            time.sleep(QUIET_S)
            assert all(one.kills == [] and one.requests == [] for one in vehicles.values())


def test_a_link_to_a_request_does_nothing(
    server: PageServer, fleet: Fleet, vehicles: dict[str, ScriptedVehicle]
) -> None:
    FleetPage(fleet, PageFrame(server, "lab"))
    assert fetched(server, f"/{KEY}/kill")[0] == FORBIDDEN
    time.sleep(QUIET_S)
    assert all(one.kills == [] for one in vehicles.values())


def test_browsers_receive_state_and_kill_first_then_the_panel_and_then_the_scene(
    server: PageServer, fleet: Fleet
) -> None:
    FleetPage(fleet, PageFrame(server, "lab")).update(time.monotonic())
    header = fetched(server, f"/{KEY}/")[1].decode()
    assert (
        header.index("KILL") < header.index("Take off") < header.index("h1 ground") < header.index("<iframe")
    )
    with connected(server) as client:
        # viser draws the axes of the world by itself.
        messages = [message for message in messages_of(client) if message.get("name") != "/WorldAxes"]
    panel = [at for at, message in enumerate(messages) if message["type"] in PANEL]
    scene = [at for at, message in enumerate(messages) if message["type"] in SCENE]
    assert len(panel) > 20
    assert len(scene) > 10
    assert panel[-1] < scene[0]


CAMERA = {
    "type": "ViewerCameraMessage", "wxyz": [1.0, 0.0, 0.0, 0.0], "position": [0.0, 0.0, 1.0], "fov": 1.0,
    "near": 0.1, "far": 10.0, "image_height": 10, "image_width": 10, "look_at": [1.0, 0.0, 0.0],
    "up_direction": [0.0, 0.0, 1.0],
}  # fmt: skip
"""A browser counts as connected once it has sent this."""
