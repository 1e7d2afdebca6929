"""Keeps the processes of a host running: starts and stops them in order, and restarts those that die."""

import math
import os
import selectors
import signal
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final

from rcopterx.bus.heartbeat import LoopPhase
from rcopterx.bus.processes import ROLES, SPARE, TRANSMITTERS, Duty
from rcopterx.deploy.processes.attempts import Attempts
from rcopterx.deploy.processes.forking import ForkedProcess, ForkServer
from rcopterx.deploy.processes.table import EXIT_ELSEWHERE, ProcessSpec
from rcopterx.deploy.spares.spares import Spares
from rcopterx.deploy.watchdog.liveness import Liveness, Watched
from rcopterx.deploy.watchdog.watchdog import Hung, Watchdog
from rcopterx.fleet.schema import WatchdogConfig

STABLE_AFTER_S = 2.0
PREPARE_S: Final = 0.1  # between two checks of the fork server and of the spares, as long as none is missing
SETTLED_S: Final = 0.2  # after the last start of a process; until then no spare is started
START_RETRY_S: Final = 0.2
SPARE_RETRY_S: Final = 1.0
SPARE_SILENCE_S: Final = 0.15  # a spare that has shown no progress for so long does not take over
NO_LIMITS: Final = WatchdogConfig(enabled=False)
STOP_TURN_S: Final = 0.05
STOP_LIMIT_S = 12.0  # without the time in which transmitter gateways land their vehicles
QUICK_RESTARTS = 3
MAX_PAUSE_S = 5.0


def restart_pause_s(quick_deaths: int) -> float:
    """Pause before a restart; none after the first of the deaths that came shortly after a start."""
    if quick_deaths < QUICK_RESTARTS:
        return 0.0
    return float(min(MAX_PAUSE_S, 0.2 * 2 ** (quick_deaths - QUICK_RESTARTS)))


@dataclass
class Child:
    """One supervised process."""

    spec: ProcessSpec
    process: ForkedProcess | None = None
    started_s: float = 0.0
    restart_at_s: float = 0.0  # when it is started again; 0 if no restart is due
    restarts: int = 0
    hung: int = 0  # how often it was killed because it made no progress
    quick_deaths: int = 0
    wanted: bool = True  # whether it shall run; any thread may change it at any time
    take_over: bool = False  # whether it starts by taking over from an agent that flies its vehicle elsewhere
    leaving_since_s: float | None = None  # when it received SIGTERM; infinite once it is killed
    verdict: Hung | None = None  # why the watchdog killed it, until its death is reported


def signal_name(number: int) -> str:
    """Return the name of a signal, or its number if it has no name."""
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"


