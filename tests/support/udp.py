"""Free addresses for emulated Crazyflies."""

import socket


def udp_paths(count: int) -> list[str]:
    """Addresses on free ports; the sockets that find them are open together, so that all differ."""
    sockets = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(count)]
    for one in sockets:
        one.bind(("127.0.0.1", 0))
    ports = [one.getsockname()[1] for one in sockets]
    for one in sockets:
        one.close()
    return [f"udp://127.0.0.1:{port}" for port in ports]
