"""Fly a vehicle of a running rcopterx fleet from any Python program; needs only eclipse-zenoh and msgpack.

    with ExternalControl("lab", "h2") as vehicle:
        while True:
            task = vehicle.next_task()
            vehicle.answer(task, [my_law(task)])

All values are plain numbers and lists, so that MATLAB and other languages with a Python interface can use it.
"""

import contextlib
import json
import os
import pathlib
import queue
import struct
import tempfile

import msgpack
import zenoh


def router_of(fleet):
    """Endpoint of the router of a fleet that is up on this computer, from the record in its run directory."""
    chosen, runtime = os.environ.get("RCOPTERX_RUN"), os.environ.get("XDG_RUNTIME_DIR", "")
    usual = (
        pathlib.Path(runtime, "rcopterx"),
        pathlib.Path(tempfile.gettempdir(), f"rcopterx-{os.getuid()}"),
    )
    places = (pathlib.Path(chosen),) if chosen else usual
    for path in (found for place in places for found in place.glob("*/up-*.json")):
        record = json.loads(path.read_text())
        if record["fleet"] == fleet:
            return record["endpoints"][0]
    raise RuntimeError(f"{fleet} is not up on this computer; give the address of its router")


class ExternalControl:
    """Authority over one vehicle, from `take` (or entering a `with` block) to `release`.

    `fleet` is the name in the fleet file; `name` is the name of this program in small letters, digits and
    underscores; `router` is the address of the fleet's router, needed on another computer; `namespace` is
    that of the bus, if the fleet file sets one. In a fleet with certificates, `certificates` is the directory
    with `authority.pem` and the two files of `program.VEHICLE`.
    """

    def __init__(self, fleet, vehicle, name="my_controller", router=None, namespace=None, certificates=None):
        settings = {
            "mode": "client",
            "connect": {"endpoints": [router or router_of(fleet)]},
            "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}},
        }
        if namespace:
            settings["namespace"] = namespace
        if certificates:
            settings["transport"] = {"link": {"protocols": ["tls"], "tls": _tls(certificates, vehicle)}}
        self._session = zenoh.open(zenoh.Config.from_json5(json.dumps(settings)))
        self._name = name
        self._prefix = f"rcopterx/{fleet}/{vehicle}"
        self._tasks = queue.SimpleQueue()
        self._subscriber = self._session.declare_subscriber(f"{self._prefix}/control_task", self._on_task)
        self._publisher = self._session.declare_publisher(
            f"{self._prefix}/external_input",
            congestion_control=zenoh.CongestionControl.DROP,
            priority=zenoh.Priority.REAL_TIME,
        )

    def _on_task(self, sample):
        message = msgpack.unpackb(sample.payload.to_bytes())
        if message["client"] != self._name:
            return
        message["reference"] = _rows(message["reference"])
        self._tasks.put(message)

    def take(self, patience_s=0.1):
        """Take control of the vehicle, which must fly; raises RuntimeError with the reason of a refusal."""
        self._request("take_control", {"source": self._name, "patience_s": float(patience_s)})

    def release(self):
        """Return control to the vehicle's own controller."""
        self._request("release_control", {"source": self._name})

    def next_task(self, timeout_s=1.0):
        """Wait for the newest task: a dict with state, reference and limits (docs/messages.md, control_task).

        Raises TimeoutError if none comes: control is lost, or the vehicle's agent is gone.
        """
        try:
            task = self._tasks.get(timeout=float(timeout_s))
        except queue.Empty:
            raise TimeoutError(f"no task for {timeout_s} s: control is lost, or the agent is gone") from None
        while not self._tasks.empty():
            task = self._tasks.get()
        return task

    def answer(self, task, inputs):
        """Send planned inputs from the moment of the task on: rows of pitch, roll, thrust, yaw.

        One row is enough; further ones are flown if later answers are late.
        """
        rows = [[float(value) for value in row] for row in inputs]
        data = b"".join(struct.pack("<4d", *row) for row in rows)
        message = {
            "source": self._name,
            "number": int(task["number"]),
            "inputs": {"shape": [len(rows), 4], "data": data},
        }
        self._publisher.put(msgpack.packb(message))

    def close(self):
        """Leave the bus."""
        self._session.close()

    def __enter__(self):
        """Take control."""
        self.take()
        return self

    def __exit__(self, *_):
        """Return control, unless it was lost before."""
        with contextlib.suppress(RuntimeError):
            self.release()
        self.close()

    def _request(self, verb, body):
        for reply in self._session.get(
            f"{self._prefix}/request/{verb}", payload=msgpack.packb(body), timeout=2.0
        ):
            if reply.ok is None:
                raise RuntimeError(reply.err.payload.to_bytes().decode(errors="replace"))
            answer = msgpack.unpackb(reply.ok.payload.to_bytes())
            if not answer["accepted"]:
                raise RuntimeError(answer["reason"])
            return
        raise RuntimeError(f"no process serves {self._prefix}/request/{verb}: is the fleet up?")


def _tls(directory, vehicle):
    own = pathlib.Path(directory, f"program.{vehicle}")
    return {
        "root_ca_certificate": str(pathlib.Path(directory, "authority.pem")),
        "enable_mtls": True,
        "connect_certificate": f"{own}.pem",
        "connect_private_key": f"{own}.key",
    }


def _rows(array):
    rows, columns = array["shape"]
    values = struct.unpack(f"<{rows * columns}d", array["data"])
    return [list(values[row * columns : (row + 1) * columns]) for row in range(rows)]
