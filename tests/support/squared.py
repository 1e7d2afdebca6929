"""A flight that computes a number, in a module that another process imports at once."""


def squared(number: int, progress: object = None) -> int:
    """Square of a number."""
    return number * number
