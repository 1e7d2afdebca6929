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
DRAW_TWICE = """
window.requestAnimationFrame(() => window.requestAnimationFrame(() => setTimeout(() => {
  console.log(window.rcopterx.frames);
  process.exit();
}, 50)));
"""


def run(*arguments: str) -> subprocess.CompletedProcess[str]:
    assert NODE is not None
    return subprocess.run([NODE, *arguments], capture_output=True, text=True, timeout=20, check=False)


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.name)
def test_every_script_is_javascript(script: Path) -> None:
    assert not run("--check", str(script)).stderr


def test_drawing_goes_on_and_is_counted() -> None:
    script = next(path for path in SCRIPTS if path.name == "drawing.js").read_text(encoding="utf-8")
    done = run("-e", WINDOW + script + DRAW_TWICE)
    assert (done.stdout.strip(), done.stderr) == ("2", "")
