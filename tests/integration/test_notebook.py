"""The notebook flies: every cell runs as it stands, on a fleet of real processes."""

from pathlib import Path
from tempfile import TemporaryDirectory

import nbformat
import pytest
from integration_support import fleet_text
from nbclient import NotebookClient

NOTEBOOK = Path(__file__).parents[2] / "docs" / "formation_flight.ipynb"


def read() -> nbformat.NotebookNode:
    return nbformat.read(NOTEBOOK, as_version=4)


def test_the_stored_notebook_shows_a_figure_and_no_error() -> None:
    outputs = [output for cell in read().cells for output in cell.get("outputs", [])]
    assert any("image/png" in output.get("data", {}) for output in outputs)
    assert all(output.output_type != "error" for output in outputs)
    assert NOTEBOOK.stat().st_size < 200_000


@pytest.mark.integration
@pytest.mark.campaign
@pytest.mark.timeout(240)
def test_the_notebook_flies_a_formation_and_draws_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "lab.toml"
    path.write_text(fleet_text())
    notebook = read()
    (parameters,) = [cell for cell in notebook.cells if "parameters" in cell.metadata.get("tags", [])]
    parameters.source = f"FLEET = {str(path)!r}"
    # A short path, because the router's socket lives in it.
    with TemporaryDirectory(prefix="rcopterx-") as run:
        monkeypatch.setenv("RCOPTERX_RUN", run)
        NotebookClient(notebook, timeout=180, kernel_name="python3").execute()
    printed = "".join(output.get("text", "") for cell in notebook.cells for output in cell.get("outputs", []))
    assert "refused: h1: " in printed
    assert "'h3': 'flying'" in printed
    assert "h2 formation error [mm]: {'rms':" in printed
    assert "image/png" in notebook.cells[-1].outputs[-1].data
