"""Addresses of vehicles behind a UDP port."""

from typing import Final

from rcopterx.radios.protocol import ProtocolError

UDP: Final = "udp://"
LONGEST_DATAGRAM: Final = 2048

Address = tuple[str, int]


def udp_address(path: str) -> Address:
    """Host and port of `udp://HOST:PORT`; raises `ProtocolError` for anything else."""
    host, _, port = path.removeprefix(UDP).rpartition(":")
    if not path.startswith(UDP) or not host or not port.isdecimal() or not 0 < int(port) < 65536:
        raise ProtocolError(f"{path!r} is no address such as udp://127.0.0.1:19850")
    return host, int(port)
