"""The page gets the keep-out zones and draws them."""

import json
import random
import shutil
import subprocess
from pathlib import Path

import msgspec
import pytest

from rcopterx.bus.messages import Zone
from rcopterx.fleet.consistency import check_zone
from rcopterx.fleet.reading import load_fleet
from rcopterx.ground_station import page

NODE = shutil.which("node")
FLEET = Path(__file__).parents[3] / "examples" / "keep_out_zones" / "keep_out_zones.toml"
DRAWN = """
const { Scene } = await import(process.argv[1]);
const drawn = { polygons: [], segments: [], names: [] };
const painter = {
  context: {}, polygon: (places) => drawn.polygons.push(places),
  segments: (pairs) => drawn.segments.push(...pairs), text: (place, name) => drawn.names.push([name, place]),
};
Scene.prototype.drawZones.call({ painter, colours: {}, zones: JSON.parse(process.argv[2]), corner: null });
console.log(JSON.stringify(drawn));
"""


@pytest.mark.skipif(NODE is None, reason="apt-get install nodejs")
def test_zones_are_drawn_with_their_corners_and_names() -> None:
    file = load_fleet(FLEET)
    script = (Path(page.__path__[0]) / "web" / "scene.js").as_uri()
    shown = msgspec.json.encode(file.zones).decode()
    assert NODE is not None
    ran = subprocess.run(
        [NODE, "--input-type=module", "--eval", DRAWN, script, shown],
        capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip
    assert ran.returncode == 0, ran.stderr
    drawn = json.loads(ran.stdout)
    assert [name for name, _ in drawn["names"]] == ["pillar", "table"]
    corners = [[tuple(round(value, 6) for value in place) for place in side] for side in drawn["polygons"]]
    round_one, square = corners[: 24 + 2], corners[24 + 2 :]
    pillar = [place for side in round_one for place in side]
    assert {z for _, _, z in pillar} == {0.0, 2.0}
    assert all(abs((x - 0.6) ** 2 + y**2 - 0.15**2) < 1e-5 for x, y, _ in pillar)
    table = {place for side in square for place in side}
    assert table == {(x, y, z) for x in (-0.9, -0.3) for y in (0.7, 1.1) for z in (0.0, 0.7)}
    assert len(square) == 6


CLICKED = """
const sent = [];
globalThis.fetch = async (address) => {
  sent.push(JSON.parse(decodeURIComponent(address.slice(3))).arguments);
  return { ok: true };
};
const { Tools } = await import(process.argv[1]);
for (const corners of JSON.parse(process.argv[2])) {
  const fields = { name: 'zone1', shape: 'cylinder', top: '2' };
  const zone = { querySelector: (selector) => ({ value: fields[selector.slice(6, -1)] }) };
  const scene = { corner: null, camera: { onLevel: (x, y) => [x, y, 0] } };
  const volume = [[-1, -1, 0], [1, 1, 2]];
  const tools = Object.assign(Object.create(Tools.prototype), { scene, zone, volume });
  for (const [x, y] of corners) tools.clickCorner({ x, y });
}
console.log(JSON.stringify(sent));
"""


@pytest.mark.skipif(NODE is None, reason="apt-get install nodejs")
def test_a_cylinder_of_any_two_clicks_has_the_corners_of_a_square_which_the_fleet_accepts() -> None:
    rng = random.Random(1)
    corners = [[[rng.uniform(-0.5, 0.5) for _ in range(2)] for _ in range(2)] for _ in range(200)]
    script = (Path(page.__path__[0]) / "web" / "tools.js").as_uri()
    assert NODE is not None
    ran = subprocess.run(
        [NODE, "--input-type=module", "--eval", CLICKED, script, json.dumps(corners)],
        capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip
    assert ran.returncode == 0, ran.stderr
    sent = json.loads(ran.stdout)
    assert len(sent) == len(corners)
    for one in sent:
        check_zone("zone1", Zone(min_m=tuple(one["low_m"]), max_m=tuple(one["high_m"]), shape=one["shape"]))
