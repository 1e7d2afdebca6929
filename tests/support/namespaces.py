"""Network namespaces as hosts, where this computer and user can create them."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from typing import IO, Final

import pytest

NETWORK: Final = "10.213.7"
STOP_S: Final = 30.0  # time that a program has to end before it is killed


class NetworkUnavailableError(OSError):
    """This computer or user cannot create network namespaces; the message says why."""


class NetworkNamespaces:
    """Hosts with an address each, whose links can be cut; they keep their carriers, as behind a switch.

    Their file system, and so Unix sockets, are shared.
    """

    def __init__(self, hosts: Sequence[str]) -> None:
        self._prefix = f"rx{os.getpid()}"
        self.switch = f"{self._prefix}-switch"  # namespace of the bridges; its `far0` leads to host one
        self.addresses = {host: f"{NETWORK}.{number}" for number, host in enumerate(hosts, 1)}

    def build(self) -> None:
        """Create namespaces, bridges, cables; `NetworkUnavailableError` without the right or program."""
        _ip("netns", "add", self.switch)
        self._in_switch("link", "add", "hub", "type", "bridge")
        self._in_switch("link", "set", "hub", "up")
        for number, (host, address) in enumerate(self.addresses.items()):
            space, port, bridge = self.namespace(host), f"port{number}", f"bridge{number}"
            near, far = f"near{number}", f"far{number}"
            _ip("netns", "add", space)
            self._in_switch("link", "add", port, "type", "veth", "peer", "name", "eth0", "netns", space)
            self._in_switch("link", "add", near, "type", "veth", "peer", "name", far)
            self._in_switch("link", "add", bridge, "type", "bridge")
            for device, master in ((port, bridge), (near, bridge), (far, "hub")):
                self._in_switch("link", "set", device, "master", master)
            for device in (port, bridge, near, far):
                self._in_switch("link", "set", device, "up")
            _ip("-n", space, "address", "add", f"{address}/24", "dev", "eth0")
            for device in ("lo", "eth0"):
                _ip("-n", space, "link", "set", device, "up")

    def remove(self) -> None:
        """Remove what `build` created."""
        for space in (self.switch, *map(self.namespace, self.addresses)):
            subprocess.run(["ip", "netns", "del", space], stderr=subprocess.DEVNULL, check=False)

    def namespace(self, host: str) -> str:
        """Name of the namespace of a host."""
        return f"{self._prefix}-{host}"

    def python(self, host: str, *arguments: str) -> list[str]:
        """Command line that runs Python on a host."""
        return ["ip", "netns", "exec", self.namespace(host), sys.executable, *arguments]

    @contextmanager
    def running(
        self,
        host: str,
        arguments: Sequence[str],
        environment: Mapping[str, str],
        output: int | IO[bytes],
        end: signal.Signals = signal.SIGINT,
    ) -> Iterator[None]:
        """Run Python on a host until the block is left, which sends it the signal `end`."""
        command = self.python(host, *arguments)
        with subprocess.Popen(command, env=environment, stdout=output, stderr=output) as process:
            try:
                yield
            finally:
                process.send_signal(end)
                try:
                    process.wait(STOP_S)
                except subprocess.TimeoutExpired:
                    process.kill()

    def cut(self, host: str) -> None:
        """Cut the link of a host to all others."""
        self._set_link(host, "down")

    def restore(self, host: str) -> None:
        """Join a host with the others again."""
        self._set_link(host, "up")

    def _set_link(self, host: str, state: str) -> None:
        self._in_switch("link", "set", f"far{list(self.addresses).index(host)}", state)

    def _in_switch(self, *words: str) -> None:
        _ip("-n", self.switch, *words)


@contextmanager
def network(hosts: Sequence[str]) -> Iterator[NetworkNamespaces]:
    """A network of these hosts, removed at the end; raises `NetworkUnavailableError`."""
    made = NetworkNamespaces(hosts)
    try:
        made.build()
        yield made
    finally:
        made.remove()


@contextmanager
def network_or_skip(hosts: Sequence[str]) -> Iterator[NetworkNamespaces]:
    """A network of these hosts; the test is skipped with the reason where namespaces need other rights."""
    with ExitStack() as stack:
        try:
            net = stack.enter_context(network(hosts))
        except NetworkUnavailableError as error:
            pytest.skip(str(error))
        yield net


def _ip(*words: str) -> None:
    try:
        subprocess.run(["ip", *words], check=True, capture_output=True, text=True)
    except FileNotFoundError:
        raise NetworkUnavailableError("there is no program 'ip' (package iproute2)") from None
    except subprocess.CalledProcessError as error:
        raise NetworkUnavailableError(f"ip {' '.join(words)}: {error.stderr.strip()}") from None
