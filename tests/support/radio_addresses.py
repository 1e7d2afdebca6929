"""Addresses of emulated Crazyflies in reach of one emulated Crazyradio."""


def radio_paths(count: int) -> list[str]:
    """Addresses on one channel, at the highest data rate."""
    return [f"radio://0/80/2M/E7E7E7E7{number:02X}" for number in range(1, count + 1)]
