"""A vehicle of the simulated room with the firmware behind its port, flown in virtual time without processes.

Agent and transmitter gateway are what a fleet file makes of them; packets pass a port of the loopback.
"""

import math
import select
from dataclasses import replace

import numpy as np

from rcopterx.agents.estimation import StampedMeasurement
from rcopterx.control.identification.excitation import DONE, excitation_for
from rcopterx.control.identification.recording import FlightLog, FlightRecording
from rcopterx.control.interfaces import Measurement
from rcopterx.deploy.roles.agent import pilot_of
from rcopterx.fleet.radios import calibration_of, protocol_of
from rcopterx.fleet.reading import parse_fleet
from rcopterx.fleet.vehicle_models import battery_of, limits_of, model_of
from rcopterx.radios.set_points import SetPointRadio
from rcopterx.simulator.conditions import PRESETS
from rcopterx.simulator.first_order_plant import FirstOrderPlant
from rcopterx.simulator.plant import BodyPose
from rcopterx.simulator.room import SimulatedRoom
from rcopterx.simulator.settings import SimulatedRadio, SimulatedVehicle
from rcopterx.transmitter_gateway.inputs import Action, ActionRequest, CommandInput, PoseInput
from rcopterx.transmitter_gateway.settings import TransmitterSettings
from rcopterx.transmitter_gateway.transmitter import Transmitter
from rcopterx.transmitter_gateway.udp_port import UdpPort
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.phases import Phase
from support.take_offs import FILE as LABORATORY
from support.udp import udp_paths

NAME = "h1"
FRAME_S, STEPS = 0.02, 4
LANDED_S, FORCED_S = 15.0, 3.0
VEHICLE = """
[vehicles.h1]
type = "{type}"
subject = "h1"
model = {model}
transmitter = {{ port = "{port}", settings = {settings} }}
"""


