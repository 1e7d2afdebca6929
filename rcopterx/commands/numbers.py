"""Lists of numbers on the command line."""

import typer


def different_numbers(text: str, option: str, lowest: int = 0, highest: int | None = None) -> tuple[int, ...]:
    """Parse different whole numbers in a range, separated by commas; `option` is for the error message."""
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
