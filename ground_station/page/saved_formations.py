"""Formations that users of the page have saved, in a file for every fleet."""

import os
from collections.abc import Mapping
from pathlib import Path

import msgspec

from rcopterx.agents.formation.topology import FormationGraph, ancestors
from rcopterx.bus.messages import LeaderLink

Formation = dict[str, tuple[LeaderLink, ...]]
"""Links to leaders by vehicle; empty for a vehicle that leads."""
_DECODER = msgspec.json.Decoder(dict[str, Formation])


class SavedFormationsError(ValueError):
    """The file of saved formations cannot be read or written."""


def default_path(fleet: str) -> Path:
    """File with the formations of a fleet, among the user's data."""
    data = os.environ.get("XDG_DATA_HOME") or Path.home() / ".local" / "share"
    return Path(data) / "rcopterx" / "formations" / f"{fleet}.json"


class SavedFormations:
    """Formations by name in a file, which need not exist; read again at every call, as pages share it."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def all(self) -> dict[str, Formation]:
        """Every formation, in the order in which they were saved."""
        try:
            return _DECODER.decode(self.path.read_bytes())
        except FileNotFoundError:
            return {}
        except (OSError, msgspec.MsgspecError) as error:
            raise SavedFormationsError(f"{self.path}: {error}") from None

    def save(self, formation: Formation) -> str:
        """Save a formation and return its name, the lowest free number."""
        kept = self.all()
        name = next(str(number) for number in range(1, len(kept) + 2) if str(number) not in kept)
        self._write({**kept, name: formation})
        return name

    def forget(self, name: str) -> None:
        """Remove a formation, if it is there."""
        self._write({other: formation for other, formation in self.all().items() if other != name})

    def _write(self, formations: Mapping[str, Formation]) -> None:
        """Replace the file atomically."""
        new = self.path.with_suffix(".new")
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            new.write_bytes(msgspec.json.format(msgspec.json.encode(formations), indent=2) + b"\n")
            new.replace(self.path)
        except OSError as error:
            raise SavedFormationsError(f"{self.path}: {error.strerror}") from None


def in_words(formation: Formation) -> str:
    """Description of a formation: each head with its followers."""
    heads = [name for name, links in formation.items() if not links]
    led = {head: [name for name in formation if head in ancestors(formation, name)] for head in heads}
    return "; ".join(
        f"{head} leads {' '.join(names)}" if names else f"{head} alone" for head, names in led.items()
    )


def in_order(formation: FormationGraph) -> list[str]:
    """Vehicles with leaders before their followers: in this order no change makes a cycle."""
    return sorted(formation, key=lambda name: len(ancestors(formation, name)))