class Supervisor:
    """Runs the processes of one host."""

    def __init__(
        self,
        specs: list[ProcessSpec],  # processes in starting order
        snapshot: Path,  # snapshot of the fleet file that each process reads
        log_directory: Path,  # directory of their log files
        forks: ForkServer,  # starts them; closed with them
        *,
        spares: Spares | None = None,  # replace them; by default there are none
        # for how long processes may make no progress; by default without limit
        watchdog: WatchdogConfig = NO_LIMITS,
        clock: Callable[[], float] = time.monotonic,  # monotonic clock [s]
        # how long a process that has died has run [s]; by default on this clock
        lived_s: Callable[[str], float] | None = None,
    ) -> None:
        self.children = {spec.name: Child(spec) for spec in specs}
        self._snapshot = snapshot.resolve()
        self._logs = log_directory
        self._forks = forks
        self.spares = spares or Spares(forks, (), (), log_directory / "spare.log")
        self._clock, self._lived_s = clock, lived_s or (lambda name: clock() - self.children[name].started_s)
        self._selector = selectors.DefaultSelector()
        self._attempt = Attempts(clock)
        self._prepare_at_s = self._spare_at_s = 0.0
        self.turns = 0  # number of turns of the loop that calls `watch`
        self.spares_hung = 0
        blind = not any(ROLES[spec.role].knows_flying for spec in specs)
        self.watchdog = Watchdog(watchdog, blind)
        self.watchdog_on = watchdog.enabled  # whether processes that make no progress are killed
        self.liveness = Liveness(self.watchdog)

    def start_all(self) -> list[str]:
        """Start every wanted process in order; return a line for each problem."""
        return [line for name, child in self.children.items() if child.wanted for line in self.start(name)]

    def start(self, name: str) -> list[str]:
        """Start one process, or let a spare take its place; return a line for each problem.

        Without a log it runs all the same; a process that cannot be started is tried again a moment later.
        """
        child = self.children[name]
        child.restart_at_s = 0.0
        log_path = self._logs / f"{name}.log"
        lines = []
        try:
            self._logs.mkdir(parents=True, exist_ok=True)
            log_path.open("ab").close()
        except OSError as error:
            lines.append(f"{name}: writes no log: {error}")
            log_path = Path(os.devnull)
        try:
            self._launch(child, log_path)
        except Exception as error:  # noqa: BLE001 - whatever is wrong with one process, the others start
            child.restart_at_s = self._clock() + START_RETRY_S
            lines.append(f"{name}: cannot be started: {error}; trying again")
        return lines

    def _launch(self, child: Child, log_path: Path) -> None:
        self._prepare_at_s = 0.0
        spec, take_over = child.spec, child.take_over

        def responsive(pid: int) -> bool:
            return self.watchdog.silent_s(pid) <= SPARE_SILENCE_S

        process = self.spares.take(spec.role, spec.unit, log_path, responsive, take_over=take_over)
        if process is None:
            process = self._forks.start(spec.command(self._snapshot, take_over=take_over), log_path)
        child.take_over = False
        child.process = process
        child.started_s = self._clock()
        self._selector.register(process.descriptor, selectors.EVENT_READ, spec.name)

    def watch(self, timeout_s: float) -> list[str]:
        """Start and stop what shall be, kill what hangs, restart what dies; return lines for the user."""
        now, attempt = self._clock(), self._attempt
        self.turns += 1
        lines = attempt("preparing spares", partial(self._prepare, now))
        lines += attempt("starting and stopping", self._start_and_stop)
        lines += attempt("the watchdog", self._kill_hung)
        for name in self._dead(now, timeout_s):
            lines += attempt(f"handling the death of {name}", partial(self._on_death, name))
        return lines + attempt("restarting", self._restart)

    def _dead(self, now_s: float, timeout_s: float) -> list[str]:
        """Names of the processes that have died; waits for a death, or until a restart is due."""
        due = [child.restart_at_s - now_s for child in self.children.values() if child.restart_at_s > 0]
        wait_s = max(0.0, min([timeout_s, *due]))
        if self._selector.get_map():
            return [str(key.data) for key, _ in self._selector.select(wait_s)]
        time.sleep(wait_s)
        return []

    def _restart(self) -> list[str]:
        lines = []
        for name, child in self.children.items():
            if child.restart_at_s > 0 and self._clock() >= child.restart_at_s:
                lines += self.start(name)
                if child.process is not None:
                    child.restarts += 1
                    lines.append(f"{name}: started again (restart {child.restarts})")
        return lines

    def _processes(self) -> dict[str, ForkedProcess]:
        children = self.children.items()
        return {name: process for name, child in children if (process := child.process) is not None}

    def _prepare(self, now_s: float) -> list[str]:
        """Make sure of a fork server and spares, as long as any process is wanted."""
        if now_s < self._prepare_at_s or not any(child.wanted for child in self.children.values()):
            return []
        self._prepare_at_s = now_s + PREPARE_S if self.spares.complete else now_s
        try:
            lines = ["fork server: had ended, started again"] if self._forks.ensure_running() else []
        except OSError as error:
            lines = [f"fork server: cannot be started: {error}; trying again"]
        settled = all(now_s - child.started_s > SETTLED_S for child in self.children.values())
        if settled and now_s >= self._spare_at_s:
            try:
                self.spares.prepare()
            except OSError:
                self._spare_at_s = now_s + SPARE_RETRY_S
        return lines

    def _kill_hung(self) -> list[str]:
        """Kill what makes no progress; the deaths of children are then noticed like any others."""
        if not self.watchdog_on:
            return []
        processes = self.spares.processes
        watched = {pid: Watched(SPARE, spare.page, Duty.STANDBY) for pid, spare in processes.items()}
        children = {}
        for name, process in self._processes().items():
            child = self.children[name]
            if child.verdict is not None:
                process.leave_realtime()
            if child.wanted:
                children[process.pid], processes[process.pid] = child, process
                watched[process.pid] = Watched(name, process.page, ROLES[child.spec.role].duty)
        lines = []
        for hung in self.liveness.check(self._clock(), watched):
            processes[hung.process].kill()
            if hung.process in children:
                children[hung.process].hung += 1
                children[hung.process].verdict = hung
            else:
                self.spares_hung += 1
                lines.append(f"spare: no progress for {hung.silent_s:.2f} s, replaced")
        return lines

    def _start_and_stop(self) -> list[str]:
        """End unwanted children in stopping order, and start those that have become wanted."""
        lines = []
        leaving = [child for child in self.children.values() if not child.wanted and child.process]
        first = min((ROLES[child.spec.role].stop_order for child in leaving), default=0)
        for child in leaving:
            if ROLES[child.spec.role].stop_order == first:
                self._terminate(child)
        for name, child in self.children.items():
            if not child.wanted:
                child.restart_at_s = 0.0
            elif child.process is None and not child.restart_at_s:
                child.quick_deaths = 0
                lines += self.start(name)
                if child.process is not None:
                    lines.append(f"{name}: started")
        return lines

    def _terminate(self, child: Child) -> None:
        """Send SIGTERM to a process; kill it if it has not ended in time."""
        assert child.process is not None
        if child.leaving_since_s is None:
            child.leaving_since_s = self._clock()
            child.process.terminate()
        elif self._clock() - child.leaving_since_s > STOP_LIMIT_S + child.spec.landing_s:
            child.process.kill()
            child.process.leave_realtime()
            # Killed once, however long it takes until its death is noticed.
            child.leaving_since_s = math.inf

    def _on_death(self, name: str) -> list[str]:
        child = self.children[name]
        assert child.process is not None
        descriptor = child.process.descriptor
        code = child.process.wait()
        child.process = None
        self._selector.unregister(descriptor)
        child.leaving_since_s = None
        verdict, child.verdict = child.verdict, None
        if not child.wanted:
            return [f"{name}: ended"]
        if code == EXIT_ELSEWHERE:
            child.wanted = False
            return [f"{name}: ended, because another agent flies {child.spec.unit}"]
        quick = self._lived_s(name) < STABLE_AFTER_S
        child.quick_deaths = child.quick_deaths + 1 if quick else 0
        child.restart_at_s = self._clock() + restart_pause_s(child.quick_deaths)
        cause = f"killed by {signal_name(-code)}" if code < 0 else f"ended with exit code {code}"
        if verdict is not None:
            silence = f"hung: no progress for {verdict.silent_s:.2f} s, {verdict.limit_s:g} s are allowed"
            cause = f"{silence}; {cause}"
        return [f"{name}: {cause}; log: {self._logs / (name + '.log')}"]

    @property
    def flying(self) -> bool:
        """Whether a vehicle is in the air, as far as a process of this host knows."""
        return any(process.page.phase is LoopPhase.FLYING for process in self._processes().values())

    def longest_silence_s(self, name: str) -> float:
        """Longest time without progress of a running process since it began to work."""
        pid = self.pid(name)
        return 0.0 if pid is None else self.watchdog.longest_s(pid)

    def running(self) -> list[str]:
        """Names of the processes that run now."""
        return list(self._processes())

    def roles(self) -> dict[int, str]:
        """Roles of the processes that run now, by process id."""
        return {process.pid: self.children[name].spec.role for name, process in self._processes().items()}

    def pid(self, name: str) -> int | None:
        """Process id; None while the process is down."""
        process = self.children[name].process
        return None if process is None else process.pid

    def land(self) -> None:
        """End the transmitter gateways, which land their vehicles; for threads beside a loop that hangs."""
        for child in self.children.values():
            process = child.process
            if child.spec.role == TRANSMITTERS and process is not None:
                process.terminate()

    def stop_all(self) -> None:
        """Send SIGTERM to every process, in stopping order, and kill those that do not end in time."""
        self.spares.close()
        for child in self.children.values():
            child.wanted = False
        while self.running():
            self.watch(STOP_TURN_S)
        self._forks.close()
