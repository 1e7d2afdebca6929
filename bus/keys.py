"""How keys of the bus are made; `rcopterx.bus.channels` is the table of what travels under them.

Apart from that table because `rcopterx kill` needs keys and has no time to import message types.
"""

from typing import Final

ROOT: Final = "rcopterx"
EVERY_FLEET: Final = "all"
"""Stands for the name of a fleet in the key that transmitter gateways of every fleet obey."""
FLEET_UNIT: Final = "fleet"
TRACKER_UNIT: Final = "tracker"
SIMULATOR_UNIT: Final = "simulator"
KILL_TOPIC: Final = "kill"
TRANSMITTER_TOPIC: Final = "transmitter"


def key(fleet: str, unit: str, topic: str) -> str:
    """Key of a channel of one unit: `rcopterx/<fleet>/<unit>/<topic>`."""
    return f"{ROOT}/{fleet}/{unit}/{topic}"


def request_key(fleet: str, unit: str, verb: str) -> str:
    """Key under which a unit serves a verb."""
    return f"{ROOT}/{fleet}/{unit}/request/{verb}"


def alive_key(fleet: str, unit: str, role: str) -> str:
    """Key of the liveliness token of a role."""
    return f"{ROOT}/{fleet}/{unit}/alive/{role}"


def probe_key(fleet: str, host: str) -> str:
    """Key under which the router process of a host sends messages to itself to see that it routes."""
    return f"{ROOT}/{fleet}/{host}/probe/router"
