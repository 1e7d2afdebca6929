import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from gateway_bench import Laboratory
from restart_bench import Restart
from transmitter_bench import Bench


@pytest.fixture
def restart(tmp_path: Path) -> Iterator[Restart]:
    """A gateway and its radio."""
    bench = Restart(tmp_path / "h1")
    yield bench
    bench.transmitter.port.close()
    bench.radio.unplug()


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    """A transmitter and its radio."""
    bench = Bench(tmp_path / "h1")
    yield bench
    bench.close()


@pytest.fixture
def laboratory(tmp_path: Path) -> Iterator[Laboratory]:
    """A gateway with three radios."""
    laboratory = Laboratory(tmp_path)
    yield laboratory
    laboratory.close()
