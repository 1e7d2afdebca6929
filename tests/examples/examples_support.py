"""Fleets for examples."""

import uuid
from pathlib import Path

from support.bus import free_port

ROOT = Path(__file__).parents[2]


def fleet_file(directory: Path, name: str) -> Path:
    """A shipped fleet on ports of its own, with short horizons for slow computers."""
    text = (ROOT / "fleet" / "fleets" / f"{name}.toml").read_text(encoding="utf-8")
    bus = f'[bus]\nnamespace = "t{uuid.uuid4().hex[:8]}"\n'
    path = directory / f"{name}.toml"
    text = text.replace("127.0.0.1:18801", f"127.0.0.1:{free_port()}").replace("horizon = 50", "horizon = 30")
    path.write_text(f"{text}\n{bus}")
    return path
