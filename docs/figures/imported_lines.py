"""Lines of our Python code that each process of a flight on hardware imports, in an interpreter of its own.

    python docs/figures/imported_lines.py [--modules]

The last line is their union: the code that a laboratory flies with.
"""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).parents[2]
PARTS: Final = {
    "router": "run.runner('router')",
    "recorder": "run.runner('recorder'); recorder = role('recorder').recorder_settings(fleet, 'main', 0.0)",
    "tracker": "run.runner('tracker'); role('tracker').tracker_settings(fleet)",
    "transmitters": "run.runner('transmitters'); gateway = next(iter(fleet.gateways)); "
    "role('transmitters').gateway_settings(fleet, gateway, Path('/tmp'))",
    "agent": "role('agent').pilot_of(fleet, 'h2')",
    "launcher": "import_module('rcopterx.deploy.hosts.launcher')",
    "scripting": "getattr(import_module('rcopterx'), 'Fleet')",
    "command line": "commands = import_module('rcopterx.command_line').app; "
    "[import_module(f'rcopterx.commands.{name}') for name in ('launch', 'watch', 'steer', 'trajectory')]",
}
"""Statements after which a process has imported what it needs in flight."""
PREPARATION: Final = """
import json, sys
from importlib import import_module
from pathlib import Path
"""
FLEET: Final = """
from msgspec.structs import replace
from rcopterx.deploy.roles import run
from rcopterx.fleet.reading import fleet_path, load_fleet
role = lambda name: import_module(f"rcopterx.deploy.roles.{name}")
fleet = replace(load_fleet(fleet_path("trio")), simulator=None)
"""
REPORT: Final = """
ours = {name: module.__file__ for name, module in sys.modules.items() if name.partition(".")[0] == "rcopterx"}
print(json.dumps({name: file for name, file in ours.items() if file}))
"""


def imported(part: str, checkout: Path = ROOT) -> dict[str, Path]:
    """Our modules that a part has imported, and their files."""
    needs_fleet = part not in ("launcher", "scripting", "command line")
    script = PREPARATION + FLEET * needs_fleet + PARTS[part] + REPORT
    environment = os.environ | {"PYTHONPATH": str(checkout)}
    command = [sys.executable, "-c", script]
    done = subprocess.run(command, check=True, stdout=subprocess.PIPE, cwd=checkout, env=environment)
    found: dict[str, str] = json.loads(done.stdout.splitlines()[-1])
    return {name: Path(file) for name, file in found.items()}


def lines_of(files: dict[str, Path]) -> int:
    """Lines of these modules, those of the simulator apart."""
    counted = (file for name, file in files.items() if not name.startswith("rcopterx.simulator"))
    return sum(len(file.read_text(encoding="utf-8").splitlines()) for file in counted)


def flight_lines(checkout: Path = ROOT) -> int:
    """Lines that any process of a flight imports."""
    everything: dict[str, Path] = {}
    for part in PARTS:
        everything |= imported(part, checkout)
    return lines_of(everything)


def main() -> None:
    """Print the lines of each part and of all."""
    everything: dict[str, Path] = {}
    for part in PARTS:
        files = imported(part)
        everything |= files
        print(f"{part:12} {lines_of(files):6}")
    print(f"{'all':12} {lines_of(everything):6}")
    if "--modules" in sys.argv:
        for name, file in sorted(everything.items()):
            print(f"{lines_of({name: file}):6} {name}")


if __name__ == "__main__":
    main()
