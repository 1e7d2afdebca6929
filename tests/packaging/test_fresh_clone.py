"""Promises of a fresh clone: `make` installs and flies, an own controller flies, `make` builds the site."""

import shutil
import subprocess
from pathlib import Path

import pytest
from packaging_support import ROOT, outside_environment

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
pytestmark = [
    pytest.mark.campaign,
    pytest.mark.timeout(900),
    pytest.mark.skipif(not (ROOT / ".git").exists(), reason="not a clone of the repository"),
]


@pytest.fixture(scope="module")
def clone(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("fresh") / "rcopterx"
    typed(f"git clone --quiet {ROOT} {directory}", ROOT)
    return directory


def typed(command: str, directory: Path) -> str:
    """What a command prints that a newcomer types in this directory."""
    done = subprocess.run(
        ["bash", "-c", command],
        cwd=directory, env=outside_environment(), capture_output=True, text=True, timeout=800,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-4000:]
    return done.stdout


@pytest.mark.integration
def test_make_demo_flies_from_a_fresh_clone(clone: Path) -> None:
    flown = typed('make demo ARGS="--no-browser --seconds 40"', clone)
    assert "flown for 40 s" in flown
    assert "rcopterx 0" in typed(". .venv/bin/activate && rcopterx --version", clone)


def test_an_own_controller_is_written_and_flies_in_a_fresh_clone(clone: Path) -> None:
    written = ". .venv/bin/activate && rcopterx new-plugin controller mine"
    typed(f"make kernels && {written} && pip install -e 'mine[test]' && pytest mine", clone)


@pytest.fixture(scope="module")
def site(clone: Path) -> Path:
    typed("make docs", clone)
    return clone / "build" / "site"


def test_make_docs_builds_a_site_that_loads_nothing_from_elsewhere(site: Path) -> None:
    pages = list(site.glob("*.html"))
    assert len(pages) > 25
    for page in pages:
        text = page.read_text(encoding="utf-8")
        assert 'src="http' not in text, page.name
        assert '<link rel="stylesheet" href="http' not in text, page.name


@pytest.mark.skipif(CHROMIUM is None, reason="apt-get install chromium")
def test_the_site_is_searched_from_the_disk_without_a_network(site: Path) -> None:
    sync_api = pytest.importorskip("playwright.sync_api", reason="pip install playwright")
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        page = browser.new_context(offline=True).new_page()
        page.goto((site / "index.html").as_uri())
        page.locator("input.md-search__input").click(force=True)
        page.keyboard.type("real-time priority")
        found = page.locator(".md-search-result__link").first
        found.wait_for(timeout=30_000)
        assert "real_time.html" in str(found.get_attribute("href"))
        browser.close()
