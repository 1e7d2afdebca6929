"""The programs of one host for `rcopterx.benchmarks.message_load`: they publish and listen, and nothing else.

    python -m rcopterx.benchmarks.message_programs ROUTER HOST HOSTS VEHICLES

says that it is ready by a line, begins to measure when it reads one, and tells its figures after another.
"""

import json
import math
import struct
import sys
import threading
import time
from collections.abc import Callable, Iterable, Sequence
from typing import Any, Final

import zenoh
from zenoh.handlers import Callback, RingChannel

from rcopterx.benchmarks.message_load import BYTES, FLEET, Listening, Stream, listenings, name_of, streams
from rcopterx.bus import channels
from rcopterx.bus.channels import Channel
from rcopterx.bus.endpoints import client_config, open_session
from rcopterx.ground_station.report.statistics import percentiles

PERIOD_S: Final = 0.02
AGENTS_AFTER_S: Final = 0.004
"""Plans and commands come so long after the poses that they are for."""
PRIORITIES: Final = {
    channels.REAL_TIME: zenoh.Priority.REAL_TIME,
    channels.INTERACTIVE_HIGH: zenoh.Priority.INTERACTIVE_HIGH,
    channels.DATA_HIGH: zenoh.Priority.DATA_HIGH,
    channels.DATA_LOW: zenoh.Priority.DATA_LOW,
}
_STAMP: Final = struct.Struct("<d")


class Probe:
    """Arrivals of one stream.

    Hosts are processes of one computer, so that their clocks agree.
    """

    def __init__(self) -> None:
        self._delays_s: list[float] = []
        self._since_s = time.monotonic()

    def __call__(self, sample: zenoh.Sample) -> None:
        """Take in a message."""
        self._delays_s.append(time.monotonic() - _STAMP.unpack_from(sample.payload.to_bytes())[0])

    def begin(self) -> None:
        """Count from now on."""
        self._delays_s, self._since_s = [], time.monotonic()

    def figures(self, rate_hz: float) -> dict[str, float]:
        """Which share of a stream of that rate has arrived, and after how long; infinite if nothing has."""
        expected = rate_hz * (time.monotonic() - self._since_s)
        times = percentiles([1e3 * delay_s for delay_s in self._delays_s])
        if times is None:
            return {"arrived": 0.0, "p50_ms": math.inf, "p99_ms": math.inf}
        return {"arrived": len(self._delays_s) / expected, "p50_ms": times["p50"], "p99_ms": times["p99"]}


class Programs:
    """All programs of a host, each with a seat of its own on the bus.

    Parameters
    ----------
    router
        Endpoint of the host's router.
    host, said, heard
        Which host, and what is published and subscribed to on all of them.
    """

    def __init__(self, router: str, host: int, said: Sequence[Stream], heard: Sequence[Listening]) -> None:
        self._said = [stream for stream in said if stream.host == host]
        heard = [listening for listening in heard if listening.host == host]
        names = [*(one.program for one in self._said), *(one.program for one in heard)]
        self._seats = {
            name: open_session(client_config([router], None, 10.0)) for name in dict.fromkeys(names)
        }
        first = name_of(host, 0)
        self.probes: dict[Channel[Any], Probe] = {channels.COMMAND: Probe(), channels.POSE: Probe()}
        probed = {("gateway", channels.COMMAND): first, (first, channels.POSE): first}
        # Others let Zenoh keep the newest message: no Python runs for it.
        self._subscribers: list[Any] = [
            self._seats[one.program].declare_subscriber(
                key_of(one),
                Callback(self.probes[one.channel], indirect=False)
                if probed.get((one.program, one.channel)) == one.vehicle
                else RingChannel(1),
            )
            for one in heard
        ]
        self._publishers = {
            stream: self._seats[stream.program].declare_publisher(
                key_of(stream),
                congestion_control=zenoh.CongestionControl.DROP,
                priority=PRIORITIES[stream.channel.priority],
            )
            for stream in self._said
        }

    def publish(self, ended: threading.Event) -> None:
        """Publish everything at its rate until the end."""
        first = [stream for stream in self._said if stream.channel is channels.POSE]
        then = [stream for stream in self._said if stream.channel is not channels.POSE]
        tick, at_s = 0, time.monotonic()
        while not ended.is_set():
            self._put(first, tick)
            _sleep_until(at_s + AGENTS_AFTER_S)
            self._put(then, tick)
            tick, at_s = tick + 1, at_s + PERIOD_S
            _sleep_until(at_s)

    def _put(self, due: Iterable[Stream], tick: int) -> None:
        for number, stream in enumerate(due):
            every = round(1 / (stream.channel.rate_hz * PERIOD_S))
            if (tick + number) % every == 0:
                payload = _STAMP.pack(time.monotonic()) + bytes(BYTES[stream.channel] - _STAMP.size)
                self._publishers[stream].put(payload)


def key_of(of: Stream | Listening) -> str:
    """Key of what is published or subscribed to."""
    return channels.key(FLEET, of.vehicle, of.channel.topic)


def _sleep_until(moment_s: float) -> None:
    time.sleep(max(0.0, moment_s - time.monotonic()))


def main(arguments: Sequence[str], read: Callable[[], str], say: Callable[[str], None]) -> None:
    """Publish until there is nothing more to read."""
    router, (host, hosts, vehicles) = arguments[0], map(int, arguments[1:])
    programs = Programs(router, host, streams(hosts, vehicles), listenings(hosts, vehicles))
    ended = threading.Event()
    publisher = threading.Thread(target=programs.publish, args=(ended,))
    publisher.start()
    try:
        say("ready")
        while order := read().strip():
            if order == "measure":
                for probe in programs.probes.values():
                    probe.begin()
            else:
                say(json.dumps({c.topic: p.figures(c.rate_hz) for c, p in programs.probes.items()}))
    finally:
        ended.set()
        publisher.join()


if __name__ == "__main__":
    main(sys.argv[1:], sys.stdin.readline, lambda line: print(line, flush=True))
