"""Promises of the flame graphs: one process of each role, and a reason where none can be sampled."""

import subprocess
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from rcopterx.benchmarks.flame_graphs import command, entitle, one_of_each_role, sample


def test_one_process_of_each_role_is_sampled_and_none_that_has_ended() -> None:
    children = {"router": "router", "h1": "agent", "h2": "agent", "tracker": "tracker"}
    pids = {"router": 10, "h1": 11, "h2": 12, "tracker": None}
    supervisor = SimpleNamespace(
        children={name: SimpleNamespace(spec=SimpleNamespace(role=role)) for name, role in children.items()},
        pid=pids.get,
    )
    launcher: Any = SimpleNamespace(supervisor=supervisor)
    assert one_of_each_role(launcher) == {"router": 10, "agent": 12}


def test_a_sampler_goes_on_while_real_time_processes_work() -> None:
    found = command(12, Path("flame_agent.svg"), 7.0)
    assert found[:2] == ["chrt", "-f"]
    assert found[found.index("--pid") + 1] == "12"
    assert "--nonblocking" in found


def test_what_py_spy_says_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    failed = subprocess.CompletedProcess([], 1, stderr="Error: no such process\n")
    monkeypatch.setattr(subprocess, "run", lambda *_, **__: failed)
    with pytest.raises(SystemExit, match="no such process"):
        sample(12, Path("flame_agent.svg"), 7.0)


def test_a_figure_tells_what_it_shows(tmp_path: Path) -> None:
    figure = tmp_path / "flame_agent.svg"
    figure.write_text('<svg><text id="title" x="1">py-spy record --pid 12</text></svg>')
    entitle(figure, "agent, 6 vehicles")
    assert figure.read_text() == '<svg><text id="title" x="1">agent, 6 vehicles</text></svg>'
