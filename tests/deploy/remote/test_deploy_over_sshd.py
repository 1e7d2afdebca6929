"""Deploying over a real ssh to two hosts: network namespaces with an sshd and a home each."""

import os
import shutil
import stat
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from datetime import UTC, datetime
from pathlib import Path

import pytest
from support.fleets import PAIR
from support.namespaces import NetworkNamespaces, network_or_skip
from support.waiting import wait_for

from rcopterx.deploy.certificates.fleet_certificates import make_certificates
from rcopterx.fleet.reading import load_fleet

pytestmark = [pytest.mark.campaign, pytest.mark.timeout(400)]

REPOSITORY = Path(__file__).parents[3]
HOSTS = ("main", "second")
STEPS = 8
SSHD = """\
ListenAddress {address}
HostKey {keys}/host
AuthorizedKeysFile {keys}/user.pub
StrictModes no
UsePAM no
PasswordAuthentication no
PidFile none
SetEnv PATH={programs}:{python}:/usr/bin:/bin PIP_NO_DEPS=1
"""
"""pip finds no dependencies on a host without the internet."""
HOST = """\
mkdir -p /run/sshd &&
mount --bind {host}/passwd /etc/passwd &&
mkdir -p /etc/systemd/system &&
mount --bind {host}/units /etc/systemd/system &&
exec {sshd} -D -e -f {host}/sshd_config
"""
"""A host of its own as far as deploying sees it: a user with a home, and a directory of units."""
PROGRAMS = {
    "sudo": 'shift; exec "$@"',
    "systemctl": 'echo "$*" >> "$HOME/systemctl.log"',
}
"""Stand-ins on the hosts: sudo needs no password, and there is no systemd."""


