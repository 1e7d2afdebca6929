"""A state feedback in twenty lines that flies a vehicle from outside: python fly.py [FLEET [VEHICLE]]."""

import math
import sys
import time

from external_control import ExternalControl

POSITION_GAIN = (3.0, 3.0, 6.0, 6.0)
VELOCITY_GAIN = (3.0, 3.0, 5.0, 5.0)


def feedback(task):
    """Inputs that pull the vehicle to the first stage of its reference."""
    motion, reference = task["motion"], task["reference"][0]
    c, s = math.cos(motion[3]), math.sin(motion[3])
    error = [wanted - actual for wanted, actual in zip(reference[:4], motion[:4], strict=True)]
    error[:2] = c * error[0] + s * error[1], -s * error[0] + c * error[1]
    wanted_rate = [c * reference[4] + s * reference[5], -s * reference[4] + c * reference[5], *reference[6:8]]
    inputs = []
    for axis in range(4):
        acceleration = POSITION_GAIN[axis] * error[axis]
        acceleration += VELOCITY_GAIN[axis] * (wanted_rate[axis] - motion[4 + axis])
        acceleration -= task["disturbance"][axis]
        value = task["hover_input"][axis] + acceleration / task["input_gain"][axis]
        inputs.append(min(max(value, task["input_min"][axis]), task["input_max"][axis]))
    return inputs


def main(fleet="trio", vehicle="h1", seconds="10", **options):
    """Fly for some seconds, then return control."""
    end_s = time.monotonic() + float(seconds)
    with ExternalControl(fleet, vehicle, **options) as controlled:
        while time.monotonic() < end_s:
            task = controlled.next_task()
            controlled.answer(task, [feedback(task)])


if __name__ == "__main__":
    main(*sys.argv[1:])
