"""The simulator process: a Tracker on TCP, radio modules on pseudo-terminals, and plants in real time."""

import numpy as np

from rcopterx.bus import channels
from rcopterx.bus.heartbeat import own_heartbeat
from rcopterx.bus.host_messages import LaboratoryState, LaboratoryVehicle
from rcopterx.bus.realtime import ending_signals, prepare_loop, request_realtime
from rcopterx.bus.requests import Inject, Reply
from rcopterx.bus.rounding import PULSE_BITS, TIME_BITS, all_rounded, rounded
from rcopterx.bus.session import Incoming, Session
from rcopterx.simulator.faults import FaultError, fault_text, timed_faults
from rcopterx.simulator.room import SimulatedRoom
from rcopterx.simulator.settings import SimulatedVehicle, SimulatorSettings
from rcopterx.simulator.tracker import TrackerServer
from rcopterx.simulator.vehicle_faults import VehicleFaults
from rcopterx.vehicles.state import YAW, inertial_velocity

TRUTH_BITS = 17  # true motion is published to 2^-17 m, rad and m/s, for small flight logs
LONGEST_STEP_S = 0.02  # after which requests, timed faults and modules' answers are served at least


class Simulator:
    """The simulated laboratory on its wires."""

    def __init__(self, settings: SimulatorSettings, session: Session) -> None:
        self._session = session
        self._clock = session.clock
        self._period_s = 1 / settings.rate_hz
        address, rate_hz = (settings.tracker_host, settings.tracker_port), settings.rate_hz
        self._tracker = TrackerServer(*address, profile=settings.profile, rate_hz=rate_hz, clock=self._clock)
        start_s = self._clock()
        self._room = SimulatedRoom(settings.vehicles, settings.conditions, settings.seed, start_s)
        self._frame = 0
        self._frame_at_s = start_s + self._period_s
        self._step_at_s = start_s
        self._vehicle_faults = VehicleFaults(self._room.laboratory.plants, self._room.radios)
        session.serve(channels.SIMULATOR_UNIT, ["inject"])

    def run_once(self) -> None:
        """Receive bytes as they arrive; handle all else at the next due time."""
        tracker_due_s = self._tracker.next_due_s()
        due_s = min(self._step_at_s, tracker_due_s)
        ports = {radio.fileno(): radio for radio in self._room.radios.values() if radio.is_open}
        waited_for = [self._tracker.fileno(), *ports]
        readable = self._session.wait(max(0.0, due_s - self._clock()), waited_for)
        now_s = self._clock()
        for descriptor in readable:
            if descriptor in ports:
                ports[descriptor].receive(now_s)
        if self._tracker.fileno() in readable or now_s >= tracker_due_s:
            self._tracker.poll()
        if now_s >= self._step_at_s:
            self._step(now_s)

    def _step(self, now_s: float) -> None:
        for incoming in self._session.pending():
            incoming.answer(self._obey(incoming, now_s))
        self._vehicle_faults.advance(now_s)
        self._room.advance(min(now_s, self._frame_at_s))
        if now_s >= self._frame_at_s:
            truth = self._truth(*self._tracker.publish(self._room.capture(self._frame)))
            self._session.publish(channels.LABORATORY, channels.SIMULATOR_UNIT, truth)
            self._frame += 1
            self._frame_at_s += self._period_s
        self._step_at_s = min(self._frame_at_s, now_s + LONGEST_STEP_S)

    def _obey(self, incoming: Incoming, now_s: float) -> Reply:
        request = incoming.request
        if not isinstance(request, Inject):
            return Reply(accepted=False, reason=f"the simulator does not serve {incoming.verb}")
        try:
            table = timed_faults(request.faults)
            self._vehicle_faults.check(table)
            self._tracker.schedule(table)
        except FaultError as error:
            return Reply(accepted=False, reason=str(error)[:400])
        self._vehicle_faults.schedule(table, now_s)
        return Reply(accepted=True)

    def close(self) -> None:
        """Switch the laboratory off."""
        self._tracker.close()
        self._room.close()

    def _truth(self, frame: int, sent_s: float) -> LaboratoryState:
        faults = (*self._tracker.faults.table.active, *self._vehicle_faults.table.active)
        return LaboratoryState(
            frame=frame,
            sent_s=rounded(sent_s, TIME_BITS),
            vehicles={vehicle.name: self._vehicle(vehicle) for vehicle in self._room.vehicles},
            faults=tuple(fault_text(fault)[:400] for fault in faults),
            refused_faults=tuple(reason[:400] for reason in self._tracker.faults.refused),
        )

    def _vehicle(self, vehicle: SimulatedVehicle) -> LaboratoryVehicle:
        plant = self._room.laboratory.plants[vehicle.name]
        motion = plant.motion
        velocity_m_s = inertial_velocity(np.array(motion))
        reception = self._room.radios[vehicle.name].reception
        frames = reception.take_frames()
        x, y, z = all_rounded(plant.position_m, TRUTH_BITS)
        speed_x, speed_y, speed_z = all_rounded(velocity_m_s.tolist(), TRUTH_BITS)
        return LaboratoryVehicle(
            position_m=(x, y, z),
            yaw_rad=rounded(motion[YAW], TRUTH_BITS),
            velocity_m_s=(speed_x, speed_y, speed_z),
            on_floor=plant.on_floor,
            outside=plant.left_volume,
            touchdown_speed_m_s=plant.touchdown_speed_m_s or 0.0,
            touchdowns=plant.touchdowns,
            radio=tuple(
                (rounded(frame.arrival_s, TIME_BITS), *all_rounded(frame.pulses_us, PULSE_BITS))
                for frame in frames
            ),
            light=reception.light,
        )


def run_simulator(settings: SimulatorSettings) -> None:
    """Run the simulated laboratory until SIGTERM or SIGINT; `OSError` or `BusUnreachableError`."""
    stopping = ending_signals()
    request_realtime(settings.realtime_priority)
    with Session(settings.bus, interrupted=lambda: bool(stopping)) as session:
        simulator, heartbeat = Simulator(settings, session), own_heartbeat()
        prepare_loop()
        try:
            while not stopping:
                heartbeat.beat()
                simulator.run_once()
        finally:
            heartbeat.ending()
            simulator.close()