class FirmwareFlight:
    """One vehicle of a type with settings of its radio; `stick_yaw`, not None, replaces the yaw stick."""

    def __init__(
        self,
        kind: str,
        settings: str = "{}",
        model: str = "{}",
        conditions: str = "helicopter",
        seed: int = 1,
    ) -> None:
        [path] = udp_paths(1)
        fleet = parse_fleet(LABORATORY + VEHICLE.format(type=kind, port=path, settings=settings, model=model))
        protocol, calibration = protocol_of(fleet, NAME), calibration_of(fleet, NAME)
        assert isinstance(protocol, SetPointRadio)
        self.now_s, self.frame, self.sequence = 0.0, 0, 0
        self.stick_yaw: float | None = None
        vehicle = SimulatedVehicle(
            NAME, NAME, model_of(fleet, NAME), BodyPose((0.0, 0.0, 0.0)), path,
            SimulatedRadio(protocol, 1), calibration,
        )  # fmt: skip
        self.room = SimulatedRoom((vehicle,), PRESETS[conditions], seed, 0.0)
        self.radio, self.plant = self.room.radios[NAME], self.room.laboratory.plants[NAME]
        self.transmitter = Transmitter(
            TransmitterSettings(
                NAME, path, protocol, calibration, limits_of(fleet, NAME), battery_of(fleet, NAME)
            ),
            UdpPort(path, protocol),
        )
        _, self.pilot = pilot_of(fleet, NAME)
        self.lease = self.transmitter.bid(1, 0.0, take_over=False)
        self.yaw_rad: list[float] = []
        self.places_m: list[tuple[float, float, float]] = []

    def close(self) -> None:
        self.transmitter.port.close()
        self.room.close()

    def hover(self, height_m: float = 0.8) -> None:
        """Wait for the start of the firmware, take off and reach the height."""
        self.run(22.0)
        answer = self.transmitter.request(ActionRequest(Action.ARM, "operator"), self.now_s)
        assert answer.accepted, (answer.reason, self.transmitter.link(self.now_s).text)
        self.run(0.1)
        assert self.pilot.take_off(height_m) is None
        self.run(10.0)
        assert self.pilot.guidance.phase is Phase.FLYING, self.transmitter.link(self.now_s).text
        self.yaw_rad.clear()
        self.places_m.clear()

    def land(self) -> None:
        """Land and disarm, as `land` does."""
        self.pilot.guidance.land(self.pilot.estimate, self.pilot.clock.time_s)
        for _ in range(round(LANDED_S / FRAME_S)):
            self.run(FRAME_S)
            if self.pilot.guidance.phase is Phase.ARMED:
                break
        self.transmitter.request(ActionRequest(Action.DISARM, "operator"), self.now_s)
        self.run(FORCED_S)

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / FRAME_S)):
            self._advance()

    def _advance(self) -> None:
        self.frame += 1
        for _ in range(STEPS):
            self.now_s += FRAME_S / STEPS
            self._serve()
        self.yaw_rad.append(self.plant.pose.yaw_rad)
        self.places_m.append(self.plant.position_m)
        pose = self.room.laboratory.seen_pose(NAME)
        self._observe(pose)
        if self.pilot.ready:
            self._command()
        self._serve()

    def _serve(self) -> None:
        """Pass packets both ways, and advance the room."""
        port = self.transmitter.port
        if self.radio.is_open and select.select([self.radio.fileno()], [], [], 0.0)[0]:
            self.radio.receive(self.now_s)
        self.room.advance(self.now_s)
        if port.is_open:
            self.transmitter.on_readable(self.now_s)
        self.transmitter.tick(self.now_s)
        output, cause = self.transmitter.output, self.transmitter.output.cause
        sequence = 0 if cause is None else cause.sequence
        self.pilot.note_applied(output.state.name.lower(), sequence, np.array(output.u))

    def _observe(self, pose: BodyPose | None) -> None:
        if pose is None:
            seen, raw = None, PoseInput(NAME, 1, self.frame, None, FRAME_S)
        else:
            seen = Measurement.of_pose(pose.position_m, pose.quaternion_xyzw)
            tilt_rad = math.acos(math.cos(pose.pitch_rad) * math.cos(pose.roll_rad))
            raw = PoseInput(NAME, 1, self.frame, pose.position_m, FRAME_S, pose.yaw_rad, 0.0, tilt_rad)
        self.transmitter.on_pose(raw, self.now_s)
        self.pilot.observe(StampedMeasurement(1, self.frame, FRAME_S, seen))

    def _command(self) -> None:
        control = self.pilot.control({})
        self.sequence += 1
        self.pilot.sequence = self.sequence
        pitch, roll, thrust, yaw = map(float, control.input)
        planned = [tuple(map(float, row)) for row in control.next_inputs]
        if self.stick_yaw is not None:
            yaw, planned = self.stick_yaw, []
        command = CommandInput(self.lease, 1, self.sequence, self.frame, (pitch, roll, thrust, yaw), planned)
        self.transmitter.on_command(command, self.now_s)

    def excited(self, seconds: float) -> FlightRecording:
        """Move all sticks as an identification does; return the recording."""
        pilot, model = self.pilot, self.pilot.model
        log, first = FlightLog(model.kind, FRAME_S), self.frame + 1
        pilot.exciter.begin(excitation_for(model, seconds), self._place_m, 0.4, pilot.clock.time_s)
        while pilot.exciter.under_way:
            self.run(FRAME_S)
            pose = self.room.laboratory.measured_pose(NAME)
            row = self.frame - first
            log.add_pose(row, Measurement.of_pose(pose.position_m, pose.quaternion_xyzw))
            log.add_input(row, np.array(self.transmitter.output.u))
        assert pilot.exciter.outcome == DONE, pilot.exciter.outcome
        return log.recording()

    @property
    def body(self) -> Model:
        """True parameters of the body, drawn around those of the firmware, with what its battery has left."""
        assert isinstance(self.plant, FirstOrderPlant)
        model = self.plant.model
        pitch, roll, thrust, yaw = model.input_gain
        return replace(model, input_gain=(pitch, roll, thrust * self.plant.thrust_factor, yaw))

    @property
    def _place_m(self) -> np.ndarray:
        place_m, _ = self.pilot.guidance.set_point()
        return place_m

    @property
    def hover_rms_m(self) -> float:
        """Root mean square of the distance from the mean place, the worse horizontal axis."""
        return float(np.std(np.array(self.places_m)[:, :2], axis=0).max())

    @property
    def heading_rms_rad(self) -> float:
        return float(np.std(self.yaw_rad))
