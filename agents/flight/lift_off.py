"""Lift-off and touchdown.

At lift-off the thrust rises open loop until the vehicle is seen to leave the floor. A model knows neither the
floor nor the thrust that this battery gives today. So the controller takes over only when the vehicle has
left the floor; how high it has risen until then shows its weight.

Nothing proves before that the pose is that of this vehicle. So the thrust is a pulse, as steep as the sticks
may move: a vehicle as heavy as its model that nothing sees reaches `UNSEEN_M_S` at most, is braked, and sinks
to the floor under `RESTING_SHARE`. The steeper a pulse of a given speed, the heavier are the vehicles that it
lifts.
"""

import math
from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np

from rcopterx.control.interfaces import Estimate
from rcopterx.vehicles.lift_off import RESTING_SHARE, braked
from rcopterx.vehicles.model import Model
from rcopterx.vehicles.state import GRAVITY_M_S2, INPUT_SIZE, U_THRUST, ZD_BODY, Array, Z

SPOOL_UP_S: Final = 0.4
UNSEEN_M_S: Final = 0.58  # climb rate that a vehicle like its model reaches at most if nothing sees it
LIGHT: Final = 0.95  # a vehicle of this share of the weight of its model...
LIGHT_M: Final = 0.13  # ...rises at most so high then
TRIES: Final = 5  # a receiver may still search its radio, and a lift may not be seen in time
THRUST_PER_S: Final = 4.0  # rate at which the thrust stick rises, as arbiters permit
NEAR_FLOOR: Final = 1.05  # by how much more the rotors of a coaxial helicopter lift near the floor
TRY_S: Final = 1.5  # of a pulse, and until a light vehicle that nothing sees has sunk to the floor
FAILED_S: Final = SPOOL_UP_S + TRIES * TRY_S
LIFTED_M: Final = 0.004  # a dozen times the noise of a motion capture
STANDING_M: Final = 0.002  # a vehicle that had lifted and is so low again...
STANDING_S: Final = 0.12  # ...for so long has not
HELD_S: Final = 0.02  # time for which a command is held
STEPS: Final = 4  # in that time
STEP_S: Final = HELD_S / STEPS
SPOOL_UP_STEPS: Final = round(SPOOL_UP_S / STEP_S)
TRY_STEPS: Final = round(TRY_S / STEP_S)
LIGHTEST: Final = 0.7  # share of the hover thrust: a lighter vehicle has risen from a soft mat only
BISECTIONS: Final = 12


