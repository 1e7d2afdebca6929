"""Proof that the sticks act as modelled, right after a lift-off.

A vehicle whose pitch, roll or yaw acts the wrong way flies away as soon as a controller steers it. So no
controller moves a stick before the vehicle has shown what that stick does: pulses of known shape do. What is
seen then, the tilt, where it is measured, and the position, is a sum of responses of the model:

    seen = sum over i, j of effect[i, j] * (response of axis i to stick j) + response to the trim + beginning

Least squares finds the effects. They are the identity for a sound vehicle, a turn for a subject whose nose
points elsewhere, a reflection for channels that are reversed or exchanged. The measured heading turns the
sticks, so a vehicle that spins at its lift-off is judged as well. The yaw is judged in the same way, once the
thrust of the lift-off, which turns coaxial helicopters, has settled.
"""

import math
from typing import Final

import numpy as np

from rcopterx.agents.flight.timeline import InputHistory
from rcopterx.agents.flight.vehicle_watch import VehicleFault
from rcopterx.control.interfaces import Measurement, at_rest
from rcopterx.control.models.prediction import predict
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import (
    MOTION_SIZE,
    U_PITCH,
    U_ROLL,
    U_THRUST,
    U_YAW,
    YAW,
    YAW_RATE,
    Array,
    heading_matrix,
)

STICKS: Final = [U_PITCH, U_ROLL, U_YAW]
PULSE_S: Final = 0.1
PULSES: Final = np.array(((1.0, 1, 0), (0, 0, 1), (0, -1, 1), (1, -1, 0), (-1, 1, -1), (-1, 0, -1)))
"""Pulses of the sticks, shape (k, 3), with sums of 0: they leave no velocity. Answers that are up to 90 ms
later than the model says are not like those to another stick, or to a reversed one."""
ANSWER_S: Final = 0.17  # time in which a quick vehicle tilts
PULSE_M_S2: Final = 0.8  # acceleration that a pulse of pitch or roll asks of it; more of a slower one
PULSE_RAD_S: Final = 1.0  # yaw rate that it asks for
LARGEST_PULSE: Final = 0.5  # of the room of a stick
CLEAR_M: Final = 0.012  # a vehicle that is lower may touch the floor again and answer no pulse
WAITING_S: Final = 0.03  # so long after it was lower, more than a control period, the pulses begin
PROOF_M: Final = 0.1  # height above the floor meanwhile, where poses have proved themselves
SETTLING_S: Final = 0.4  # after an interruption the vehicle settles before the proof begins again
LIFTED_S: Final = 0.1  # a vehicle has left the floor so long before it is clear of it

EARLY_S: Final = 0.2  # so long after the beginning of a round pitch and roll are judged...
EARLY_LEAD: Final = 0.8  # ...if the effects are by so much nearer to one reading than to the next one,
SHOWN_S: Final = 0.13  # ...and so long before the end of a round, once all their pulses have been answered...
SHOWN_FAR_S: Final = 0.05  # ...which the position shows later...
LEAST_LEAD: Final = 0.2  # ...by so much,
CERTAIN: Final = 4.0  # ...and by so many standard deviations
SURE: Final = 14.0  # standard deviations by which a heading turns the wrong way
YAW_FROM_S: Final = 0.2  # when the thrust of a lift-off has settled...
SWUNG: Final = 0.4  # ...if it varies by less than this share of the hover thrust from then on
LEAST_EFFECT: Final = 0.15  # of a stick that acts
ROUNDS: Final = 2  # after so many rounds without certainty of pitch and roll the vehicle lands

