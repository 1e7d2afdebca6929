"""The example of a wand that leads and a hand that walks through a formation, with the figures of both."""

import uuid
from collections.abc import Callable
from pathlib import Path
from runpy import run_path

import numpy as np
import pytest
from integration_support import Flying
from support.bus import free_port

from rcopterx.bus import channels

pytestmark = [pytest.mark.integration, pytest.mark.lockstep, pytest.mark.timeout(240)]

EXAMPLE = Path(__file__).parents[2] / "examples" / "wand" / "wand.py"
NAMES = ("h1", "h2", "h3", "h4", "h5")
BEHIND_MM = 40.0
DISTANCE_M = 0.35
HELD_M = 0.15


def test_five_follow_a_wand_and_make_way_for_a_hand(launch: Callable[..., Flying]) -> None:
    example = run_path(str(EXAMPLE))
    text = example["FLEET"].read_text().replace("127.0.0.1:18801", f"127.0.0.1:{free_port()}")
    flying = launch(f'{text}\n[bus]\nnamespace = "t{uuid.uuid4().hex[:8]}"\n')
    fleet = flying.fleet
    fleet.take_off(height_m=1.0)
    rooms = fleet.session.subscribe(channels.LABORATORY, channels.SIMULATOR_UNIT, depth=20_000)
    seen = {name: fleet.session.subscribe(channels.POSE, name, depth=20_000) for name in ("wand", "hand")}

    def gaps_m(subject: str) -> dict[str, np.ndarray]:
        """Ways from a subject to each vehicle, at every frame."""
        places = {
            one.message.frame: one.message.position_m
            for one in seen[subject].drain()
            if one.message.position_m
        }
        true = {one.message.frame: one.message.vehicles for one in rooms.drain()}
        frames = sorted(places.keys() & true.keys())
        return {
            name: np.array([true[at][name].position_m for at in frames])
            - np.array([places[at] for at in frames])
            for name in NAMES
        }

    example["lead"](fleet)
    moving = round((example["SETTLING_S"] * 2 + 2.0) / 0.02)
    for name, gap_m in gaps_m("wand").items():
        link = fleet.file.vehicles[name].follow
        offset_m = np.array((-0.9, 0.0, 0.0)) + (np.array(link[0].offset_m) if link else 0.0)
        error_mm = 1e3 * np.linalg.norm(gap_m[moving:] - offset_m, axis=1)
        rms_mm = float(np.sqrt(np.mean(error_mm**2)))
        print(f"{name}: {rms_mm:.1f} mm rms behind the wand, at most {error_mm.max():.0f} mm")
        assert rms_mm <= BEHIND_MM, name
    assert example["lose"](fleet) == "hold"
    assert fleet.state_of("wand").phase == "unseen"
    held_m = [one.message.vehicles["h1"].position_m for one in rooms.drain()][50:]
    assert np.ptp(np.array(held_m), axis=0).max() < HELD_M
    example["walk"](fleet)
    for name, gap_m in gaps_m("hand").items():
        distance_m = float(np.linalg.norm(gap_m, axis=1).min())
        print(f"{name}: {distance_m:.2f} m from the hand at least")
        assert distance_m >= DISTANCE_M, name
        assert fleet.state_of(name).phase == "flying"
