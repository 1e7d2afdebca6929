"""Example programs whose parts are tested and flown.

They are in no package: their folders are on the path while they are imported.
"""

import sys
from pathlib import Path

EXAMPLES = Path(__file__).parents[2] / "examples"
FOLDERS = [str(EXAMPLES), str(EXAMPLES / "light_show"), str(EXAMPLES / "rotation")]
sys.path[:0] = FOLDERS
import gamepad  # noqa: E402
import light_programs  # noqa: E402
import light_show  # noqa: E402
import rotation  # noqa: E402

del sys.path[: len(FOLDERS)]

__all__ = ["EXAMPLES", "gamepad", "light_programs", "light_show", "rotation"]