_RIGHT, _EXCHANGED = np.eye(2), np.eye(2)[::-1]
_PITCH, _ROLL = np.diag((-1.0, 1.0)), np.diag((1.0, -1.0))
READINGS: Final = (
    (_RIGHT, ""),
    (_PITCH, "pitch acts the wrong way: swash plate or channel reversed?"),
    (_ROLL, "roll acts the wrong way: swash plate or channel reversed?"),
    (-_RIGHT, "pitch and roll act the wrong way: the nose of the subject points backwards?"),
    (_EXCHANGED, "pitch and roll are exchanged: channels or servos?"),
    (-_EXCHANGED, "pitch and roll are exchanged and act the wrong way: channels or servos?"),
    (_EXCHANGED @ _PITCH, "pitch and roll act crosswise: the nose of the subject points to the left?"),
    (_EXCHANGED @ _ROLL, "pitch and roll act crosswise: the nose of the subject points to the right?"),
)
"""Effects of pitch and roll, shape (2, 2), and their likely causes; the first ones are right."""


class SignProof:
    """The proof of one lift-off, from `begin` on; `measured_tilt`: whether poses show roll and pitch."""

    def __init__(self, model: Model, *, measured_tilt: bool = True) -> None:
        self._model, self._tilted = model, measured_tilt and model.tilt is not None
        turning_s = min(PULSE_S, 1.0 / -model.damping[U_YAW]) if model.damping[U_YAW] < 0.0 else PULSE_S
        answer_s = ANSWER_S
        if model.tilt is not None:
            own_s = 2.0 * model.tilt.damping_ratio / model.tilt.frequency_rad_s
            answer_s = max(answer_s, model.tilt.servo_lag_s + own_s)
        self.round_s = PULSE_S * len(PULSES) + answer_s  # pulses and the answer to the last one
        self.climb_after_s = self.round_s - ANSWER_S  # so long after the lift-off the climb begins
        tilting = PULSE_M_S2 * answer_s / ANSWER_S
        wanted = np.array((tilting, tilting, PULSE_RAD_S / turning_s))
        self._sizes = np.minimum(wanted / model.b[STICKS], LARGEST_PULSE * model.stick_room[STICKS])
        self._open: set[int] = set()  # sticks that are not proved
        self._rounds, self._clear_m, self._suspect = 0, -math.inf, False

    @property
    def under_way(self) -> bool:
        """Whether a stick has still to be proved."""
        return bool(self._open)

    def repeats(self, time_s: float) -> bool:
        """Whether a further round begins now, because pitch and roll look wrong without certainty."""
        return self._suspect and self._begun_s == time_s

    def begin(self, time_s: float, *, floor_m: float = -math.inf, height_m: float = math.inf) -> None:
        """Begin, now or later, as soon as the vehicle, now at `height_m`, is clear of the floor."""
        self._open, self._rounds = set(STICKS), 0
        self._clear_m = floor_m + CLEAR_M
        self._begin_round(time_s + (WAITING_S if height_m < self._clear_m else 0.0))

    def end(self) -> None:
        """End without a result."""
        self._open = set()

    def _begin_round(self, time_s: float) -> None:
        still = at_rest(self._model)
        spinning = still._replace(motion=np.eye(MOTION_SIZE)[YAW_RATE])
        self._begun_s = self._until_s = time_s
        self._rounds += 1
        self._yaw_rad: float | None = None  # newest measured one, with all turns
        # Responses of x to pitch and roll, of y to pitch and roll, to the trims of pitch and roll.
        self._lateral = [still] * 6
        # Responses of the yaw to its stick, to the thrust, to its trim, and to its rate at the beginning.
        self._turning = [still, still, still, spinning]
        self._tilt_seen, self._place_seen, self._yaw_seen = _Regression(), _Regression(), _Regression()
        self._thrusts: list[float] = []  # of the rotor, with each heading that is used
        for number, trim in ((4, (1.0, 0.0)), (5, (0.0, 1.0))):
            self._tilt(number, *trim, LIFTED_S)

    def pulses(self, inputs: Array, time_s: float, period_s: float) -> Array:
        """Return inputs, shape (k, 4), `period_s` apart, with pulses in place of sticks that are open."""
        pulsed = inputs.copy()
        for number in range(len(pulsed)):
            place = math.floor((time_s + number * period_s - self._begun_s) / PULSE_S + 1e-6)
            pulse = PULSES[place] if 0 <= place < len(PULSES) else np.zeros(len(STICKS))
            for axis, size, share in zip(STICKS, self._sizes, pulse, strict=True):
                if axis in self._open:
                    pulsed[number, axis] = size * share
        return pulsed

    def observe(self, measurement: Measurement | None, inputs: InputHistory, time_s: float) -> None:
        """Advance the responses to a frame, and use what it shows."""
        if measurement is not None and measurement.position_m[2] < self._clear_m:
            self._rounds -= 1
            self._begin_round(time_s + WAITING_S)
        if time_s < self._begun_s or (measurement is None and self._yaw_rad is None):
            return
        measured_rad = self._yaw_rad if measurement is None else measurement.yaw_rad
        before_rad = measured_rad if self._yaw_rad is None else self._yaw_rad
        assert measured_rad is not None
        assert before_rad is not None
        turned_rad = math.remainder(measured_rad - before_rad, math.tau)
        self._yaw_rad = before_rad + turned_rad
        ahead, left = heading_matrix(before_rad + 0.5 * turned_rad).T
        for value, duration_s in inputs.between(self._until_s, time_s):
            pitch, roll, thrust, yaw = value.tolist()
            sticks = (pitch * ahead, roll * ahead, pitch * left, roll * left, ahead, left)
            for number, (x, y) in enumerate(sticks):
                self._tilt(number, x, y, duration_s)
            hover = float(self._model.hover_input[U_THRUST])
            for number, two in enumerate(((hover, yaw), (thrust, 0.0), (hover, 1.0), (hover, 0.0))):
                applied = np.array((0.0, 0.0, *two))
                self._turning[number] = predict(self._model, self._turning[number], applied, duration_s)
        self._until_s = max(self._until_s, time_s)
        if measurement is not None:
            self._use(measurement, self._yaw_rad, time_s - self._begun_s)

    def _tilt(self, number: int, x: float, y: float, duration_s: float) -> None:
        """Advance a response of the horizontal motion under sticks along inertial x and y."""
        applied = self._model.hover_input.copy()
        applied[:2] = x, y
        self._lateral[number] = predict(self._model, self._lateral[number], applied, duration_s)

    def _use(self, measurement: Measurement, yaw_rad: float, elapsed_s: float) -> None:
        tilt = measurement.tilt if self._tilted else None
        for axis, beginning in enumerate(np.eye(2).tolist()):
            row = [estimate.motion[axis] for estimate in self._lateral]
            moving = [elapsed_s * one for one in beginning]
            self._place_seen.add([*row, *beginning, *moving], float(measurement.position_m[axis]))
            if tilt is not None:
                row = [estimate.tilt.core[axis] for estimate in self._lateral]
                self._tilt_seen.add([*row, *beginning], float(tilt[axis]))
        if elapsed_s > YAW_FROM_S:
            self._yaw_seen.add([*(estimate.motion[YAW] for estimate in self._turning), 1.0], yaw_rad)
            self._thrusts.append(float(self._turning[1].actuator[U_THRUST]))

    def judge(self, time_s: float) -> VehicleFault | None:
        """Return what is certainly wrong; a stick that is certainly right is left to the controller.

        A round of pulses that shows neither is followed by another one.
        """
        elapsed_s, fault = time_s - self._begun_s, None
        if U_PITCH in self._open and elapsed_s > EARLY_S:
            fault = self._judge_lateral(elapsed_s)
        if fault is None and U_YAW in self._open and elapsed_s > self.round_s:
            fault = self._judge_yaw()
        if fault is None and self._open and elapsed_s > self.round_s:
            fault = self._judge_silence()
        if fault is not None:
            self.end()
        elif self._open and elapsed_s > self.round_s:
            self._begin_round(time_s)
        return fault

    def _judge_lateral(self, elapsed_s: float) -> VehicleFault | None:
        """Judge pitch and roll: right by the tilt or the position, wrong by all that is measured."""
        tilt = _reading(self._tilt_seen, elapsed_s > self.round_s - SHOWN_S) if self._tilted else None
        far = elapsed_s > self.round_s - SHOWN_FAR_S
        # Beside a tilt the position serves as a second witness, once it has seen everything.
        place = _reading(self._place_seen, far) if far or not self._tilted else None
        if 0 in (tilt, place):
            self._open -= {U_PITCH, U_ROLL}
            return None
        if place is None or (self._tilted and tilt != place):
            return None
        return VehicleFault("sign_wrong", READINGS[place][1], (U_PITCH, U_ROLL))

    def _judge_silence(self) -> VehicleFault | None:
        """Return a fault for sticks that a round, or the last one, has left open."""
        found = (self._tilt_seen if self._tilted else self._place_seen).fitted()
        if U_PITCH in self._open and found is not None:
            effects, deviation = found[0][:4].reshape(2, 2), float(found[1][:4].max())
            self._suspect = int(np.argmax([(reading * effects).sum() for reading, _ in READINGS])) > 0
            for stick, name in ((U_PITCH, "pitch"), (U_ROLL, "roll")):
                if math.hypot(*effects[:, stick]) < LEAST_EFFECT - CERTAIN * deviation:
                    return VehicleFault("axis_dead", f"{name} has no effect", (U_PITCH, U_ROLL))
        if self._rounds < ROUNDS:
            return None
        if U_PITCH in self._open:
            return VehicleFault("sign_open", "pitch and roll do not act as modelled", (U_PITCH, U_ROLL))
        self.end()  # a heading that turns late or little is flown, and watched as any axis in flight
        return None

    def _judge_yaw(self) -> VehicleFault | None:
        found = self._yaw_seen.fitted()
        if found is None:
            return None
        effect, deviation = float(found[0][0]), float(found[1][0])
        if effect > max(LEAST_EFFECT, CERTAIN * deviation):
            self._open.discard(U_YAW)
        # A heading that answers late fits badly, and a swinging thrust turns it as well.
        swung = max(self._thrusts) - min(self._thrusts) > SWUNG * self._model.hover_input[U_THRUST]
        if not swung and effect < -max(LEAST_EFFECT, SURE * deviation):
            return VehicleFault("sign_wrong", "yaw acts the wrong way: gyro or channel reversed?", (U_YAW,))
        return None


