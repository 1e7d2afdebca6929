"""The preview experiment: the same path for all, and the benefit of preview."""

from functools import partial
from pathlib import Path

import pytest

from rcopterx.experiments import preview
from rcopterx.experiments.figures import save_figure
from rcopterx.experiments.runner import Options


def test_preview_and_feed_forward_fly_closer_to_the_path(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(preview, "QUICK_TURNS", 0.25)
    labels: list[str] = []
    result = preview.EXPERIMENT.fly(Options((2,), quick=True), lambda label, _: labels.append(label))
    for condition in ("ideal", "laboratory"):
        table = result.document[condition]
        assert list(table) == [setting.name for setting in preview.SETTINGS]
        assert table["preview_feed_forward"]["rms_mm"] < 0.5 * table["set_points"]["rms_mm"]
        assert table["preview"]["rms_mm"] < table["set_points"]["rms_mm"]
        for row in table.values():
            assert row["rms_mm"] <= row["max_mm"]
    assert len(set(labels)) == 2 * len(preview.SETTINGS)
    save_figure(partial(preview.draw_preview, result), tmp_path / "preview.png")
    assert (tmp_path / "preview.png").stat().st_size > 10_000
