import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from restart_bench import Restart


@pytest.fixture
def restart(tmp_path: Path) -> Iterator[Restart]:
    """A gateway and its radio."""
    bench = Restart(tmp_path / "h1")
    yield bench
    bench.transmitter.close()
    bench.radio.close()
