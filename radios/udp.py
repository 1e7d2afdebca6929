"""Addresses of vehicles behind a UDP port."""

from typing import Final

from rcopterx.radios.protocol import ProtocolError
from rcopterx.user_text import TextError, host_and_port

UDP: Final = "udp://"
LONGEST_DATAGRAM: Final = 2048

Address = tuple[str, int]


def udp_address(path: str) -> Address:
    """Host and port of `udp://HOST:PORT`; raises `ProtocolError` for anything else."""
    try:
        if path.startswith(UDP):
            return host_and_port(path.removeprefix(UDP))
    except TextError:
        pass
    raise ProtocolError(f"{path!r} is no address such as udp://127.0.0.1:19850")
