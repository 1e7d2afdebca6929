"""Promises of the scripts of the page and of the report, run by Node.js."""

import shutil
import subprocess
from pathlib import Path

import pytest

from rcopterx.ground_station import page, report

NODE = shutil.which("node")
pytestmark = pytest.mark.skipif(NODE is None, reason="apt-get install nodejs")
SCRIPTS = [*Path(page.__path__[0]).glob("*.js"), *Path(report.__path__[0]).glob("*.js")]
WINDOW = """
globalThis.document = { createElement: () => ({ getContext: () => null }) };
globalThis.window = { requestAnimationFrame: draw => setTimeout(draw, 1), cancelAnimationFrame: () => {} };
"""
DRAW_THREE_TIMES = """
let drawn = 0;
const draw = () => {
  drawn += 1;
  if (drawn < 3) { window.requestAnimationFrame(draw); return; }
  setTimeout(() => { console.log(drawn, window.rcopterx.frames); process.exit(); }, 50);
};
window.requestAnimationFrame(draw);
"""
ANIMATE = """
const slow = () => {
  for (const from = Date.now(); Date.now() - from < 50;);
  window.requestAnimationFrame(slow);
};
window.requestAnimationFrame(slow);
let steps = 0;
const step = () => { steps += 1; if (steps < 10) window.requestAnimationFrame(() => step()); };
step();
setTimeout(() => { console.log(steps > 2 * window.rcopterx.frames); process.exit(); }, 500);
"""


def run(*arguments: str) -> subprocess.CompletedProcess[str]:
    assert NODE is not None
    return subprocess.run([NODE, *arguments], capture_output=True, text=True, timeout=20, check=False)


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.name)
def test_every_script_is_javascript(script: Path) -> None:
    assert not run("--check", str(script)).stderr


def test_drawing_goes_on_and_is_counted() -> None:
    script = next(path for path in SCRIPTS if path.name == "drawing.js").read_text(encoding="utf-8")
    done = run("-e", WINDOW + script + DRAW_THREE_TIMES)
    # The first picture cannot be distinguished from an animation.
    assert (done.stdout.strip(), done.stderr) == ("3 2", "")


def test_animations_of_the_panel_do_not_wait_for_drawing() -> None:
    script = next(path for path in SCRIPTS if path.name == "drawing.js").read_text(encoding="utf-8")
    done = run("-e", WINDOW + script + ANIMATE)
    assert (done.stdout.strip(), done.stderr) == ("true", "")
