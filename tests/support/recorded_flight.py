"""Recordings of flights, built message by message."""

import numpy as np

from rcopterx.bus import channels
from rcopterx.bus.channels import Channel
from rcopterx.bus.codec import encode
from rcopterx.bus.host_messages import LaboratoryState, LaboratoryVehicle
from rcopterx.bus.message import Message
from rcopterx.bus.messages import Applied, ArbiterState, CommandTiming, LeaderLink, Plan, Pose
from rcopterx.bus.session import RawMessage
from rcopterx.bus.trajectory_array import TrajectoryArray
from rcopterx.ground_station.report.figures import FlightFigures
from rcopterx.ground_station.report.recorder import Recording
from rcopterx.vehicles.tuples import Four, Three
from support.statuses import flying_status


class Flight:
    """Builds a recording message by message."""

    def __init__(self) -> None:
        self.records: list[RawMessage] = []

    def add(self, channel: Channel, unit: str, message: Message) -> None:
        self.records.append(RawMessage(unit, channel.topic, encode(message), float(len(self.records))))

    def pose(
        self, unit: str, frame: int, position_m: Three | None, received_s: float = 0.0, epoch: int = 1
    ) -> None:
        quaternion = None if position_m is None else (0.0, 0.0, 0.0, 1.0)
        self.add(
            channels.POSE,
            unit,
            Pose(
                epoch=epoch,
                frame=frame,
                period_s=0.02,
                latency_s=0.0,
                received_s=received_s,
                occluded=position_m is None,
                position_m=position_m,
                quaternion_xyzw=quaternion,
            ),
        )

    def plan(
        self,
        unit: str,
        frame: int,
        reference: Four | None,
        *following: LeaderLink,
        start_s: float = 0.02,
        epoch: int = 1,
    ) -> None:
        trajectory = TrajectoryArray.of(np.zeros((2, 12)))
        self.add(
            channels.PLAN,
            unit,
            Plan(
                epoch=epoch,
                frame=frame,
                source=unit,
                ancestors=(),
                period_s=0.02,
                start_s=start_s,
                trajectory=trajectory,
                reference=reference,
                following=following,
            ),
        )

    def laboratory(self, frame: int, sent_s: float, **vehicles: LaboratoryVehicle) -> None:
        state = LaboratoryState(frame=frame, sent_s=sent_s, vehicles=vehicles)
        self.add(channels.LABORATORY, channels.SIMULATOR_UNIT, state)

    def applied(
        self,
        unit: str,
        frame: int,
        written_s: float,
        pulses_us: tuple[float, ...],
        *,
        epoch: int = 1,
        fresh: bool = True,
        state: ArbiterState = "armed",
        arrived_s: float | None = None,
        timing: CommandTiming | None = None,
    ) -> None:
        self.add(
            channels.APPLIED,
            unit,
            Applied(
                state=state,
                input=(0.0, 0.0, 0.5, 0.0),
                pulse_width_us=pulses_us,
                epoch=epoch,
                frame=frame,
                sequence=frame,
                fresh=fresh,
                command_arrived_s=arrived_s,
                written_s=written_s,
                host="main",
                timing=timing,
            ),
        )

    def status(self, unit: str, ticks: int, process: int = 1, **fields: object) -> None:
        self.add(
            channels.AGENT_STATUS,
            unit,
            flying_status(ticks=ticks, process=process, **fields),
        )

    def figures(self, *names: str) -> FlightFigures:
        return FlightFigures(Recording(self.records), names)


def truth(
    x: float = 0.0, y: float = 0.0, z: float = 1.0, radio: tuple[tuple[float, ...], ...] = ()
) -> LaboratoryVehicle:
    return LaboratoryVehicle(
        position_m=(x, y, z),
        yaw_rad=0.0,
        velocity_m_s=(0.0, 0.0, 0.0),
        on_floor=False,
        outside=False,
        radio=radio,
    )
