"""Show true states of a simulation of Crazyflies as a Tracker does; it sends them as text by UDP.

python examples/simulated_autopilots/crazyflie.py crazyflie1=19950 crazyflie2=19951

shows what arrives at the local ports: one datagram per pose, seven numbers: x, y, z [m], z up, and the
rotation from body (x forward, y left) to room as x, y, z, w.
"""

import math
import socket

from truth import main

from rcopterx.simulator.tracker_frame import TrackedBody


class TextTruth:
    """A vehicle `SUBJECT=PORT`."""

    def __init__(self, text: str) -> None:
        self._subject, _, port = text.partition("=")
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", int(port)))
        self._socket.setblocking(False)
        self._newest = TrackedBody(self._subject, (0.0, 0.0, 0.0), occluded=True)

    def body(self, now_s: float) -> TrackedBody:
        """Newest pose; occluded before the first one."""
        while True:
            try:
                x, y, z, *rotation = map(float, self._socket.recv(1024).split())
                i, j, k, w = rotation
            except BlockingIOError:
                return self._newest
            except ValueError:
                continue
            if all(map(math.isfinite, (x, y, z, i, j, k, w))):
                self._newest = TrackedBody(self._subject, (x, y, z), (i, j, k, w))


if __name__ == "__main__":
    main(__doc__, TextTruth, "SUBJECT=PORT")
