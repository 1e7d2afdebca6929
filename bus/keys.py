"""Keys of the bus; separate from the messages in `channels`, because `rcopterx kill` must start quickly."""

from typing import Final

ROOT: Final = "rcopterx"
EVERY_FLEET: Final = "all"  # in place of a fleet's name, in a key that every gateway obeys
FLEET_UNIT: Final = "fleet"
TRACKER_UNIT: Final = "tracker"
SIMULATOR_UNIT: Final = "simulator"
KILL_TOPIC: Final = "kill"
TRANSMITTER_TOPIC: Final = "transmitter"


def key(fleet: str, unit: str, topic: str) -> str:
    """Return the key of a channel of one unit: `rcopterx/<fleet>/<unit>/<topic>`."""
    return f"{ROOT}/{fleet}/{unit}/{topic}"


def request_key(fleet: str, unit: str, verb: str) -> str:
    """Return the key under which a unit serves a verb."""
    return f"{ROOT}/{fleet}/{unit}/request/{verb}"


def probe_key(fleet: str, host: str) -> str:
    """Return the key of the messages by which the router process of a host checks that it routes."""
    return f"{ROOT}/{fleet}/{host}/probe/router"
