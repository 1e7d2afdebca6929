"""Attempts on a running fleet that its routers must refuse; receivers reject empty messages anyway."""

import threading
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from datetime import datetime
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

import zenoh
from zenoh.handlers import Callback

from rcopterx.bus.access import published_keys, requested_keys
from rcopterx.bus.endpoints import Credentials, client_config, open_session
from rcopterx.bus.keys import ROOT, request_key
from rcopterx.bus.session import SILENT_SHARE, BusAddress, opened
from rcopterx.deploy.certificates.files import credentials, readable
from rcopterx.deploy.certificates.issuing import issue, new_authority
from rcopterx.deploy.certificates.seats import host_seats, operator_seats, subjects
from rcopterx.deploy.doctor.examination import Result
from rcopterx.fleet.schema import FleetFile

REFUSED_S: Final = 0.5  # timeout of a connection that must fail
ANSWER_S: Final = 2.0
TRIES: Final = 3  # number of attempts with a request that is neither answered nor refused in time
TIMEOUT: Final = b"Timeout"  # error that Zenoh returns for a missing answer
NOT_KNOWN: Final = "is not known: no answer in time; try again when this computer has less to do"


def strangers(fleet: FleetFile, host: str, directory: Path, now: datetime) -> Iterator[Result]:
    """Try to connect to the router of a host without encryption, and with a foreign certificate."""
    endpoint = fleet.endpoint(host)
    plain = endpoint.replace("tls/", "tcp/", 1)
    yield _refused(plain, None, f"router of {host}: a connection without encryption")
    with TemporaryDirectory(prefix="rcopterx-doctor-") as name:
        place = Path(name)
        issue(new_authority(fleet.name, place, now), place, "operator.stranger", [], now, days=1)
        stranger = credentials(place, "operator.stranger")
        trusting = Credentials(
            credentials(directory, "authority").authority, stranger.certificate, stranger.private_key
        )
        yield _refused(endpoint, trusting, f"router of {host}: a certificate of another authority")


def members(fleet: FleetFile, address: BusAddress, here: str, directory: Path) -> Iterator[Result]:
    """Try to publish and request what is not permitted, `here`, with each readable certificate."""
    seats = [seat for host in fleet.hosts for seat in host_seats(fleet, host)]
    seats += operator_seats(fleet)
    published, requested = published_keys(fleet.name, seats), requested_keys(fleet.name, seats)
    with closing(opened(address, ANSWER_S)) as listener:
        for subject in subjects(fleet, here):
            endpoint = address
            if subject.certificate is not None:
                if not readable(directory, subject.certificate):
                    continue
                shown = credentials(directory, subject.certificate)
                endpoint = BusAddress((fleet.endpoint(here),), fleet.name, address.namespace, "", shown)
            with closing(opened(endpoint, ANSWER_S)) as rogue:
                forbidden = _beyond(published, published_keys(fleet.name, subject.seats))
                yield from _results(subject.name, "publish", _published(forbidden, rogue, listener))
                forbidden = _beyond(requested, requested_keys(fleet.name, subject.seats))
                permitted = {key: _permitted(key, rogue) for key in forbidden}
                yield from _results(subject.name, "request", permitted)


def _results(name: str, verb: str, permitted: Mapping[str, bool | None]) -> Iterator[Result]:
    """Yield the findings about keys that belong to others; None stands for what is not known."""
    yield from (
        Result(False, f"{name}: may {verb} {key}, which is not its own")
        for key, passed in permitted.items()
        if passed
    )
    if unknown := sum(passed is None for passed in permitted.values()):
        yield Result(False, f"{name}: whether it may {verb} {unknown} keys that are not its own {NOT_KNOWN}")
    if not any(permitted.values()) and not unknown:
        yield Result(True, f"{name}: it may not {verb} {len(permitted)} keys that are not its own")


def _permitted(key: str, rogue: zenoh.Session) -> bool | None:
    """Whether a request gets through; None if it is neither answered nor refused in time."""
    for _ in range(TRIES):
        sent_s = time.monotonic()
        replies = list(rogue.get(key, timeout=ANSWER_S))
        if any(reply.err is None or reply.err.payload.to_bytes() != TIMEOUT for reply in replies):
            return True
        if not replies and _in_time(sent_s):
            return False
    return None


def _in_time(sent_s: float) -> bool:
    """Whether a request has ended before its timeout, which Zenoh does not always report as an error."""
    return time.monotonic() - sent_s < SILENT_SHARE * ANSWER_S


def _beyond(keys: Iterable[str], own: Iterable[str]) -> list[str]:
    """Return the keys that none of `own`, which may have wildcards, includes."""
    covering = [zenoh.KeyExpr(key) for key in own]
    return sorted(key for key in keys if not any(each.includes(zenoh.KeyExpr(key)) for each in covering))


def _published(keys: Sequence[str], rogue: zenoh.Session, listener: zenoh.Session) -> dict[str, bool | None]:
    """Return by key whether a message gets through; None if routers take too long."""
    received: set[str] = set()
    lock = threading.Lock()

    def receive(sample: zenoh.Sample) -> None:
        if not sample.payload.to_bytes():
            with lock:
                received.add(str(sample.key_expr))

    subscriber = listener.declare_subscriber(f"{ROOT}/**", Callback(receive, indirect=False))
    _round_trip(listener)
    for key in keys:
        rogue.put(key, b"")
    # A router answers after it has forwarded earlier messages, so that the listener has received them then.
    passed_on = _round_trip(rogue) and _round_trip(listener)
    subscriber.undeclare()
    with lock:
        return {key: key in received if passed_on else None for key in keys}


def _round_trip(session: zenoh.Session) -> bool:
    """Send a request to every router; return whether all answered or refused in time."""
    sent_s = time.monotonic()
    list(session.get(request_key("*", "*", "identify"), timeout=ANSWER_S, target=zenoh.QueryTarget.ALL))
    return _in_time(sent_s)


def _refused(endpoint: str, shown: Credentials | None, what: str) -> Result:
    try:
        open_session(client_config([endpoint], None, REFUSED_S, shown)).close()
    except zenoh.ZError:
        return Result(True, f"{what} is refused")
    return Result(False, f"{what} is let in")