class LiftOff:
    """One take-off, from `begin` to the first lift."""

    def __init__(self, model: Model) -> None:
        self._model = model
        near_floor = NEAR_FLOOR if model.airframe == "coaxial" else 1.0
        self._hover = float(model.hover_input[U_THRUST]) / near_floor
        largest = float(model.u_max[U_THRUST]) / self._hover
        self._pulse = _pulse(self._hover, largest, float(model.lag_s[U_THRUST]))
        peak = int(self._pulse.commanded.argmax())
        self._brakes_s = HELD_S * (peak + int(self._pulse.commanded[peak:].argmin())) - SPOOL_UP_S
        self._begun_s = self._before_s = math.inf
        self.floor_m = 0.0
        self._low_since_s = math.inf  # since when frames show a standing vehicle

    @property
    def under_way(self) -> bool:
        """Whether the vehicle stands with its rotor turning up."""
        return self._begun_s < math.inf

    def begin(self, time_s: float, floor_m: float) -> None:
        """Begin to turn the rotor up; `floor_m` is the height of the standing vehicle."""
        self._begun_s, self.floor_m = time_s, floor_m

    def pause(self, time_s: float) -> None:
        """Keep the thrust that lifts no vehicle while nothing is seen; then it rises anew."""
        self._begun_s = max(self._begun_s, time_s - SPOOL_UP_S)

    def end(self) -> None:
        """End the lift-off: the vehicle flies, or the take-off was given up."""
        self._before_s, self._begun_s = self._begun_s, math.inf

    def resume(self, time_s: float) -> None:
        """Brake as after a pulse, with the tries that are left: the vehicle is seen to stand again."""
        tried_s = time_s - self._before_s - SPOOL_UP_S - self._brakes_s
        tries = max(math.ceil(tried_s / TRY_S), 0)
        self._begun_s = time_s - SPOOL_UP_S - self._brakes_s - tries * TRY_S

    def thrust(self, time_s: float) -> float:
        """Return the thrust input to command now. 0 while nothing is under way."""
        elapsed_s = time_s - self._begun_s
        if elapsed_s < 0.0:
            return 0.0
        return self._hover * float(self._pulse.commanded[_step(elapsed_s) // STEPS])

    def handed_over(self, motion: Array, time_s: float) -> tuple[Estimate, float]:
        """Return estimate and hover thrust once it is seen to have lifted; `motion` (8,): on the floor."""
        share, climb_m_s = self._carrying(float(motion[Z]) - self.floor_m, time_s)
        climbing = motion.copy()
        climbing[ZD_BODY] = climb_m_s
        actuator, disturbance = np.zeros(INPUT_SIZE), np.zeros(INPUT_SIZE)
        actuator[U_THRUST] = self._hover * self._acted(time_s)[-1]
        disturbance[U_THRUST] = self._model.gravity_m_s2 - self._model.b[U_THRUST] * self._hover * share
        return Estimate(climbing, actuator, disturbance), self._hover * share

    def _carrying(self, risen_m: float, time_s: float) -> tuple[float, float]:
        """Share of the hover thrust that carries a vehicle that has risen so far, and its climb rate."""
        acting = self._acted(time_s)
        heaviest = max(float(acting.max()), STEP_S)
        lightest = LIGHTEST * min(heaviest, 1.0)
        climb_m_s = 0.0
        for _ in range(BISECTIONS):
            share = 0.5 * (lightest + heaviest)
            climbs_m_s = _climb_m_s(acting, share)
            height_m, climb_m_s = float(STEP_S * climbs_m_s.sum()), float(climbs_m_s[-1])
            lightest, heaviest = (share, heaviest) if height_m > risen_m else (lightest, share)
        return 0.5 * (lightest + heaviest), climb_m_s

    def _acted(self, time_s: float) -> Array:
        """Thrust of the rotor in each step of the present try until now, as a share of the hover thrust."""
        step = _step(max(time_s - self._model.delay_s - self._begun_s, 0.0))
        return self._pulse.acting[: step + 1]

    def see(self, height_m: float, time_s: float) -> None:
        """Use the height that a frame shows."""
        if height_m >= self.floor_m + STANDING_M:
            self._low_since_s = math.inf
        elif self._low_since_s == math.inf:
            self._low_since_s = time_s

    def lifted(self, height_m: float, time_s: float) -> bool:
        """Whether the vehicle has left the floor, by a thrust that may lift it; `height_m` is estimated."""
        risen = self._low_since_s == math.inf and height_m > self.floor_m + LIFTED_M
        return risen and time_s >= self._begun_s + SPOOL_UP_S

    def undone(self, time_s: float) -> bool:
        """Whether a vehicle that has lifted is seen to stand again."""
        return time_s > self._low_since_s + STANDING_S

    def failed(self, time_s: float) -> bool:
        """Whether it has not lifted, and has sunk to the floor if it did so unseen."""
        return time_s > self._begun_s + FAILED_S


def _step(elapsed_s: float) -> int:
    """Step at a time since the beginning of a lift-off, as if it were in its first try."""
    steps = int(elapsed_s / STEP_S + 1e-6)
    return steps if steps < SPOOL_UP_STEPS else SPOOL_UP_STEPS + (steps - SPOOL_UP_STEPS) % TRY_STEPS


class _Pulse(NamedTuple):
    """Shares of hover thrust: commanded per `HELD_S` of turning up and a try, of the rotor per `STEP_S`."""

    commanded: Array
    acting: Array


@lru_cache(maxsize=8)
def _pulse(hover: float, largest: float, lag_s: float) -> _Pulse:
    """Largest pulse of a rotor with a first-order lag and a hover thrust, `largest` as a share of that."""
    for percent in range(100, 0, -4):
        pulse = _pulse_to(0.01 * percent * UNSEEN_M_S, hover, largest, lag_s)
        if STEP_S * np.cumsum(_climb_m_s(pulse.acting, LIGHT)).max() < LIGHT_M:
            break
    return pulse


def _pulse_to(unseen_m_s: float, hover: float, largest: float, lag_s: float) -> _Pulse:
    """Pulse that brings a vehicle like its model to a climb rate."""
    commanded: list[float] = []
    acting: list[float] = []
    share = climb_m_s = command = 0.0
    rising, braking = True, False
    for number in range(round((SPOOL_UP_S + TRY_S) / HELD_S) + 1):
        if number * HELD_S < SPOOL_UP_S - 0.5 * HELD_S:
            command = RESTING_SHARE / SPOOL_UP_S * ((number + 0.5) * HELD_S + lag_s)  # it leads the lag
        elif number * HELD_S < SPOOL_UP_S + 0.5 * HELD_S:
            command = RESTING_SHARE
        elif rising:
            command = min(command + THRUST_PER_S * HELD_S / hover, largest)
            after_m_s = _reached_m_s(share, climb_m_s, command, lag_s)
            if after_m_s > unseen_m_s:
                least_m_s = _reached_m_s(share, climb_m_s, 0.0, lag_s)
                command *= max(unseen_m_s - least_m_s, 0.0) / (after_m_s - least_m_s)
                rising, braking = False, True
        else:
            braking = braking and not braked(climb_m_s, share, lag_s)
            command = 0.0 if braking else RESTING_SHARE
        commanded.append(command)
        for _ in range(STEPS):
            share, climb_m_s = _after_step(share, climb_m_s, command, lag_s)
            acting.append(share)
    return _Pulse(np.array(commanded), np.array(acting))


def _after_step(share: float, climb_m_s: float, command: float, lag_s: float) -> tuple[float, float]:
    """Thrust of the rotor, and climb rate of a vehicle like its model, after a step of a command."""
    share = command + (share - command) * (math.exp(-STEP_S / lag_s) if lag_s > 0.0 else 0.0)
    return share, max(0.0, climb_m_s + STEP_S * GRAVITY_M_S2 * (share - 1.0))


def _reached_m_s(share: float, climb_m_s: float, command: float, lag_s: float) -> float:
    """Fastest climb of a vehicle like its model if it is braked after `HELD_S` of a command."""
    for _ in range(STEPS):
        share, climb_m_s = _after_step(share, climb_m_s, command, lag_s)
    while share > 1.0:
        share, climb_m_s = _after_step(share, climb_m_s, 0.0, lag_s)
    return climb_m_s


def _climb_m_s(acting: Array, share: float) -> Array:
    """Climb rates from the floor on under a rotor; the weight is a share of the hover thrust."""
    from_floor = acting[int(np.argmax(acting > share)) :]
    return np.cumsum(GRAVITY_M_S2 * STEP_S * (from_floor / share - 1.0))


FLOOR_TOLERANCE_M: Final = 0.03
BELOW_FLOOR_M: Final = 0.1  # at floor height, with its reference so far below it, a vehicle stands there
STUCK_DEPTH_M: Final = 0.2  # a landing vehicle that stays so far above its reference stands on something
FLOOR_SPEED_M_S: Final = 0.1
FLOOR_TIME_S: Final = 0.2


class Touchdown:
    """Watches one vehicle."""

    def __init__(self) -> None:
        self._floor_m = 0.0
        self._since_s: float | None = None

    def begin(self, floor_m: float) -> None:
        """Watch a landing from its beginning; `floor_m` is the height at which the vehicle stood, or 0."""
        self._floor_m, self._since_s = floor_m, None

    def happened(self, motion: Array, reference_m: float, time_s: float) -> bool:
        """Return whether the vehicle stands, by its motion, shape (8,), and the height of its reference."""
        height_m = float(motion[Z])
        at_floor = abs(height_m - self._floor_m) < FLOOR_TOLERANCE_M
        if at_floor and reference_m < self._floor_m - BELOW_FLOOR_M:
            # Pushed against a floor that its model does not know, a vehicle may bounce and never be slow.
            return True
        low = height_m < self._floor_m + FLOOR_TOLERANCE_M or height_m > reference_m + STUCK_DEPTH_M
        if not low or abs(motion[ZD_BODY]) >= FLOOR_SPEED_M_S:
            self._since_s = None
            return False
        if self._since_s is None:
            self._since_s = time_s
        return time_s - self._since_s >= FLOOR_TIME_S
