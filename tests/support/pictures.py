"""Reports without their pictures, which take most of their time."""

import pytest


def draw_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Write reports without pictures until the end of a test."""
    for name in ("formation_svg", "flight_svg", "latency_svg"):
        monkeypatch.setattr(f"rcopterx.ground_station.report.page.{name}", lambda *_: "")
