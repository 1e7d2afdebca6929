"""The simulated laboratory in real time: plants between their radios and the Tracker."""

from dataclasses import replace

from rcopterx.simulator.conditions import Conditions
from rcopterx.simulator.laboratory import Laboratory
from rcopterx.simulator.radio_kinds import radio_end_of
from rcopterx.simulator.settings import SimulatedVehicle
from rcopterx.simulator.tracker_frame import TrackedBody, TrackerFrame

LEAST_NOISE_M = 1e-6  # no Tracker measures without any noise, also in conditions without disturbances
MOTOR_START_US = 15.0  # pulse width above throttle low from which the vehicle's motor controller runs


class SimulatedRoom:
    """Vehicles with their receivers; the clock begins at `start_s` and advances by `advance`."""

    def __init__(
        self, vehicles: tuple[SimulatedVehicle, ...], conditions: Conditions, seed: int, start_s: float
    ) -> None:
        self.vehicles = vehicles
        brushless = conditions.brushless
        self.radios = {one.name: radio_end_of(one.port, one.radio, start_s, brushless) for one in vehicles}
        bodies = {one.name: self.radios[one.name].reception.body_of(one.model) for one in vehicles}
        starts = {one.name: one.start for one in vehicles}
        conditions = replace(conditions, position_noise_m=max(conditions.position_noise_m, LEAST_NOISE_M))
        self.laboratory = Laboratory(bodies, starts, conditions, seed)
        self._armed: set[str] = set()  # whose flight controllers are armed, from throttle low to off
        self._now_s = start_s

    def advance(self, now_s: float) -> None:
        """Advance radios and vehicles to `now_s`; the caller receives what gateways write meanwhile."""
        for vehicle in self.vehicles:
            radio = self.radios[vehicle.name]
            radio.advance(now_s)
            for received_s, pulses_us in radio.reception.take_outputs():
                self._drive(vehicle, pulses_us, max(0.0, received_s - self._now_s))
        if now_s > self._now_s:
            self.laboratory.advance(now_s - self._now_s)
            self._now_s = now_s
            for name, radio in self.radios.items():
                radio.reception.sense(self.laboratory.plants[name])

    def _drive(self, vehicle: SimulatedVehicle, pulses_us: tuple[float, ...], after_s: float) -> None:
        calibration = vehicle.calibration
        throttle, arming, emergency = calibration.throttle, calibration.arming, calibration.emergency
        low = pulses_us[throttle.index] < throttle.low_us + MOTOR_START_US
        if arming is None or not arming.is_on(pulses_us):
            self._armed.discard(vehicle.name)
        elif low:
            self._armed.add(vehicle.name)
        armed = arming is None or vehicle.name in self._armed
        plant = self.laboratory.plants[vehicle.name]
        if low or not armed or (emergency is not None and emergency.is_on(pulses_us)):
            plant.stop_motors(after_s)
        else:
            plant.set_input(calibration.inputs(pulses_us), after_s)

    def capture(self, frame: int) -> TrackerFrame:
        """Frame that the Tracker captures now."""
        return TrackerFrame(frame, tuple(self._body(vehicle) for vehicle in self.vehicles))

    def _body(self, vehicle: SimulatedVehicle) -> TrackedBody:
        if (pose := self.laboratory.seen_pose(vehicle.name)) is None:
            return TrackedBody(vehicle.subject, (0.0, 0.0, 0.0), occluded=True)
        return TrackedBody(vehicle.subject, pose.position_m, pose.quaternion_xyzw)

    def close(self) -> None:
        """Remove the ports of the radios."""
        for radio in self.radios.values():
            radio.unplug()
