"""`rcopterx kill` as it is typed: a fresh process finds the fleet that is up and cuts its motors at once."""

import subprocess
import sys
import time
from pathlib import Path

import pytest
from integration_support import NAMES, Flying, all_states, fleet_text, transmitter_state

from rcopterx.bus import channels
from rcopterx.bus.messages import Applied
from rcopterx.bus.subscription import Inbox

pytestmark = [pytest.mark.integration, pytest.mark.timeout(180)]

TYPED_TO_CUT_S = 5.0
"""Very loose, for a busy machine that starts the command; docs/safety.md has measured times."""


def typed(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "rcopterx", *words], capture_output=True, text=True, timeout=60
    )


def first_killed_s(flying: Flying, name: str, applied: Inbox[Applied]) -> float:
    """When the motors were first cut: the reply to the kill may overtake its message."""
    written_s: list[float] = []

    def cut() -> bool:
        written_s.extend(one.message.written_s for one in applied.drain() if one.message.state == "killed")
        return bool(written_s)

    flying.fleet.wait_until(cut, 10.0, "motors cut", [name])
    return written_s[0]


def test_a_typed_kill_cuts_the_vehicles_it_names_or_all_and_never_those_of_another_fleet(
    flying: Flying, tmp_path: Path
) -> None:
    other = tmp_path / "attic.toml"
    text = fleet_text()
    other.write_text(text.replace('name = "lab"', 'name = "attic"'))
    done = typed("kill", "-f", str(other))
    assert done.returncode == 1
    assert "error: attic is not up on this computer, lab is; leave out -f" in done.stderr
    assert all_states(flying, "armed")

    done = typed("kill", "h2", "h9")
    assert done.returncode == 1
    assert done.stdout == "lab: h2 killed\n"
    assert done.stderr == "error: h9 is no vehicle of lab\n"
    wanted = {"h1": "armed", "h2": "killed", "h3": "armed"}
    flying.fleet.wait_until(
        lambda: {name: transmitter_state(flying, name) for name in NAMES} == wanted, 30, "others", NAMES
    )

    applied = {
        name: flying.fleet.session.subscribe(channels.APPLIED, name, depth=512) for name in ("h1", "h3")
    }
    typed_s = time.monotonic()
    done = typed("kill")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.splitlines() == [f"lab: {name} killed" for name in NAMES]
    for name, inbox in applied.items():
        cut_s = first_killed_s(flying, name, inbox)
        print(f"{name}: motors cut {1000 * (cut_s - typed_s):.0f} ms after it was typed")
        assert cut_s - typed_s < TYPED_TO_CUT_S
