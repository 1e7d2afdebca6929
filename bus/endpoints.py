"""Zenoh configurations of routers and clients."""

import json
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import zenoh

QUEUE_SIZE = 16  # batches of 64 kB that wait for one client, the most that Zenoh permits
LEASE_MS = 1000
PATIENT_LEASE_MS: Final = 100 * LEASE_MS  # in lockstep, where no process has to be in time
LONG_S: Final = 600.0  # longest wait in real time for an answer that always comes
_QUICK: Final = "real_time", "interactive_high"
# In lockstep nothing is dropped: a queue that is full would block the thread of the router that empties it.
_ALL: Final = *_QUICK, "interactive_low", "data_high", "data", "data_low"
_THREADS: Final = "ZENOH_RUNTIME", "(rx: (handover: app), tx: (handover: app), acc: (handover: app))"
"""Environment variable of Zenoh: one thread reads, handles and writes each message instead of three."""
_SOURCE_PLACE = re.compile(r" at /\S+\.rs:\d+\.?")


@dataclass(frozen=True)
class Credentials:
    """Paths of the certificate of the fleet's authority, and of the process's own certificate and key."""

    authority: str
    certificate: str
    private_key: str


@dataclass(frozen=True)
class Protection:
    """Certificate of a router, and its rules from `rcopterx.bus.access`."""

    credentials: Credentials
    access_control: Mapping[str, object]


def open_session(config: zenoh.Config) -> zenoh.Session:
    """Open a Zenoh session, all of which share the threads of the process; may raise `zenoh.ZError`."""
    os.environ.setdefault(*_THREADS)
    return zenoh.open(config)


def router_config(
    listen: list[str],
    connect: list[str],
    namespace: str | None,
    protection: Protection | None = None,
    *,
    patient: bool = False,
) -> zenoh.Config:
    """Return the configuration of the router of a host, without discovery; links to `connect` are retried.

    `protection` None admits every client. A `patient` router waits for clients that get no processor.
    """
    settings = _common(namespace, None if protection is None else protection.credentials, patient) | {
        "mode": "router",
        "listen": {"endpoints": listen},
        "connect": {
            "endpoints": connect,
            "timeout_ms": -1,
            "exit_on_failure": False,
            "retry": {"period_init_ms": 20, "period_max_ms": 30, "period_increase_factor": 1.5},
        },
    }
    if protection is not None:
        settings["access_control"] = protection.access_control
    return zenoh.Config.from_json5(json.dumps(settings))


def client_config(
    endpoints: list[str],
    namespace: str | None,
    timeout_s: float,
    credentials: Credentials | None = None,
    *,
    patient: bool = False,
) -> zenoh.Config:
    """Return the configuration of a client of its host's router, which reconnects automatically."""
    settings = _common(namespace, credentials, patient) | {
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
    """Return Zenoh's message without positions in its source code."""
    return _SOURCE_PLACE.sub("", str(error))


def _common(namespace: str | None, credentials: Credentials | None, patient: bool) -> dict[str, object]:
    settings: dict[str, object] = {
        "scouting": {"delay": 0, "multicast": {"enabled": False}, "gossip": {"enabled": False}},
        "queries_default_timeout": 500,
        "transport": {
            "unicast": {"max_sessions": 128, "open_timeout": 2000, "accept_timeout": 2000},
            "link": {
                "protocols": ["tcp" if credentials is None else "tls", "unixsock-stream"],
                **({} if credentials is None else {"tls": _tls(credentials)}),
                "rx": {"max_message_size": 65536},
                "tx": {
                    "lease": PATIENT_LEASE_MS if patient else LEASE_MS,
                    "keep_alive": 4,
                    "queue": {"size": dict.fromkeys(_ALL if patient else _QUICK, QUEUE_SIZE)},
                },
            },
            "shared_memory": {"enabled": False},
        },
    }
    if namespace:
        settings["namespace"] = namespace
    return settings


def _tls(credentials: Credentials) -> dict[str, object]:
    return {
        "root_ca_certificate": credentials.authority,
        "enable_mtls": True,
        "verify_name_on_connect": True,
        "listen_certificate": credentials.certificate,
        "listen_private_key": credentials.private_key,
        "connect_certificate": credentials.certificate,
        "connect_private_key": credentials.private_key,
        # A certificate that expires in flight must not end the flight; the next connection is refused.
        "close_link_on_expiration": False,
    }
