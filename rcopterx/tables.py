"""Tables that are data: TOML files beside the modules that use them."""

import tomllib
from pathlib import Path
from typing import Any


def table_beside(module: str, name: str) -> dict[str, Any]:
    """Return the table `NAME.toml` in the directory of a module, which passes its `__file__`."""
    return tomllib.loads(Path(module).with_name(f"{name}.toml").read_text("utf-8"))
