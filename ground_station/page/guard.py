"""The web server of the page, which, unlike viser's, accepts only browsers that have its secret address."""

import hmac
import io
import logging
import os
import secrets
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout
from dataclasses import replace
from http import HTTPStatus
from pathlib import Path
from typing import Any, Final

import viser
import websockets.asyncio.server as websocket_server
from websockets.asyncio.server import ServerConnection
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

HOST: Final = "127.0.0.1"
NAMES: Final = (HOST, "localhost")
"""Names under which this computer serves the page; a name that was rebound to its address is another one."""
KEY_BYTES: Final = 32
VIEW: Final = "view"  # path of viser below the secret
FROM_PAGE: Final = "X-Rcopterx"  # header of requests, which only scripts of the page itself can send

Respond = Callable[[ServerConnection, Request], Response | None]


class PageServer(viser.ViserServer):
    """A web server whose address has a secret path, which the script of the page repeats for its WebSocket.

    Cookies would reach other servers of this computer. Raises `RuntimeError`: viser does not use the guard.
    """

    def __init__(self, port: int, label: str, key: str) -> None:
        # makes the HTML at each path below the secret; viser is at `VIEW`
        self.pages: dict[str, Callable[[], str]] = {}
        # called in a thread of its own when the page requests a path
        self.requests: dict[str, Callable[[], object]] = {}
        self._key, self._guarded = key, False
        # The greeting of viser has an address without the secret.
        with self._guard(), redirect_stdout(io.StringIO()):
            super().__init__(HOST, port, label=label, verbose=False)
        if not self._guarded:
            self.stop()
            raise RuntimeError("this version of viser has a web server that cannot be protected")

    @property
    def address(self) -> str:
        """Address for browsers, which contains the secret."""
        return f"http://{HOST}:{self.get_port()}/{self._key}/"

    def request_share_url(self, verbose: bool = True) -> None:
        """Refuse to open a public tunnel, for which every browser can send a message."""

    def _refusal(self, path: str, hosts: list[str], origins: list[str]) -> str | None:
        """Return why a request is refused, by its path and headers; None if it is accepted."""
        if len(hosts) != 1 or hosts[0].rpartition(":")[0] not in NAMES:
            return "the page has no such host name"
        # Programs send no origin, browsers always do when they open a WebSocket.
        if origins not in ([], [f"http://{hosts[0]}"]):
            return "only the page itself may connect"
        key, _, place = path.partition("/")
        exists = place == VIEW or place in self.pages or place in self.requests
        if not exists or not hmac.compare_digest(key.encode(errors="replace"), self._key.encode()):
            return "the address of the page is the one that `rcopterx ground` has printed"
        return None

    @contextmanager
    def _guard(self) -> Iterator[None]:
        """Check the requests of every server that the library `websockets` starts in the block."""
        serve = websocket_server.serve

        def guarded(*arguments: Any, process_request: Respond, **options: Any) -> Any:
            self._guarded = True
            return serve(*arguments, process_request=self._before(process_request), **options)

        websocket_server.serve = guarded  # type: ignore[assignment, misc]
        try:
            yield
        finally:
            websocket_server.serve = serve  # type: ignore[misc]

    def _before(self, respond: Respond) -> Respond:
        def checked(connection: ServerConnection, request: Request) -> Response | None:
            path = request.path.partition("?")[0].strip("/")
            headers = request.headers
            refusal = self._refusal(path, headers.get_all("Host"), headers.get_all("Origin"))
            place = path.partition("/")[2]
            if refusal is not None:
                return _response(HTTPStatus.FORBIDDEN, f"{refusal}\n")
            if place == VIEW:
                return respond(connection, replace(request, path="/"))
            if place in self.pages:
                return _response(HTTPStatus.OK, self.pages[place]())
            if FROM_PAGE not in headers:
                return _response(HTTPStatus.FORBIDDEN, "only the page itself may request this\n")
            threading.Thread(target=self.requests[place], name=place).start()
            return _response(HTTPStatus.ACCEPTED, "")

        return checked


def _response(status: HTTPStatus, text: str) -> Response:
    body = text.encode()
    kind = "text/html" if status == HTTPStatus.OK else "text/plain"
    headers = {
        "Cache-Control": "no-store",
        "Connection": "close",
        "Content-Length": str(len(body)),
        "Content-Type": f"{kind}; charset=utf-8",
    }
    return Response(status, status.phrase, Headers(headers), body)


def kept_key(path: Path) -> str:
    """Return the secret in a file, created if missing, by which windows of a restarted page reconnect."""
    if not path.exists():
        fresh = path.with_suffix(f".{os.getpid()}")
        fresh.touch(0o600)
        fresh.write_text(secrets.token_urlsafe(KEY_BYTES))
        fresh.replace(path)
    return path.read_text()


# Strangers must not fill the terminal of the page with tracebacks.
logging.getLogger("websockets.server").addFilter(lambda record: "handshake failed" not in record.getMessage())
