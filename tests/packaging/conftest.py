"""Archives and wheels are built once, whichever process of pytest asks first."""

import fcntl
import os

import pytest
from packaging_support import Built, build_all


@pytest.fixture(scope="session")
def built(tmp_path_factory: pytest.TempPathFactory) -> Built:
    common = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        common = common.parent
    directory = common / "built"
    with (common / "built.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not directory.exists():
            build_all(directory)
    found = [
        file
        for project in ("rcopterx", "rcopterx_studies")
        for ending in (".tar.gz", ".whl")
        for file in directory.glob(f"{project}-*{ending}")
    ]
    return Built(*found)
