"""Zenoh configurations of routers and clients."""

import json
import os
import re
from collections.abc import Mapping
from copy import deepcopy
from dataclasses import dataclass
from typing import Any, Final

import zenoh

from rcopterx.tables import table_beside

LEASE_MS = 1000
PATIENT_LEASE_MS: Final = 100 * LEASE_MS  # in lockstep, where no process has to be in time
LONG_S: Final = 600.0  # longest wait in real time for an answer that always comes
_TABLE: Final = table_beside(__file__, "zenoh")
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
    credentials = None if protection is None else protection.credentials
    settings = _settings("router", connect, namespace, credentials, patient)
    settings["listen"] = {"endpoints": listen}
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
    settings = _settings("client", endpoints, namespace, credentials, patient)
    settings["connect"]["timeout_ms"] = int(timeout_s * 1000)
    return zenoh.Config.from_json5(json.dumps(settings))


def reason_of(error: zenoh.ZError) -> str:
    """Return Zenoh's message without positions in its source code."""
    return _SOURCE_PLACE.sub("", str(error))


def _settings(
    mode: str, endpoints: list[str], namespace: str | None, credentials: Credentials | None, patient: bool
) -> dict[str, Any]:
    """Return the settings of a mode in `zenoh.toml`, to connect to these endpoints."""
    settings: dict[str, Any] = deepcopy(_TABLE["common"] | _TABLE[mode])
    settings["connect"]["endpoints"] = endpoints
    link = settings["transport"]["link"]
    link["protocols"] = ["tcp" if credentials is None else "tls", "unixsock-stream"]
    link["tx"]["lease"] = PATIENT_LEASE_MS if patient else LEASE_MS
    link["tx"]["queue"] = {"size": _TABLE["patient_queue" if patient else "queue"]}
    if credentials is not None:
        files = {key: getattr(credentials, field) for key, field in _TABLE["tls_files"].items()}
        link["tls"] = _TABLE["tls"] | files
    if namespace:
        settings["namespace"] = namespace
    return settings
