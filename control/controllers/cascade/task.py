"""What the problems of one control step depend on."""

from typing import NamedTuple

from rcopterx.control.controllers.cascade.limits import Bounds
from rcopterx.control.interfaces import Estimate
from rcopterx.vehicles.state import Array


class Task(NamedTuple):
    """One control step of N planned inputs."""

    estimate: Estimate
    load: Array
    """Accelerations that sticks balance: `Estimate.disturbance`, and gravity; shape (4,)."""
    reference: Array
    """Samples, shape (N + 1, 12)."""
    bounds: Bounds
