"""Source archives and wheels of both distributions, built from a copy of the tree."""

import os
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
NOT_PACKAGED = (".*", "build", "dist", "out", "docs", "tests", "*.egg-info", "__pycache__")
BUILD_S = 300.0
"""A quarter of a minute on a free core; unit tests run at the lowest priority beside fleets."""


@dataclass(frozen=True)
class Built:
    """What `python -m build` makes: wheels are built from source archives, as on any other computer."""

    archive: Path
    wheel: Path
    studies_archive: Path
    studies_wheel: Path

    @property
    def files(self) -> list[Path]:
        return [self.archive, self.wheel, self.studies_archive, self.studies_wheel]


def build_all(directory: Path) -> None:
    """Build a copy of the tree into a new directory; no file of an earlier build gets into the wheel."""
    source = directory / "source"
    shutil.copytree(ROOT, source, symlinks=True, ignore=shutil.ignore_patterns(*NOT_PACKAGED))
    for project in (source, source / "studies"):
        done = subprocess.run(
            [sys.executable, "-m", "build", "--no-isolation", "--outdir", str(directory), str(project)],
            capture_output=True, text=True, timeout=BUILD_S, env=outside_environment(),
        )  # fmt: skip
        assert done.returncode == 0, done.stdout + done.stderr


def outside_environment() -> dict[str, str]:
    """Environment without this source tree."""
    return {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "VIRTUAL_ENV")}
