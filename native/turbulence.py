"""Kernels of the coloured noise that shakes simulated vehicles (`rcopterx.simulator.disturbance`)."""

from rcopterx.compiling.compiled import COUNT, NUMBER, VECTOR, Array, compiled, part


@part
def renewed(value: Array, renewal: Array, keep: float, normals: Array, place: int) -> int:
    """Move the value on by one step of its time grid; returns the place of the next normal number."""
    for channel in range(len(value)):
        value[channel] = keep * value[channel] + renewal[channel] * normals[place + channel]
    return place + len(value)


@compiled(VECTOR, VECTOR, NUMBER, VECTOR, COUNT, COUNT)
def turbulence_renewed(
    value: Array, renewal: Array, keep: float, normals: Array, place: int, steps: int
) -> tuple[int, int]:
    """Move the value on by steps of its time grid, as far as there are normal numbers.

    Parameters
    ----------
    value
        Of all channels, shape (n,); it is written.
    renewal
        What a normal number of each channel counts, shape (n,).
    keep
        What is left of the value after a step.
    normals
        Normal numbers.
    place
        Of the first of them that has not been used.
    steps
        How many.

    Returns
    -------
    tuple of int
        Steps that are left, and place of the next number.
    """
    while steps > 0 and place + len(value) <= len(normals):
        place = renewed(value, renewal, keep, normals, place)
        steps -= 1
    return steps, place
