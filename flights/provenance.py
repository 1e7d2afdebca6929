"""Origin of a flight log: versions, commit, computer."""

import platform
import subprocess
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Final

LIBRARIES: Final = ("numpy", "scipy", "osqp", "eclipse-zenoh", "msgspec", "msgpack", "mcap")
COMMIT_TIMEOUT_S: Final = 2.0
_ROOT: Final = Path(__file__).resolve().parents[1]


def provenance() -> dict[str, str]:
    """Return versions of rcopterx and its libraries, commit where there is one, and the computer."""
    return {
        "rcopterx": _version("rcopterx"),
        "commit": commit(),
        "python": platform.python_version(),
        "computer": platform.node(),
        "processor": _processor(),
        "system": platform.platform(),
        **{name: _version(name) for name in LIBRARIES},
    }


def commit() -> str:
    """Return the commit of the source tree, with `+` where files differ from it; empty outside of one."""
    if not (_ROOT / ".git").exists():
        return ""
    described = ["git", "-C", str(_ROOT), "describe", "--always", "--abbrev=12", "--dirty=+"]
    try:
        done = subprocess.run(
            described, capture_output=True, text=True, timeout=COMMIT_TIMEOUT_S, check=False
        )
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return done.stdout.strip()


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return ""


def _processor() -> str:
    """Return name and generation of the processor, on which the last bits of libraries depend."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor()
    fields = {name.strip(): value.strip() for name, _, value in (line.partition(":") for line in lines)}
    words = [fields[name] for name in ("model name", "cpu family", "model") if name in fields]
    return " / ".join(words) or platform.processor()