def _reading(seen: "_Regression", shown: bool) -> int | None:
    """Number of the reading that pitch and roll show, when all pulses are `shown`; None without certainty."""
    found = seen.fitted()
    if found is None:
        return None
    value, deviation = found
    shares = np.array([float((reading.ravel() * value[:4]).sum()) for reading, _ in READINGS])
    second, best = np.argsort(shares)[-2:].tolist()
    lead = float(shares[best] - shares[second])
    uncertain = 2.0 * float(deviation[:4].max())  # readings differ by twice an effect
    certain = lead > max(LEAST_LEAD if shown else EARLY_LEAD, CERTAIN * uncertain)
    if best == 0:
        certain = certain and lead > 2.0 * LEAST_EFFECT
    return best if certain else None


class _Regression:
    """Least squares of what was seen by rows of responses."""

    def __init__(self) -> None:
        self._rows: list[list[float]] = []
        self._seen: list[float] = []

    def add(self, row: list[float], seen: float) -> None:
        self._rows.append(row)
        self._seen.append(seen)

    def fitted(self) -> tuple[Array, Array] | None:
        """Coefficients and their standard deviations; None while there are too few rows."""
        if not self._rows or len(self._rows) <= len(self._rows[0]):
            return None
        rows, seen = np.array(self._rows), np.array(self._seen)
        inverse = np.linalg.pinv(rows.T @ rows)
        value = inverse @ (rows.T @ seen)
        noise = float(np.linalg.norm(seen - rows @ value)) / math.sqrt(len(seen) - len(value))
        return value, noise * np.sqrt(np.maximum(inverse.diagonal(), 0.0))
