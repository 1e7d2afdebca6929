"""The web server of the page, which accepts only browsers that have its secret address."""

import asyncio
import errno
import hmac
import logging
import secrets
import threading
from collections.abc import Awaitable, Callable
from concurrent.futures import Future
from contextlib import suppress
from http import HTTPStatus
from pathlib import Path
from typing import Final
from urllib.parse import unquote

from websockets.asyncio.server import Server, ServerConnection, serve
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from rcopterx.places import replace_file
from rcopterx.tables import table_beside

HOST: Final = "127.0.0.1"
NAMES: Final = (HOST, "localhost")  # another name may have been rebound to this address
KEY_BYTES: Final = 32
FEED: Final = "feed"  # path of the WebSocket below the secret
DO: Final = "do"  # path of requests below the secret; their content is the query
FROM_PAGE: Final = "X-Rcopterx"  # header of requests, which only scripts of the page itself can send
PORTS_TRIED: Final = 100
END_S: Final = 1.0

Stream = Callable[[ServerConnection], Awaitable[None]]


class RequestRejectedError(Exception):
    """The page does not carry out a request; the text says why."""


class PageServer:
    """A web server whose address has a secret path, which the scripts of the page repeat in their requests.

    Cookies would reach other servers of this computer. It listens on `port`, or on the next free one; `files`
    returns contents by name, "" is the document; `stream` sends the state to a browser until it leaves.
    """

    def __init__(self, port: int, key: str, files: Callable[[str], bytes | None], stream: Stream) -> None:
        self._key, self._files, self._stream = key, files, stream
        self.perform: Callable[[str], Callable[[], object]] | None = None
        """Decodes a request of a page, or raises `RequestRejectedError`; None while nothing steers."""
        started: Future[int] = Future()
        self._thread = threading.Thread(target=lambda: asyncio.run(self._serve(port, started)), daemon=True)
        self._thread.start()
        self.port = started.result()

    async def _serve(self, port: int, started: "Future[int]") -> None:
        """Serve until `stop`; the loop then ends what is left, as connections without a request."""
        try:
            server = await self._listen(port)
        except OSError as error:
            started.set_exception(error)
            return
        self._loop, self._ending = asyncio.get_running_loop(), asyncio.Event()
        started.set_result(server.sockets[0].getsockname()[1])
        await self._ending.wait()
        server.close()
        with suppress(TimeoutError):
            await asyncio.wait_for(server.wait_closed(), END_S)

    async def _listen(self, port: int) -> Server:
        for number in range(port, min(port + PORTS_TRIED, 65536)):
            try:
                return await serve(
                    self._stream, HOST, number, process_request=self._respond, compression=None,
                    server_header=None,
                )  # fmt: skip
            except OSError as error:
                if error.errno != errno.EADDRINUSE:
                    raise
        raise OSError(errno.EADDRINUSE, f"no free port from {port} on")

    @property
    def address(self) -> str:
        """Address for browsers, which contains the secret."""
        return f"http://{HOST}:{self.port}/{self._key}/"

    def stop(self) -> None:
        """Close all connections and stop serving."""
        self._loop.call_soon_threadsafe(self._ending.set)
        self._thread.join()

    def _respond(self, connection: ServerConnection, request: Request) -> Response | None:  # noqa: ARG002
        """Answer a request; None for a WebSocket that is accepted."""
        path, _, query = request.path.partition("?")
        headers = request.headers
        key, _, place = path.strip("/").partition("/")
        refusal = self._refusal(key, headers.get_all("Host"), headers.get_all("Origin"))
        if refusal is not None:
            return _answer(HTTPStatus.FORBIDDEN, refusal)
        if place == FEED:
            return None
        if place == DO:
            return (
                self._start(query) if FROM_PAGE in headers else _answer(HTTPStatus.FORBIDDEN, NOT_FROM_PAGE)
            )
        if (content := self._files(place)) is None:
            return _answer(HTTPStatus.FORBIDDEN, WRONG_ADDRESS)
        return _answer(HTTPStatus.OK, content, KINDS[Path(place or "index.html").suffix])

    def _refusal(self, key: str, hosts: list[str], origins: list[str]) -> str | None:
        """Return why a request is refused, by its path and headers; None if it is accepted."""
        if len(hosts) != 1 or hosts[0].rpartition(":")[0] not in NAMES:
            return "the page has no such host name"
        # Programs send no origin, browsers always do when they open a WebSocket.
        if origins not in ([], [f"http://{hosts[0]}"]):
            return "only the page itself may connect"
        if not hmac.compare_digest(key.encode(errors="replace"), self._key.encode()):
            return WRONG_ADDRESS
        return None

    def _start(self, query: str) -> Response:
        """Start what a page requests, in a thread of its own."""
        if self.perform is None:
            return _answer(HTTPStatus.FORBIDDEN, "this page does not steer a fleet")
        try:
            action = self.perform(unquote(query))
        except RequestRejectedError as error:
            return _answer(HTTPStatus.BAD_REQUEST, str(error))
        threading.Thread(target=action, name=DO).start()
        return _answer(HTTPStatus.ACCEPTED, "")


WRONG_ADDRESS: Final = "the address of the page is the one that `rcopterx ground` has printed"
NOT_FROM_PAGE: Final = "only the page itself may request this"
HEADERS: Final = table_beside(__file__, "headers")
KINDS: Final = {".html": "text/html", ".js": "text/javascript", ".css": "text/css"}


def _answer(status: HTTPStatus, content: str | bytes, kind: str = "text/plain") -> Response:
    body = content if isinstance(content, bytes) else f"{content}\n".encode()
    headers = HEADERS | {"Content-Length": str(len(body)), "Content-Type": f"{kind}; charset=utf-8"}
    return Response(status, status.phrase, Headers(headers), body)


def kept_key(path: Path) -> str:
    """Return the secret in a file, created if missing, by which windows of a restarted page reconnect."""
    if not path.exists():
        replace_file(path, secrets.token_urlsafe(KEY_BYTES).encode(), 0o600)
    return path.read_text()


# Strangers must not fill the terminal of the page with tracebacks.
logging.getLogger("websockets.server").addFilter(lambda record: "handshake failed" not in record.getMessage())
