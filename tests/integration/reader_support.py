"""A reader who types what the pages say, in a copy of the repository and a shell of their own."""

import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

ROOT = Path(__file__).parents[2]
COPIED = ("deploy", "docs", "examples", "tests")
BLOCK = re.compile(r"^ *```(?:sh|console|bash)\n(.*?)^ *```", re.MULTILINE | re.DOTALL)
CELL = re.compile(r"`(rcopterx [^`]+)`")
LASTS = re.compile(
    r"rcopterx (up|host|ground|top|tracker|replay-tracker|demo$|logs .*--follow)|python http_bridge.py|.*&$"
)
"""Commands that run until Ctrl-C, in a terminal of their own."""
ENDS_THE_FLEET = re.compile(r"rcopterx (demo|up (?!.*--host)|(fly|experiment) |(bind|range-check)|replay$)")
"""Commands that need the fleet to be down: a reader ends it with Ctrl-C."""
DAEMON, PART_OF_A_FLEET = re.compile("^rcopterx host "), re.compile("^rcopterx up .*--host ")
"""Parts of one fleet, beside which no other fleet may be up."""
MAY_END_WITH_1 = re.compile(r"rcopterx replay .*--agent")
"""It ends with 1 if a busy machine aborted a step, which cannot be replayed."""
TYPED_S, READY_S, END_S = 420.0, 180.0, 40.0
"""Kernels may have to be compiled before the first fleet is ready."""


def lines_of(text: str) -> list[str]:
    """Commands of a page in their order, as they are typed: with pipes, without remarks."""
    lines = []
    for block in BLOCK.findall(text):
        directory = ""
        for line in block.replace("\\\n", " ").splitlines():
            command = line.partition(" #")[0].strip()
            if command.startswith("cd "):
                directory = f"{command} && "
            elif command:
                lines.append(directory + command)
    return lines


def cells_of(text: str) -> list[str]:
    """Commands in the tables of a page of tasks, in their order."""
    rows = [line for line in text.splitlines() if line.startswith("| ")]
    return [command for row in rows for command in CELL.findall(row)]


class Reader:
    """Types one command after the other."""

    def __init__(self, directory: Path, run_directory: str) -> None:
        self.directory = directory
        shutil.copy(ROOT / "README.md", directory)
        for name in COPIED:
            shutil.copytree(ROOT / name, directory / name, ignore=shutil.ignore_patterns("__pycache__"))
        path = [str(Path(sys.executable).parent), os.environ["PATH"]]
        self._environment = os.environ | {
            "BROWSER": "true",
            "COLUMNS": "100",
            "PATH": os.pathsep.join(path),
            "PYTHONPATH": os.pathsep.join([str(ROOT), str(directory / "plugins")]),
            "RCOPTERX_FLIGHTS": str(directory / "flights"),
            "RCOPTERX_RUN": run_directory,
        }
        self._lasting: list[tuple[str, subprocess.Popen[bytes], Path]] = []

    def type(self, command: str) -> str:
        """Run a command to its end, or until `interrupt`; returns its output."""
        if ENDS_THE_FLEET.search(command):
            self.interrupt(but=DAEMON)
        elif PART_OF_A_FLEET.search(command):
            self.interrupt(but=PART_OF_A_FLEET)
        if LASTS.search(command):
            self._begin(command.removesuffix("&"))
            return ""
        done = subprocess.run(
            ["bash", "-c", command],
            cwd=self.directory, env=self._environment, stdin=subprocess.DEVNULL,
            capture_output=True, text=True, timeout=TYPED_S,
        )  # fmt: skip
        output = done.stdout + done.stderr
        allowed = (0, 1) if MAY_END_WITH_1.search(command) else (0,)
        assert done.returncode in allowed, f"{command}: {output}"
        assert "Traceback" not in output, f"{command}: {output}"
        return done.stdout

    def _begin(self, command: str) -> None:
        log = self.directory / f"typed-{len(list(self.directory.glob('typed-*')))}.log"
        with log.open("wb") as output:
            process = subprocess.Popen(
                ["bash", "-c", f"exec {command}" if "&&" not in command else command],
                cwd=self.directory, env=self._environment, stdin=subprocess.DEVNULL,
                stdout=output, stderr=output, start_new_session=True,
            )  # fmt: skip
        self._lasting.append((command, process, log))
        if re.search(r"rcopterx up (?!.*--host)", command):
            self._wait_until_ready(process, log)

    def _wait_until_ready(self, up: subprocess.Popen[bytes], log: Path) -> None:
        """Repeat `check` until nothing blocks take-off."""
        end_s = time.monotonic() + READY_S
        while True:
            done = subprocess.run(
                ["rcopterx", "check"],
                cwd=self.directory,
                env=self._environment,
                capture_output=True,
                text=True,
            )
            if done.returncode == 0:
                return
            assert up.poll() is None, log.read_text()
            assert time.monotonic() < end_s, done.stdout + done.stderr + log.read_text()

    def flights(self) -> list[str]:
        """Recorded flights, the newest first."""
        return sorted((str(path) for path in (self.directory / "flights").glob("*")), reverse=True)

    def interrupt(self, but: re.Pattern[str] | None = None) -> None:
        """Press Ctrl-C in every terminal but those of these commands; all end without an error."""
        kept = [one for one in self._lasting if but is not None and but.search(one[0])]
        for command, process, log in reversed([one for one in self._lasting if one not in kept]):
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGINT)
            code = process.wait(END_S)
            assert code in (0, 130, -signal.SIGINT), f"{command}: {code}: {log.read_text()}"
            assert "Traceback" not in log.read_text(), f"{command}: {log.read_text()}"
        self._lasting = kept

    def end(self) -> None:
        """Kill all that still runs."""
        for _, process, _ in self._lasting:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()


@contextmanager
def reader(directory: Path) -> Iterator[Reader]:
    """A reader with a copy of the repository; a short path, because the router's socket lives in it."""
    with TemporaryDirectory(prefix="rcopterx-") as run:
        someone = Reader(directory, run)
        try:
            yield someone
            someone.interrupt()
        finally:
            someone.end()
