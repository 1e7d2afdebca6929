"""A fleet with certificates on two hosts: their routers in this process, and clients of all kinds."""

import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from datetime import UTC, datetime
from pathlib import Path
from tempfile import TemporaryDirectory

import zenoh
from zenoh.handlers import Callback

from rcopterx.bus.channels import LAUNCHER_EVENT, key, request_key
from rcopterx.bus.endpoints import Credentials, client_config, router_config
from rcopterx.deploy.certificates.files import credentials
from rcopterx.deploy.certificates.fleet_certificates import make_certificates
from rcopterx.deploy.roles.router import protection_of
from rcopterx.fleet.reading import parse_fleet
from rcopterx.fleet.schema import FleetFile
from support.bus import free_port, patient_links
from support.waiting import DEADLINE_S, wait_for

LINKED_S = 10.0
ATTEMPTS = 4
"""Zenoh links two routers of one process in one direction only now and then, for good; one start in fifty."""


def secured_fleet(directory: Path) -> FleetFile:
    """Gateways and h1 on `main`, h2 on `second`, which is not for steering; a fleet that does not fly."""
    port = free_port()
    return parse_fleet(
        f'''
        name = "lab"
        [security]
        certificates = "{directory}"
        [hosts.main]
        router_port = {port}
        [hosts.second]
        address = "127.0.0.2"
        router_port = {port}
        steering = false
        [vehicles.h1]
        subject = "a"
        transmitter = {{ port = "h1" }}
        [vehicles.h2]
        subject = "b"
        host = "second"
        transmitter = {{ port = "h2" }}
        '''
    )


class SecuredBus:
    """Routers of both hosts, and a listener on `main` that collects what passes."""

    def __init__(self, stack: ExitStack, directory: Path) -> None:
        self.directory = directory
        self.fleet = secured_fleet(directory / "certificates")
        make_certificates(self.fleet, datetime.now(UTC), days=100)
        self._stack = stack
        self._passed: list[str] = []
        self._changed = threading.Condition()
        for host in self.fleet.hosts:
            earlier = [self.fleet.endpoint("main")] if host == "second" else []
            endpoints = [self.socket(host), self.fleet.endpoint(host)]
            router = self._open(router_config(endpoints, earlier, None, protection_of(self.fleet, host)))
            self._serve(router, request_key("lab", host, "identify"))
        self.local = {host: self.client(self.socket(host)) for host in self.fleet.hosts}
        self.local["main"].declare_subscriber("rcopterx/**", Callback(self._receive, indirect=False))
        self._wait_linked()

    def socket(self, host: str) -> str:
        """Endpoint of the Unix socket of a host."""
        return f"unixsock-stream/{self.directory / host}.sock"

    def certificate(self, name: str) -> Credentials:
        """Files of a certificate of the fleet."""
        return credentials(self.directory / "certificates", name)

    def client(
        self, endpoint: str, shown: Credentials | None = None, within_s: float = DEADLINE_S
    ) -> zenoh.Session:
        """A Zenoh client without any of our checks.

        Raises
        ------
        zenoh.ZError
            It is not let in.
        """
        return self._open(client_config([endpoint], None, within_s, shown))

    def remote(self, name: str, host: str = "main") -> zenoh.Session:
        """A client that shows a certificate to the router of a host, from outside."""
        return self.client(self.fleet.endpoint(host), self.certificate(name))

    def passes(self, sender: zenoh.Session, on_key: str) -> bool:
        """Whether what a client publishes reaches the host `main`."""
        with self._changed:
            self._passed.clear()
        sender.put(on_key, b"")
        # The router answers a later request after it has forwarded the sample; the mark comes last.
        assert identified(sender)
        self._wait_for_mark()
        with self._changed:
            return on_key in self._passed

    def serve(self, server: zenoh.Session, on_key: str) -> None:
        """Let a client answer requests; its router knows when this returns."""
        self._serve(server, on_key)
        assert identified(server)

    def _wait_for_mark(self) -> None:
        """Publish something allowed and wait for it."""
        mark = key("lab", "second", LAUNCHER_EVENT.topic)
        self.local["second"].put(mark, b"")
        with self._changed:
            assert self._changed.wait_for(lambda: mark in self._passed, DEADLINE_S), "the mark is lost"

    def _receive(self, sample: zenoh.Sample) -> None:
        with self._changed:
            self._passed.append(str(sample.key_expr))
            self._changed.notify_all()

    def _serve(self, session: zenoh.Session, on_key: str) -> None:
        def answer(query: zenoh.Query) -> None:
            with query:
                query.reply(on_key, b"yes")

        session.declare_queryable(on_key, Callback(answer, indirect=False), complete=True)

    def _wait_linked(self) -> None:
        wait_for(lambda: len(identified(self.local["main"])) == 2, "the routers are not linked", LINKED_S)

    def _open(self, config: zenoh.Config) -> zenoh.Session:
        session = zenoh.open(config)
        self._stack.callback(session.close)
        return session


def identified(session: zenoh.Session) -> list[str]:
    """Keys of the processes that answer an identification request."""
    replies = session.get(request_key("*", "*", "identify"), timeout=DEADLINE_S, target=zenoh.QueryTarget.ALL)
    return [str(reply.ok.key_expr) for reply in replies if reply.ok is not None]


@contextmanager
def secured_bus() -> Iterator[SecuredBus]:
    """Two routers with certificates, for as long as the block lasts."""
    with TemporaryDirectory(prefix="rx-") as directory, patient_links():
        for attempt in range(ATTEMPTS):
            place = Path(directory) / str(attempt)
            place.mkdir()
            with ExitStack() as stack:
                try:
                    bus = SecuredBus(stack, place)
                except AssertionError:
                    if attempt < ATTEMPTS - 1:
                        continue
                    raise
                yield bus
                return
