"""Zenoh configurations of routers and clients (zenoh_bus.md section 7.2)."""

import json
import re

import zenoh

QUEUE_SIZE = 16
LEASE_MS = 1000
_SOURCE_PLACE = re.compile(r" at /\S+\.rs:\d+\.?")


def router_config(listen: list[str], connect: list[str], namespace: str | None) -> zenoh.Config:
    """Configuration of the router of a host.

    Parameters
    ----------
    listen
        Endpoints the clients and routers of other hosts connect to, for instance `tcp/127.0.0.1:7447`.
    connect
        Routers of other hosts to link to; retried in the background.
    namespace
        Prefix that keeps fleets of tests apart, or None.

    Returns
    -------
    zenoh.Config
        Router mode, no discovery of any kind.
    """
    settings = _common(namespace) | {
        "mode": "router",
        "listen": {"endpoints": listen},
        "connect": {
            "endpoints": connect,
            "timeout_ms": -1,
            "exit_on_failure": False,
            "retry": {"period_init_ms": 20, "period_max_ms": 50, "period_increase_factor": 1.5},
        },
    }
    return zenoh.Config.from_json5(json.dumps(settings))


def client_config(endpoints: list[str], namespace: str | None, timeout_s: float) -> zenoh.Config:
    """Configuration of every other process: a client of its host's router.

    Parameters
    ----------
    endpoints
        Endpoints of the router.
    namespace
        As for the router.
    timeout_s
        How long opening may take.

    Returns
    -------
    zenoh.Config
        Client mode with automatic reconnection.
    """
    settings = _common(namespace) | {
        "mode": "client",
        "connect": {
            "endpoints": endpoints,
            "timeout_ms": int(timeout_s * 1000),
            "exit_on_failure": True,
            "retry": {"period_init_ms": 20, "period_max_ms": 100, "period_increase_factor": 1.5},
        },
    }
    return zenoh.Config.from_json5(json.dumps(settings))


def reason_of(error: zenoh.ZError) -> str:
    """What Zenoh says, without the places in its own source code."""
    return _SOURCE_PLACE.sub("", str(error))


def _common(namespace: str | None) -> dict[str, object]:
    settings: dict[str, object] = {
        "scouting": {"delay": 0, "multicast": {"enabled": False}, "gossip": {"enabled": False}},
        "queries_default_timeout": 500,
        "transport": {
            "unicast": {"max_sessions": 128, "open_timeout": 2000, "accept_timeout": 2000},
            "link": {
                "protocols": ["tcp", "unixsock-stream"],
                "rx": {"max_message_size": 65536},
                "tx": {
                    "lease": LEASE_MS,
                    "keep_alive": 4,
                    "queue": {"size": {"real_time": QUEUE_SIZE, "interactive_high": QUEUE_SIZE}},
                },
            },
            "shared_memory": {"enabled": False},
        },
    }
    if namespace:
        settings["namespace"] = namespace
    return settings
