"""Promises of the cache of kernels: private, found again, no obstacle where nothing is writable."""

import errno
import os
import shutil
import signal
import stat
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from support.waiting import wait_for

from rcopterx.compiling import __main__ as compiling
from rcopterx.compiling import cache

KERNEL = """
import sys
from rcopterx.compiling.compiled import NUMBER, compiled

@compiled(NUMBER)
def doubled(number):
    return 2.0 * number

print(doubled(21.0))
"""


@pytest.fixture(autouse=True)
def fresh() -> Iterator[None]:
    """The process has used no kernels yet."""
    cache.directory.cache_clear()
    yield
    cache.directory.cache_clear()


def test_kernels_lie_in_a_private_directory_of_their_version(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(cache.VARIABLE, str(tmp_path / "here"))
    path = cache.directory()
    assert path is not None
    assert path.parent == tmp_path / "here"
    assert stat.S_IMODE(path.stat().st_mode) == 0o700


def test_other_sources_are_other_kernels(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(cache.VARIABLE, str(tmp_path))
    first = cache.directory()
    monkeypatch.setattr(cache, "MODULES", (*cache.MODULES, "bus.clock"))
    cache.directory.cache_clear()
    assert cache.directory() != first


def test_every_constant_that_a_kernel_freezes_decides_which_kernels_are_used(tmp_path: Path) -> None:
    package = Path(cache.__file__).parents[1]
    found = cache.sources(cache.MODULES)
    assert {"vehicles.state", "control.references.trajectory", "compiling.compiled"} <= set(found)
    for name in found:
        copy = tmp_path / f"{name.replace('.', '/')}.py"
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_bytes(found[name])
    assert cache.sources(cache.MODULES, tmp_path) == cache.sources(cache.MODULES, package)
    state = tmp_path / "vehicles" / "state.py"
    text = state.read_text(encoding="utf-8")
    assert "9.81" in text
    state.write_text(text.replace("9.81", "1.62"), encoding="utf-8")
    assert cache.sources(cache.MODULES, tmp_path) != found


@pytest.mark.parametrize("statement", ["import a, b", "import (\n    a,\n    b,\n)"])
def test_imports_of_modules_from_packages_are_followed(tmp_path: Path, statement: str) -> None:
    (tmp_path / "pack").mkdir()
    (tmp_path / "one.py").write_text(f"import os\nfrom rcopterx.pack {statement}\n")
    (tmp_path / "pack" / "a.py").write_text("from rcopterx.two import X\n")
    (tmp_path / "pack" / "b.py").write_text("")
    (tmp_path / "two.py").write_text("X = 1\n")
    assert set(cache.sources(["one"], tmp_path)) == {"one", "pack.a", "pack.b", "two"}


@pytest.mark.parametrize("call", ["fcntl.flock", "os.fsync"], ids=["no locks", "full"])
def test_the_next_place_is_taken_where_files_cannot_be_stored_or_locked(
    call: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls = []

    def refuse_first(*arguments: object) -> None:
        calls.append(arguments)
        if len(calls) == 1:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setenv(cache.VARIABLE, str(tmp_path / "one"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "two"))
    monkeypatch.setattr(call, refuse_first)
    path = cache.directory()
    assert path is not None
    assert path.parent == tmp_path / "two" / "rcopterx"


def test_ctrl_c_while_kernels_compile_ends_without_a_traceback(tmp_path: Path) -> None:
    process = subprocess.Popen(
        [sys.executable, "-m", "rcopterx.compiling"],
        env={**os.environ, cache.VARIABLE: str(tmp_path)},
        stderr=subprocess.PIPE, text=True, start_new_session=True,
    )  # fmt: skip
    assert process.stderr is not None
    assert "compiles its kernels" in process.stderr.readline()
    wait_for(lambda: any(tmp_path.rglob("*.lock")), "forks that compile")
    os.killpg(process.pid, signal.SIGINT)
    _, stderr = process.communicate(timeout=60)
    assert (process.returncode, stderr) == (cache.INTERRUPTED, "")


def test_without_a_home_no_directory_is_named_after_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("HOME", "XDG_CACHE_HOME", cache.VARIABLE):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(os.path, "expanduser", lambda path: path)
    monkeypatch.setattr(cache.tempfile, "gettempdir", lambda: str(tmp_path))
    monkeypatch.chdir(tmp_path)
    path = cache.directory()
    assert path is not None
    assert path.is_relative_to(tmp_path / f"rcopterx-kernels-{os.getuid()}")
    assert not (tmp_path / "~").exists()


def test_a_place_that_becomes_full_is_left_and_kernels_are_compiled_in_memory(tmp_path: Path) -> None:
    script = (
        "import errno, numba\n"
        "from numba.core import caching\n"
        "def full(*_): raise OSError(errno.ENOSPC, 'No space left on device')\n"
        "caching.IndexDataCacheFile.save = full\n"
    )
    (tmp_path / "kernel.py").write_text(script + KERNEL)
    done = run(tmp_path, {cache.VARIABLE: str(tmp_path / "place")})
    assert (done.returncode, done.stdout) == (0, "42.0\n"), done.stderr
    assert "Traceback" not in done.stderr


def test_the_next_place_is_taken_where_one_cannot_be_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv(cache.VARIABLE, str(tmp_path / "file"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    path = cache.directory()
    assert path is not None
    assert path.parent == tmp_path / "cache" / "rcopterx"


@pytest.mark.parametrize("mode", [0o770, 0o707], ids=["group", "everyone"])
def test_a_place_that_others_may_write_to_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, mode: int
) -> None:
    shared = tmp_path / "shared"
    shared.mkdir()
    shared.chmod(mode)
    monkeypatch.setenv(cache.VARIABLE, str(shared))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    path = cache.directory()
    assert path is not None
    assert path.parent == tmp_path / "cache" / "rcopterx"
    assert list(shared.iterdir()) == []


def test_a_place_of_another_user_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(cache.VARIABLE, str(tmp_path))
    monkeypatch.setattr("os.getuid", lambda: tmp_path.stat().st_uid + 1)
    assert cache.directory() is None
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("mode", [0o770, 0o707], ids=["group", "everyone"])
def test_a_place_that_others_could_replace_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, mode: int
) -> None:
    shared = tmp_path / "shared"
    shared.mkdir()
    shared.chmod(mode)
    monkeypatch.setenv(cache.VARIABLE, str(shared / "mine"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    path = cache.directory()
    assert path is not None
    assert path.parent == tmp_path / "cache" / "rcopterx"
    shared.chmod(mode | stat.S_ISVTX)
    cache.directory.cache_clear()
    assert cache.directory() == shared / "mine" / path.name


def test_a_directory_of_kernels_that_others_may_write_to_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(cache.VARIABLE, str(tmp_path / "here"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    path = cache.directory()
    assert path is not None
    path.chmod(0o777)
    cache.directory.cache_clear()
    assert cache.directory() == tmp_path / "cache" / "rcopterx" / path.name


def test_kernels_are_compiled_also_where_no_place_is_writable(tmp_path: Path) -> None:
    script = "from rcopterx.compiling import cache; cache.directory = lambda: None" + KERNEL
    (tmp_path / "kernel.py").write_text(script)
    done = run(tmp_path, {})
    assert (done.returncode, done.stdout) == (0, "42.0\n"), done.stderr


def run(directory: Path, environment: dict[str, str]) -> subprocess.CompletedProcess[str]:
    process = started(directory, environment)
    stdout, stderr = process.communicate(timeout=300)
    return subprocess.CompletedProcess([], process.returncode, stdout, stderr)


def started(directory: Path, environment: dict[str, str]) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, str(directory / "kernel.py")],
        env=os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])} | environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def test_of_processes_that_start_at_the_same_time_one_compiles_and_says_so(tmp_path: Path) -> None:
    (tmp_path / "kernel.py").write_text(KERNEL)
    environment = {cache.VARIABLE: str(tmp_path / "kept")}
    processes = [started(tmp_path, environment) for _ in range(2)]
    outputs = [process.communicate(timeout=300) for process in processes]
    assert [stdout for stdout, _ in outputs] == ["42.0\n", "42.0\n"]
    assert sorted("once" in stderr for _, stderr in outputs) == [False, True]


def test_clones_of_the_same_sources_share_machine_code(tmp_path: Path) -> None:
    (tmp_path / "kernel.py").write_text("from rcopterx.control.models import lags; print(lags.__file__)")
    announced = {}
    for clone in ("first", "second"):
        package = Path(cache.__file__).parents[1]
        shutil.copytree(package, tmp_path / clone / "rcopterx", ignore=shutil.ignore_patterns("__pycache__"))
        done = run(tmp_path, {cache.VARIABLE: str(tmp_path / "kept"), "PYTHONPATH": str(tmp_path / clone)})
        assert done.stdout.startswith(str(tmp_path / clone)), done.stderr
        announced[clone] = "once" in done.stderr
    assert announced == {"first": True, "second": False}


def test_everything_is_compiled_in_a_process_of_its_own_unless_it_is_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    commands = []

    def ran(command: list[str], check: bool) -> subprocess.CompletedProcess[str]:
        commands.append(command)
        return subprocess.CompletedProcess(command, 3)

    monkeypatch.setattr("rcopterx.compiling.cache.subprocess.run", ran)
    monkeypatch.setenv(cache.VARIABLE, str(tmp_path))
    with pytest.raises(OSError, match="ended with 3"):
        cache.compile_all()
    assert commands == [[sys.executable, "-m", "rcopterx.compiling"]]
    path = cache.directory()
    assert path is not None
    (path / cache.COMPLETE).touch()
    cache.compile_all()
    assert len(commands) == 1


def test_modules_that_cannot_be_compiled_are_named_and_tried_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv(cache.VARIABLE, str(tmp_path))
    monkeypatch.setattr(compiling, "MODULES", ("compiling.cache", "nowhere"))
    assert compiling.main() == 1
    assert "nowhere: " in capsys.readouterr().err
    monkeypatch.setattr(compiling, "MODULES", ("compiling.cache",))
    assert compiling.main() == 0
    assert "... compiled in" in capsys.readouterr().err
    assert compiling.main() == 0
    assert capsys.readouterr().err == ""


def kernels_of_the_past(base: Path, count: int) -> list[Path]:
    """Directories of other versions, the oldest first, each with a file."""
    paths = [base / f"kernels-{index:016x}" for index in range(count)]
    for index, path in enumerate(paths, start=1):
        path.mkdir()
        (path / "kernel.nbi").touch()
        os.utime(path, (index, index))
    return paths


def test_kernels_used_last_are_kept_and_older_ones_removed(tmp_path: Path) -> None:
    paths = kernels_of_the_past(tmp_path, cache.KEPT + 2)
    (tmp_path / "flights").mkdir()
    cache.remove_unused(tmp_path, now_s=2 * cache.KEPT_S)
    assert sorted(tmp_path.iterdir()) == [tmp_path / "flights", *paths[2:]]


def test_kernels_of_the_last_day_are_kept_however_many_there_are(tmp_path: Path) -> None:
    paths = kernels_of_the_past(tmp_path, cache.KEPT + 2)
    cache.remove_unused(tmp_path, now_s=cache.KEPT_S)
    assert sorted(tmp_path.iterdir()) == paths


def test_the_time_of_kernels_is_that_of_the_last_start_with_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(cache.VARIABLE, str(tmp_path))
    own = cache.directory()
    assert own is not None
    os.utime(own, (0, 0))
    cache.directory.cache_clear()
    assert cache.directory() == own
    assert own.stat().st_mtime > 0


def test_a_process_compiles_into_its_directory_also_after_that_was_removed(tmp_path: Path) -> None:
    with cache.only_one(tmp_path / "kernels-0", "module"):
        assert (tmp_path / "kernels-0").is_dir()


def test_compiling_removes_what_older_versions_left(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(cache.VARIABLE, str(tmp_path))
    monkeypatch.setattr(compiling, "MODULES", ("compiling.cache",))
    oldest, *others = kernels_of_the_past(tmp_path, cache.KEPT)
    assert compiling.main() == 0
    assert not oldest.exists()
    assert all(path.exists() for path in others)
