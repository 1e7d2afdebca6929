"""TCP sockets of the links of this process; Zenoh reacts at once when one of them is shut down."""

import os
import socket
import struct
from collections.abc import Iterator
from contextlib import suppress
from typing import Final

from rcopterx.bus.link_watch import RouterLink

DIAL_LIMIT_S: Final = 0.06  # connecting takes 1 ms in a laboratory; TCP repeats a lost request after 1 s
LONGEST_DIAL_S: Final = 0.25  # for hosts at the end of a slow network
PATIENCE_GROWTH: Final = 0.01  # how much longer an attempt may take, per second in which a host is missing
RETRANSMIT_US: Final = 10_000
TCP_THIN_LINEAR_TIMEOUTS: Final = 16
TCP_RTO_MIN_US: Final = 45  # socket options of Linux, the second since 6.15; Python does not name them
CONGESTION_CONTROL: Final = "bbr"
HASTE: Final[tuple[tuple[int, int | bytes], ...]] = (
    (TCP_THIN_LINEAR_TIMEOUTS, 1),
    (TCP_RTO_MIN_US, RETRANSMIT_US),
    # Losses on a fast link leave CUBIC a window of few packets: when the delay of the link then grows,
    # commands wait behind plans for a second. Where BBR is not permitted, the system's default stays.
    (socket.TCP_CONGESTION, CONGESTION_CONTROL.encode()),
)
SYN_SENT: Final = 2  # state of a TCP socket that waits for the answer to its request for a connection


def congestion_control() -> str:
    """Return the congestion control of links: `CONGESTION_CONTROL` where this computer permits it."""
    with socket.socket() as probe:
        with suppress(OSError):
            probe.setsockopt(socket.IPPROTO_TCP, socket.TCP_CONGESTION, CONGESTION_CONTROL.encode())
        return probe.getsockopt(socket.IPPROTO_TCP, socket.TCP_CONGESTION, 16).rstrip(b"\0").decode()


def close_link(link: RouterLink) -> bool:
    """Shut down the socket of a link; return False if there is none."""
    found = False
    for opened in _sockets():
        if _ends(opened) == (link.local, link.remote):
            # Zenoh lets sockets linger: closing would block it until what is stored is delivered, up to 10 s.
            opened.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            with suppress(OSError):
                opened.shutdown(socket.SHUT_RDWR)
            found = True
    return found


def hasten(link: RouterLink) -> None:
    """Retransmit lost packets of a link after 10 ms instead of 200 ms, where the kernel can.

    With CUBIC the pause stays for six retransmissions while fewer than four packets are under way.
    """
    for opened in _sockets():
        if _ends(opened) == (link.local, link.remote):
            for option, value in HASTE:
                with suppress(OSError):
                    opened.setsockopt(socket.IPPROTO_TCP, option, value)


class Dials:
    """Connections of this process that are being established."""

    def __init__(self) -> None:
        self._since_s: dict[int, float] = {}

    def abandon_lost(self, now_s: float, missing_s: float) -> int:
        """End attempts whose request was lost; their limit grows with `missing_s`. Return how many ended."""
        limit_s = min(LONGEST_DIAL_S, DIAL_LIMIT_S + PATIENCE_GROWTH * missing_s)
        since_s: dict[int, float] = {}
        abandoned = 0
        for opened in _sockets():
            if opened.getsockopt(socket.IPPROTO_TCP, socket.TCP_INFO, 1)[0] != SYN_SENT:
                continue
            inode = os.fstat(opened.fileno()).st_ino
            since_s[inode] = self._since_s.get(inode, now_s)
            if now_s - since_s[inode] > limit_s:
                with suppress(OSError):
                    opened.shutdown(socket.SHUT_RDWR)
                abandoned += 1
        self._since_s = since_s
        return abandoned


def _sockets() -> Iterator[socket.socket]:
    for name in os.listdir("/proc/self/fd"):
        try:
            descriptor = os.dup(int(name))
        except OSError:
            # Closed in this moment.
            continue
        try:
            copy = socket.socket(fileno=descriptor)
        except OSError:
            os.close(descriptor)
            continue
        with copy:
            if copy.family in (socket.AF_INET, socket.AF_INET6) and copy.type == socket.SOCK_STREAM:
                yield copy


def _ends(opened: socket.socket) -> tuple[tuple[str, int], tuple[str, int]] | None:
    try:
        return opened.getsockname()[:2], opened.getpeername()[:2]
    except OSError:
        return None
