"""Promises of the fleet on two containers: both files name the same hosts, and their commands fly it.

Network namespaces stand in for the containers: each has its address and its run directory, and is given the
commands that the compose file and its remarks name.
"""

import os
import re
import shlex
import signal
import subprocess
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from support.namespaces import NetworkNamespaces, network_or_skip
from support.waiting import wait_for

from rcopterx.deploy.fleet_check import check_fleet
from rcopterx.fleet.reading import load_fleet

EXAMPLE = Path(__file__).parents[2] / "examples" / "two_hosts"
COMPOSE = (EXAMPLE / "compose.yaml").read_text(encoding="utf-8")
SERVICE = re.compile(
    r"^  (\w+):\n(?:    .*\n)*?    command: (.*--host (\w+))\n(?:    .*\n)*?.*ipv4_address: ([\d.]+)",
    re.MULTILINE,
)
ROOT = Path(__file__).parents[2]
STOP_S = 40.0


def test_the_fleet_file_can_be_flown_and_fits_the_containers(tmp_path: Path) -> None:
    fleet = load_fleet(EXAMPLE / "two_hosts.toml")
    check_fleet(fleet, tmp_path)
    services = SERVICE.findall(COMPOSE)
    assert {service: address for service, _, _, address in services} == {
        name: host.address for name, host in fleet.hosts.items()
    }
    assert all(service == host for service, _, host, _ in services)
    assert {vehicle.host for vehicle in fleet.vehicles.values()} == {"control"}


class Containers:
    """What runs on each host, with a run directory of its own."""

    def __init__(self, net: NetworkNamespaces, fleet: Path, directory: Path) -> None:
        self._net, self._fleet, self._directory = net, fleet, directory
        self._up: list[tuple[subprocess.Popen[bytes], Path]] = []

    def _command(self, service: str, words: str) -> tuple[list[str], dict[str, str]]:
        run = self._directory / service
        run.mkdir(exist_ok=True)
        placed = [str(self._fleet) if word.startswith("/fleet/") else word for word in shlex.split(words)]
        environment = os.environ | {"RCOPTERX_RUN": str(run), "PYTHONPATH": str(ROOT)}
        environment["RCOPTERX_FLIGHTS"] = str(run / "flights")
        return self._net.python(service, "-m", "rcopterx", *placed), environment

    def start(self, service: str, words: str) -> None:
        """What compose does with the command of a service."""
        command, environment = self._command(service, words)
        log = self._directory / f"{service}.log"
        with log.open("wb") as output:
            process = subprocess.Popen(
                command, env=environment, stdin=subprocess.DEVNULL, stdout=output, stderr=output,
                start_new_session=True, cwd=self._directory,
            )  # fmt: skip
        self._up.append((process, log))

    def attempt(self, service: str, words: str) -> subprocess.CompletedProcess[str]:
        """What `compose exec` does."""
        command, environment = self._command(service, words)
        return subprocess.run(command, env=environment, capture_output=True, text=True, timeout=90)

    def execute(self, service: str, words: str) -> str:
        """What it prints; it must succeed."""
        done = self.attempt(service, words)
        logs = "".join(log.read_text() for _, log in self._up)
        assert done.returncode == 0, done.stdout + done.stderr + logs
        return done.stdout

    def stop(self) -> list[int]:
        """Exit codes after the stop signal of the compose file."""
        assert COMPOSE.count("stop_signal: SIGINT") == len(self._up)
        for process, _ in self._up:
            process.send_signal(signal.SIGINT)
        return [process.wait(STOP_S) for process, _ in self._up]

    def end(self) -> None:
        """Leave nothing behind, whatever happened."""
        for process, _ in self._up:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()


@contextmanager
def containers(directory: Path) -> Iterator[Containers]:
    services = SERVICE.findall(COMPOSE)
    with ExitStack() as stack:
        net = stack.enter_context(network_or_skip([service for service, *_ in services]))
        text = (EXAMPLE / "two_hosts.toml").read_text(encoding="utf-8")
        for service, _, _, address in services:
            text = text.replace(address, net.addresses[service])
        fleet = directory / "two_hosts.toml"
        fleet.write_text(text, encoding="utf-8")
        # A short path, because the routers' sockets live in it.
        run = Path(stack.enter_context(TemporaryDirectory(prefix="rcopterx-")))
        running = Containers(net, fleet, run)
        stack.callback(running.end)
        yield running


@pytest.mark.campaign
@pytest.mark.integration
@pytest.mark.timeout(240)
def test_the_commands_of_the_compose_file_fly_the_fleet(tmp_path: Path) -> None:
    with containers(tmp_path) as running:
        for service, command, _, _ in SERVICE.findall(COMPOSE):
            running.start(service, command)
        wait_for(lambda: running.attempt("main", "check").returncode == 0, "something blocks take-off", 90.0)
        (steered,) = re.findall(r"exec main rcopterx (.+)$", COMPOSE, re.MULTILINE)
        running.execute("main", steered)
        assert running.execute("main", "status").count("flying") == 3
        assert running.stop() == [0, 0]
