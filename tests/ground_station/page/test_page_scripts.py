"""Promises of the scripts of the page, run by Node.js."""

import json
import shutil
import subprocess
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rcopterx.ground_station import page

NODE = shutil.which("node")
pytestmark = pytest.mark.skipif(NODE is None, reason="apt-get install nodejs")
WEB = Path(page.__path__[0]) / "web"
MODULES = list(WEB.glob("*.js"))
CAMERA = """
const { Camera } = await import('data:text/javascript,' + encodeURIComponent(process.env.SOURCE));
const camera = new Camera();
const [volume, width, height, azimuth, elevation, place] = JSON.parse(process.env.INPUT);
camera.resize(width, height);
camera.fit(volume, azimuth, elevation);
const corner = (i) => [0, 1, 2].map((axis) => volume[i >> axis & 1][axis]);
const corners = [...Array(8).keys()].map((i) => camera.project(corner(i)));
const [x, y] = camera.project(place);
const back = camera.onLevel(x, y, place[2]), height_m = camera.onVertical(x, y, place);
console.log(JSON.stringify({ corners, back, height_m }));
"""


def run(*arguments: str, stdin: str = "", **environment: str) -> subprocess.CompletedProcess[str]:
    assert NODE is not None
    return subprocess.run(
        [NODE, *arguments],
        input=stdin,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
        env=environment,
    )


@pytest.mark.parametrize("script", MODULES, ids=lambda path: path.name)
def test_every_module_is_javascript(script: Path) -> None:
    assert not run("--input-type=module", "--check", stdin=script.read_text("utf-8")).stderr


@pytest.mark.parametrize("script", MODULES, ids=lambda path: path.name)
def test_text_of_the_fleet_never_becomes_markup(script: Path) -> None:
    text = script.read_text("utf-8")
    assert "outerHTML" not in text
    assert "insertAdjacentHTML" not in text
    # KILL restores the label of the document.
    assert text.count("innerHTML") == (2 if script.name == "kill.js" else 0)


SIZE = st.floats(0.5, 10.0)


@settings(max_examples=8)
@given(
    st.tuples(SIZE, SIZE, SIZE), st.integers(300, 2000), st.integers(300, 1200), st.floats(-3.0, 3.0),
    st.floats(0.2, 1.4), st.tuples(*3 * [st.floats(0.1, 0.9)]),
)  # fmt: skip
def test_the_camera_shows_the_whole_volume_and_clicks_meet_what_is_below_them(
    size: tuple[float, float, float], width: int, height: int, azimuth: float, elevation: float,
    share: tuple[float, float, float],
) -> None:  # fmt: skip
    low, high = [-size[0] / 2, -size[1] / 2, 0.0], [size[0] / 2, size[1] / 2, size[2]]
    place = [a + part * (b - a) for a, b, part in zip(low, high, share, strict=True)]
    shown = run(
        "--input-type=module", "-e", CAMERA, SOURCE=(WEB / "camera.js").read_text("utf-8"),
        INPUT=json.dumps([[low, high], width, height, azimuth, elevation, place]),
    )  # fmt: skip
    found = json.loads(shown.stdout)
    for x, y, depth in found["corners"]:
        assert depth > 0
        assert 0 <= x <= width
        assert 0 <= y <= height
    assert max(max(abs(x / width - 0.5), abs(y / height - 0.5)) for x, y, _ in found["corners"]) > 0.35
    assert found["back"] == pytest.approx(place, abs=1e-6)
    assert found["height_m"] == pytest.approx(place[2], abs=1e-6)
