"""Numbers and settings on the command line."""

from collections.abc import Collection, Iterable
from typing import TYPE_CHECKING

import typer

from rcopterx.user_text import similar

if TYPE_CHECKING:
    from rcopterx.bus.message import Setting


def three(text: str) -> tuple[float, float, float]:
    """Parse three numbers: 0.5,0,-0.2."""
    try:
        x, y, z = (float(part) for part in text.split(","))
    except ValueError:
        raise typer.BadParameter(f"{text!r}: three numbers separated by commas are needed") from None
    return x, y, z


def check_known(names: Iterable[str], known: Collection[str], what: str, option: str) -> None:
    """Raise a usage error for the first unknown name; `what` and `option` are for its message."""
    for name in names:
        if name not in known:
            message = f"unknown {what} {name!r}, known are {', '.join(known)}{similar(name, known)}"
            raise typer.BadParameter(message, param_hint=option)


def settings_of(words: Iterable[str], option: str) -> "dict[str, Setting]":
    """Parse settings like horizon=30; `option` is for the error message."""
    settings = {}
    for word in words:
        name, equals, value = word.partition("=")
        if not equals or not name:
            raise typer.BadParameter(f"{word!r} must look like horizon=30", param_hint=option)
        settings[name] = _setting(value)
    return settings


def _setting(text: str) -> "Setting":
    """Parse the value of a setting: 30, 0.5, true, none, 1,2,3 or a word."""
    words: dict[str, Setting] = {"true": True, "false": False, "none": None}
    if text.lower() in words:
        return words[text.lower()]
    try:
        if "," in text:
            return tuple(float(part) for part in text.split(","))
        return float(text) if not text.lstrip("+-").isdecimal() else int(text)
    except ValueError:
        return text
