"""A layout of Foxglove for a fleet: the scene, plots of every vehicle, events."""

from collections.abc import Sequence
from typing import Any

from rcopterx.ground_station.foxglove.drawing import ROOM
from rcopterx.ground_station.report.latency import STAGES


def layout_of(vehicles: Sequence[str]) -> dict[str, Any]:
    """Layout file as a JSON document; open it in Foxglove with `Layouts`, `Import from file`."""
    topics = {
        "/scene": {"visible": True},
        **{f"/{name}/{topic}": {"visible": False} for name in vehicles for topic in ("pose", "reference")},
    }
    panels: dict[str, Any] = {
        "3D!scene": {
            "followTf": ROOM,
            "followMode": "follow-none",
            "cameraState": {"distance": 5, "phi": 60, "thetaOffset": 45, "perspective": True},
            "topics": topics,
        },
        "Plot!error": _plot("error [mm]", [f"/{name}/flight.error_mm" for name in vehicles]),
        "Plot!sticks": _plot(
            "sticks",
            [f"/{name}/sticks.{stick}" for name in vehicles for stick in ("pitch", "roll", "thrust")],
        ),
        "Plot!latency": _plot(
            "latency by stage [ms]",
            [f"/{name}/latency.{stage}_ms" for name in vehicles[:1] for stage in (*STAGES, "total")],
        ),
        "Log!events": {"topicToRender": "/log"},
    }
    plots = _split("column", "Plot!error", _split("column", "Plot!sticks", "Plot!latency", 50), 33)
    left = _split("column", "3D!scene", "Log!events", 75)
    return {
        "configById": panels,
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": _split("row", left, plots, 60),
    }


def _plot(title: str, paths: Sequence[str]) -> dict[str, Any]:
    return {
        "foxglovePanelTitle": title,
        "paths": [{"value": path, "enabled": True, "timestampMethod": "receiveTime"} for path in paths],
        "showLegend": True,
        "isSynced": True,
        "xAxisVal": "timestamp",
        "followingViewWidth": 30,
    }


def _split(direction: str, first: Any, second: Any, percentage: float) -> dict[str, Any]:
    return {"direction": direction, "first": first, "second": second, "splitPercentage": percentage}