class Hosts:
    """Hosts with an sshd each.

    Parameters
    ----------
    directory
        Everything is in it.
    net
        Joins them.
    """

    def __init__(self, directory: Path, net: NetworkNamespaces) -> None:
        self._net = net
        self.fleet = directory / "lab.toml"
        self._bin = directory / "bin"
        self.wheel: Path
        self._homes = {host: directory / host / "home" for host in HOSTS}
        self.units = {host: directory / host / "units" for host in HOSTS}

    def home(self, host: str) -> Path:
        """Of the user `lab` on a host."""
        return self._homes[host]

    def deploy(self, *options: str) -> list[str]:
        """What `rcopterx deploy` says, given on the first host."""
        words = ["-m", "rcopterx", "deploy", str(self.fleet), "--wheel", str(self.wheel), "--user", "lab"]
        done = subprocess.run(
            self._net.python(HOSTS[0], *words, *options),
            env=os.environ | {"PATH": f"{self._bin}:{os.environ['PATH']}"},
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        return done.stdout.splitlines()

    def files(self, host: str) -> dict[str, tuple[int, int]]:
        """Mode and time of the last change of everything on a host."""
        found = {}
        for place in (self._homes[host], self.units[host]):
            for path in place.rglob("*"):
                about = path.lstat()
                found[str(path)] = (about.st_mode, about.st_mtime_ns)
        return found


@pytest.fixture(scope="module")
def hosts(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Hosts]:
    sshd = shutil.which("sshd", path=f"{os.environ['PATH']}:/usr/sbin")
    if sshd is None:
        pytest.skip("there is no sshd (package openssh-server)")
    directory = tmp_path_factory.mktemp("hosts")
    with ExitStack() as stack:
        # Hosts share their file system, so that only what lies in a home is one's own.
        stack.enter_context(pytest.MonkeyPatch.context()).setenv("HOME", str(directory))
        net = stack.enter_context(network_or_skip(HOSTS))
        made = Hosts(directory, net)
        _make_keys(directory, net)
        for host in HOSTS:
            stack.enter_context(_host(directory / host, net, host, sshd))
        made.fleet.write_text(
            PAIR
            + '[security]\ncertificates = "~/certificates"\n'
            + "".join(f'[hosts.{host}]\naddress = "{net.addresses[host]}"\n' for host in HOSTS)
        )
        make_certificates(load_fleet(made.fleet), datetime.now(UTC), days=10)
        made.wheel = _wheel(directory)
        yield made


def _make_keys(directory: Path, net: NetworkNamespaces) -> None:
    keys = directory / "keys"
    keys.mkdir()
    for name in ("host", "user"):
        subprocess.run(["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", keys / name], check=True)
    public = (keys / "host.pub").read_text()
    (keys / "known_hosts").write_text("".join(f"{address} {public}" for address in net.addresses.values()))
    (directory / "ssh_config").write_text(
        f"IdentityFile {keys}/user\nUserKnownHostsFile {keys}/known_hosts\nStrictHostKeyChecking yes\n"
    )
    programs = directory / "bin"
    programs.mkdir()
    # Settings of a user are found by its entry in passwd, which is none of a test's business.
    (programs / "ssh").write_text(f'#!/bin/sh\nexec {shutil.which("ssh")} -F {directory}/ssh_config "$@"\n')
    (programs / "ssh").chmod(0o755)


@contextmanager
def _host(directory: Path, net: NetworkNamespaces, host: str, sshd: str) -> Iterator[None]:
    for name in ("home", "units", "bin"):
        (directory / name).mkdir(parents=True)
    for name, text in PROGRAMS.items():
        (directory / "bin" / name).write_text(f"#!/bin/sh\n{text}\n")
        (directory / "bin" / name).chmod(0o755)
    user = f"lab:x:0:0::{directory / 'home'}:/bin/sh\n"
    (directory / "passwd").write_text(user + Path("/etc/passwd").read_text())
    (directory / "sshd_config").write_text(
        SSHD.format(
            address=net.addresses[host],
            keys=directory.parent / "keys",
            programs=directory / "bin",
            python=Path(sys.base_prefix) / "bin",
        )
    )
    start = HOST.format(host=directory, sshd=sshd)
    with (directory / "sshd.log").open("wb") as log:
        process = subprocess.Popen(
            ["ip", "netns", "exec", net.namespace(host), "sh", "-c", start], stdout=log, stderr=log
        )
    try:
        wait_for(
            lambda: "listening" in (directory / "sshd.log").read_text(),
            "sshd does not start",
            deadline_s=20,
        )
        yield
    finally:
        process.terminate()
        process.wait(20)


def _wheel(directory: Path) -> Path:
    """The software as it is, as a wheel."""
    subprocess.run(
        [
            sys.executable,
            "-m",
            "pip",
            "wheel",
            "-q",
            "--no-deps",
            "--no-build-isolation",
            "-w",
            directory,
            ".",
        ],
        cwd=REPOSITORY,
        check=True,
    )
    return next(directory.glob("*.whl"))


def test_a_dry_run_says_what_every_host_lacks_and_changes_nothing(hosts: Hosts) -> None:
    said = hosts.deploy("--dry-run")
    for host in HOSTS:
        assert len([line for line in said if line.startswith(f"{host}: to do: ")]) == STEPS
        assert hosts.files(host) == {}


def test_everything_is_brought_to_every_host_and_a_repetition_changes_nothing(hosts: Hosts) -> None:
    said = hosts.deploy()
    for host in HOSTS:
        home = hosts.home(host)
        assert len([line for line in said if line.startswith(f"{host}: done: ")]) == STEPS
        assert (home / "rcopterx" / "lab.toml").read_bytes() == hosts.fleet.read_bytes()
        assert stat.S_IMODE((home / "certificates" / f"host.{host}.key").stat().st_mode) == 0o600
        assert not (home / "certificates" / "authority.key").exists()
        installed = home / "rcopterx" / "venv" / "bin" / "rcopterx"
        assert os.access(installed, os.X_OK)
        unit = (hosts.units[host] / "rcopterx-lab.service").read_text()
        assert f"ExecStart={installed} host lab.toml --host {host}" in unit
        assert "User=lab" in unit
        assert (home / "systemctl.log").read_text().splitlines()[-1] == "enable --quiet rcopterx-lab.service"
        assert f"{host}: while nothing flies: sudo systemctl restart rcopterx-lab.service" in said
    before = {host: hosts.files(host) for host in HOSTS}
    again = hosts.deploy()
    assert again == [line.replace(": done: ", ": there: ") for line in said if ": done: " in line]
    assert {host: hosts.files(host) for host in HOSTS} == before


def test_an_update_brings_only_what_changed(hosts: Hosts) -> None:
    hosts.deploy()
    hosts.fleet.write_text(hosts.fleet.read_text() + "# a remark\n")
    said = hosts.deploy("--host", "second")
    assert [line for line in said if ": done: " in line] == ["second: done: rcopterx/lab.toml"]
    assert stat.S_IMODE((hosts.home("second") / "rcopterx" / "lab.toml").stat().st_mode) == 0o644
