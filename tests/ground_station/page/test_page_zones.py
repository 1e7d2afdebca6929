"""The page gets the keep-out zones and draws them."""

import json
import shutil
import subprocess
from pathlib import Path

import msgspec
import pytest

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
