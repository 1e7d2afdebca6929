"""Runs one process of a fleet, as its supervisor: `python -m rcopterx.deploy.roles ROLE UNIT FLEET_FILE`."""

import sys
from pathlib import Path

from rcopterx.deploy.fleet_file.reading import load_fleet
from rcopterx.deploy.roles.run import ROLES, end_with_parent, run_reporting, run_role


def main() -> None:
    """Entry point of a supervised process."""
    if len(sys.argv) != 4:
        sys.exit(f"usage: python -m rcopterx.deploy.roles {{{','.join(ROLES)}}} UNIT FLEET_FILE")
    end_with_parent()
    run_reporting(lambda: run_role(sys.argv[1], sys.argv[2], load_fleet(Path(sys.argv[3]))))


if __name__ == "__main__":
    main()
