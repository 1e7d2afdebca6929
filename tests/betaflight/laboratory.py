"""A laboratory outside rcopterx, in real time: quadrotors under Betaflight, radio modules, a Tracker.

    python -m tests.betaflight.laboratory DIRECTORY PORT SUBJECT=RADIO ...

needs what `firmware.build` leaves in DIRECTORY, listens as Tracker on PORT, offers each RADIO as a serial
port, and prints true states as JSON, a line per frame. Bytes of a radio pass the emulated Multiprotocol
module and receiver; the pulse widths of the receiver are what the firmware gets.
"""

import json
import random
import select
import signal
import sys
import time
from collections import deque
from pathlib import Path

from rcopterx.simulator.radio import RadioLink, RadioPty
from rcopterx.simulator.radio_multi import MultiModule
from rcopterx.simulator.radio_receiver import Receiver
from rcopterx.simulator.tracker import TrackerServer
from rcopterx.simulator.tracker_frame import TrackedBody, TrackerFrame
from tests.betaflight.airframe import Airframe, Weather
from tests.betaflight.firmware import BINARY, Firmware

RATE_HZ = 100.0
STEP_S = 0.002
STICKS_EVERY = 5
"""Steps between two packets of pulse widths."""
BOOT_S = 3.0
"""Before, the firmware would overwrite its source of sticks."""
SPACING_M = 0.6
DRAUGHT_M_S2 = 0.15
NOISE_M, NOISE_RAD = 0.0003, 0.002
# As docs/flight_controllers.md says; receiver pulses arrive as they are.
SETUP = (
    "map TAER1234",
    *(f"rxrange {channel} 1100 1900" for channel in range(4)),
    "aux 0 0 0 1700 2100 0 0",
    "aux 1 1 1 900 2100 0 0",
    "set angle_limit = 30",
    "set rates_type = ACTUAL",
    *(
        f"set {axis}_{setting}"
        for axis in ("roll", "pitch", "yaw")
        for setting in ("rc_rate = 20", "srate = 20", "expo = 0")
    ),
    "set small_angle = 25",
    "set failsafe_delay = 4",
    "set failsafe_procedure = DROP",
    "set acc_calibration = 0,0,0,1",
    "feature -AIRMODE",
)


class Vehicle:
    """One quadrotor between its serial line and its pose."""

    def __init__(self, directory: Path, radio: tuple[str, ...], number: int, start_s: float) -> None:
        self.subject, port = radio
        self.random = random.Random(number)
        place = (0.0, SPACING_M * ((number + 1) // 2) * (-1.0) ** (number + 1), 0.0)
        self.airframe = Airframe(place, Weather(DRAUGHT_M_S2, self.random))
        self.firmware = Firmware(directory / BINARY, directory / self.subject, number)
        self.firmware.configure(SETUP)
        self.firmware.fly()
        self.port = RadioPty(port, RadioLink(MultiModule(start_s), Receiver(number + 1)))
        self.motors: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)
        self._pulses: tuple[float, ...] = ()
        self._waiting: deque[tuple[float, tuple[float, ...]]] = deque()

    def receive(self, shift_s: float, now_s: float) -> None:
        """Receive what its radio sent until now; add `shift_s` to the time of the radio."""
        self.port.advance(now_s)
        self._waiting.extend((at_s + shift_s, us) for at_s, us in self.port.reception.take_outputs())

    def begin_step(self, step: int) -> None:
        """Start a step of the firmware; pulse widths act when they were received."""
        time_s = step * STEP_S
        while self._waiting and self._waiting[0][0] <= time_s:
            self._pulses = self._waiting.popleft()[1]
        if self._pulses and time_s > BOOT_S and step % STICKS_EVERY == 0:
            self.firmware.set_sticks(time_s, self._pulses)
        frame = self.airframe
        self.firmware.begin_step(time_s, frame.rates_rad_s, frame.force_m_s2, frame.attitude_wxyz)

    def end_step(self) -> None:
        """Fly with what the firmware commands."""
        self.motors = self.firmware.end_step() or self.motors
        self.airframe.step(STEP_S, self.motors)

    def body(self) -> TrackedBody:
        """Measured pose."""
        x, y, z = (p + self.random.gauss(0.0, NOISE_M) for p in self.airframe.position_m)
        w, *vector = self.airframe.attitude_wxyz
        a, b, c = (v + self.random.gauss(0.0, NOISE_RAD / 2) for v in vector)
        norm = (w * w + a * a + b * b + c * c) ** 0.5
        return TrackedBody(self.subject, (x, y, z), (a / norm, b / norm, c / norm, w / norm))

    def truth(self) -> dict[str, object]:
        """True state."""
        frame = self.airframe
        return {
            "position_m": [round(p, 5) for p in frame.position_m],
            "yaw_rad": round(frame.yaw_rad, 5),
            "on_floor": frame.on_floor,
            "touchdown_m_s": frame.touchdown_m_s,
            "motors": [round(m, 4) for m in self.motors],
            "pulses_us": [round(us) for us in self._pulses],
        }


def main(directory: Path, port: int, radios: list[tuple[str, ...]]) -> None:
    """Run until SIGTERM."""
    stopping: list[int] = []
    signal.signal(signal.SIGTERM, lambda caught, _: stopping.append(caught))
    start_s = time.monotonic()
    vehicles = [Vehicle(directory, radio, number, start_s) for number, radio in enumerate(radios)]
    tracker = TrackerServer(port=port, rate_hz=RATE_HZ)
    start_s, frame, step = time.monotonic(), 0, 0
    while not stopping:
        due_s = start_s + frame / RATE_HZ
        ports = {vehicle.port.fileno(): vehicle.port for vehicle in vehicles}
        wait_s = max(0.0, min(due_s, tracker.next_due_s()) - time.monotonic())
        readable, _, _ = select.select([tracker.fileno(), *ports], [], [], wait_s)
        now_s = time.monotonic()
        for descriptor in ports.keys() & set(readable):
            ports[descriptor].receive(now_s)
        tracker.poll()
        if now_s >= due_s:
            for vehicle in vehicles:
                vehicle.receive(-start_s, now_s)
            while (step + 1) * STEP_S <= now_s - start_s:
                step += 1
                for vehicle in vehicles:
                    vehicle.begin_step(step)
                for vehicle in vehicles:
                    vehicle.end_step()
            tracker.publish(TrackerFrame(frame, tuple(vehicle.body() for vehicle in vehicles)))
            truth = {vehicle.subject: vehicle.truth() for vehicle in vehicles}
            print(json.dumps({"time_s": now_s, **truth}), flush=True)
            frame = int((now_s - start_s) * RATE_HZ) + 1
    tracker.close()
    for vehicle in vehicles:
        vehicle.port.close()
        vehicle.firmware.stop()


if __name__ == "__main__":
    main(Path(sys.argv[1]).resolve(), int(sys.argv[2]), [tuple(pair.split("=")) for pair in sys.argv[3:]])
