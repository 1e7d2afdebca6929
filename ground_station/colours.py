"""The colours of vehicles by their number in the fleet file, the same in every view."""

COLOURS = ("#1f77b4", "#ff7f0e", "#2ca02c", "#d62728", "#9467bd", "#8c564b", "#e377c2")


def hex_colour(number: int) -> str:
    """Colour as `#rrggbb`."""
    return COLOURS[number % len(COLOURS)]
