"""The example of keep-out zones: what leads into one is refused, and no vehicle is ever in one."""

import math
import uuid
from collections.abc import Callable
from functools import partial
from pathlib import Path
from runpy import run_path
from typing import Any

import numpy as np
import pytest
from integration_support import Flying, Truth, fleet_text, on_floor
from msgspec.structs import replace
from support.bus import free_port

from rcopterx import RefusedError, Zone
from rcopterx.bus import channels
from rcopterx.formation.placement import entered

pytestmark = [pytest.mark.lockstep, pytest.mark.timeout(240)]

EXAMPLE = Path(__file__).parents[2] / "examples" / "keep_out_zones" / "keep_out_zones.py"


def test_vehicles_fly_round_zones_and_are_refused_what_leads_into_them(fly: Callable[..., None]) -> None:
    example = run_path(str(EXAMPLE))
    text = example["FLEET"].read_text().replace("127.0.0.1:18801", f"127.0.0.1:{free_port()}")
    fly(
        partial(fly_round, example=example),
        f'{text}\n[bus]\nnamespace = "t{uuid.uuid4().hex[:8]}"\n',
    )


def fly_round(flying: Flying, example: dict[str, Any]) -> None:
    inbox = flying.fleet.session.subscribe(channels.LABORATORY, channels.SIMULATOR_UNIT, depth=20_000)
    through, behind, formed, landing, visiting = example["fly"](flying.fleet)
    for refusal, begin, zone in (
        (through, "h1: (0.2", "pillar"),
        (behind, "h1: no place for h2: ", "pillar"),
        (formed, "no place for h2: ", "pillar"),
        (landing, "h2: on its way down ", "table"),
        (visiting, "h2: (-0.6", "visitor"),
    ):
        assert refusal.startswith(begin)
        assert refusal.endswith(f"m is not 0.2 m clear of the keep-out zone {zone}")
    tracks = [received.message.vehicles for received in inbox.drain()]
    assert len(tracks) > 500
    assert flying.fleet.zones.zones.keys() == {"pillar", "table", "visitor"}
    for name in ("h1", "h2"):
        way = np.array([at[name].position_m for at in tracks])
        for zone in flying.fleet.zones.zones.values():
            assert entered(replace(zone, margin_m=0.0), way) is None, name
    truth = Truth(flying)
    flying.fleet.wait_until(lambda: on_floor(truth, "h1") and on_floor(truth, "h2"), 5, "not down")


def test_a_zone_set_onto_a_vehicle_moves_none_and_they_fly_out_of_it_also_home(
    fly: Callable[..., None],
) -> None:
    fly(fly_out, fleet_text())


def fly_out(flying: Flying) -> None:
    fleet = flying.fleet
    fleet.take_off()
    fleet.wait_for_formation()
    place_m = fleet.state_of("h2").place_m
    assert place_m is not None
    x, y, _ = place_m
    fleet.set_zone("visitor", Zone(min_m=(x - 0.1, y - 0.1, 0.0), max_m=(x + 0.1, y + 0.1, 1.9)))
    fleet.wait(2.0)
    assert math.dist(fleet.state_of("h2").place_m or (), place_m) < 0.1
    (remark,) = fleet.state_of("h2").agent.diagnostics.remarks  # type: ignore[union-attr]
    assert remark == "in the zone visitor"
    with pytest.raises(RefusedError, match=r"on its way down .* keep-out zone visitor"):
        fleet["h2"].land()
    with pytest.raises(RefusedError, match=r"no place for h2: .* keep-out zone visitor"):
        fleet["h1"].go_to((0.1, 0.0, 1.0))
    fleet["h1"].go_to((0.9, 0.0, 1.0))
    fleet.wait_for_arrival()
    fleet.wait_for_formation()
    assert not fleet.state_of("h2").agent.diagnostics.remarks  # type: ignore[union-attr]
    place_m = fleet.state_of("h1").place_m
    assert place_m is not None
    x, y, _ = place_m
    fleet.set_zone("visitor", Zone(min_m=(x - 0.1, y - 0.1, 0.0), max_m=(x + 0.1, y + 0.1, 1.9)))
    fleet.home()
