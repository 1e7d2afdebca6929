"""Disturbances of the links between the hosts of a `NetworkNamespaces`."""

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from support.namespaces import NETWORK, NetworkNamespaces

CABLE = Path(__file__).with_name("cable.py")


@contextmanager
def slow(
    net: NetworkNamespaces, host: str, delay_s: float, jitter_s: float
) -> Iterator["subprocess.Popen[str]"]:
    """Delay frames to and from a host; yields the process of the cable."""
    number = list(net.addresses).index(host)
    left, right, bridge, far = (f"{name}{number}" for name in ("left", "right", "slow", "far"))
    words = [sys.executable, str(CABLE), left, right, str(delay_s), str(jitter_s)]
    cable = subprocess.Popen(["ip", "netns", "exec", net.switch, *words], stdout=subprocess.PIPE, text=True)
    try:
        assert cable.stdout is not None
        cable.stdout.readline()
        in_switch(net, "link", "add", bridge, "type", "bridge")
        for device, master in ((left, bridge), (far, bridge), (right, "hub")):
            in_switch(net, "link", "set", device, "master", master)
        for device in (left, right, bridge):
            in_switch(net, "link", "set", device, "up")
        yield cable
    finally:
        in_switch(net, "link", "set", far, "master", "hub")
        in_switch(net, "link", "del", bridge)
        cable.terminate()
        cable.wait()


def reset(net: NetworkNamespaces, host: str) -> None:
    """Reset all connections of a host to others, as a firewall that was restarted does."""
    subprocess.run(
        ["ip", "netns", "exec", net.namespace(host), "ss", "-K", "-t", "dst", f"{NETWORK}.0/24"],
        check=True,
        capture_output=True,
    )


def in_switch(net: NetworkNamespaces, *words: str) -> None:
    """Run `ip` between the hosts."""
    subprocess.run(["ip", "-n", net.switch, *words], check=True, capture_output=True)
