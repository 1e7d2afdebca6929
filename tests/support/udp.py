"""Free addresses for emulated Crazyflies."""

import socket

from support.bus import free_port


def udp_paths(count: int) -> list[str]:
    """Addresses on free ports, all different."""
    ports: set[int] = set()
    while len(ports) < count:
        ports.add(free_port(kind=socket.SOCK_DGRAM))
    return [f"udp://127.0.0.1:{port}" for port in ports]
