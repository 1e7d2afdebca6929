"""Runs one process: `python -m rcopterx.deploy.roles ROLE UNIT FLEET_FILE [HOST] [--take-over]`."""

import sys
from pathlib import Path

from rcopterx.bus.processes import ROLES
from rcopterx.deploy.processes.table import TAKE_OVER
from rcopterx.deploy.roles.run import end_with_parent, run_reporting, run_role
from rcopterx.fleet.reading import load_fleet


def main() -> None:
    """Entry point of a supervised process."""
    words = [word for word in sys.argv[1:] if word != TAKE_OVER]
    if len(words) not in (3, 4):
        roles = ",".join(ROLES)
        sys.exit(f"usage: python -m rcopterx.deploy.roles {{{roles}}} UNIT FLEET_FILE [HOST] [{TAKE_OVER}]")
    role, unit, path, *host = words
    end_with_parent()
    run_reporting(
        lambda: run_role(role, unit, load_fleet(Path(path)), *host, take_over=TAKE_OVER in sys.argv)
    )


if __name__ == "__main__":
    main()
