"""Promises about processes and their memory: grandchildren count, strangers do not, shared pages once."""

import os
from pathlib import Path

import pytest

from rcopterx_studies.benchmarks.processes import descendants, memory_of


def played(proc: Path, process: int, parent: int, pss_kb: int) -> None:
    directory = proc / str(process)
    directory.mkdir()
    (directory / "stat").write_text(f"{process} (a (strange) name) S {parent} 1 1")
    (directory / "smaps_rollup").write_text(f"Rss: 99999 kB\nPss: {pss_kb} kB\nPss_Anon: 1 kB\n")


def test_grandchildren_count_and_strangers_do_not(tmp_path: Path) -> None:
    for process, parent in ((10, 1), (11, 10), (12, 11), (20, 1)):
        played(tmp_path, process, parent, 500)
    played(tmp_path, 10_000, 12, 500)
    (tmp_path / "10000" / "stat").unlink()
    (tmp_path / "self").symlink_to(tmp_path / "10")
    assert sorted(descendants(10, tmp_path)) == [11, 12]
    assert memory_of([11, 12, 99], tmp_path) == pytest.approx(1.0)


def test_this_process_is_a_descendant_of_its_parent() -> None:
    assert os.getpid() in descendants(os.getppid())
    assert memory_of([os.getpid()]) > 1.0
