"""Lists of numbers on the command line."""

import typer


def different_numbers(text: str, option: str, lowest: int = 0, highest: int | None = None) -> tuple[int, ...]:
    """Read whole numbers separated by commas.

    Parameters
    ----------
    text
        What the user wrote.
    option
        Name of the option, for the message.
    lowest, highest
        Allowed range.

    Returns
    -------
    tuple of int
        In the order written.

    Raises
    ------
    typer.BadParameter
        Something else than different whole numbers in the range.
    """
    try:
        numbers = tuple(int(part) for part in text.split(","))
    except ValueError:
        numbers = ()
    inside = all(lowest <= number and (highest is None or number <= highest) for number in numbers)
    if not numbers or not inside or len(set(numbers)) < len(numbers):
        span = f"from {lowest} on" if highest is None else f"from {lowest} to {highest}"
        raise typer.BadParameter(
            f"{text!r}: allowed are different whole numbers {span}, separated by commas", param_hint=option
        )
    return numbers
