"""Keeps the processes of a host running: starts them in order, restarts what dies, stops them in order."""

import math
import os
import selectors
import subprocess
import time
from collections.abc import Callable, Collection
from pathlib import Path

from rcopterx.bus.heartbeat import Phase
from rcopterx.deploy.processes.child import Child, restart_pause_s, signal_name
from rcopterx.deploy.processes.forking import ForkServer, Started
from rcopterx.deploy.processes.process_log import rotate
from rcopterx.deploy.processes.table import EXIT_ELSEWHERE, ProcessSpec
from rcopterx.deploy.spares.spare_process import SPARES, SpareProcess, SpareProcesses
from rcopterx.deploy.watchdog.liveness import Liveness
from rcopterx.deploy.watchdog.watchdog import Duty, Watchdog, WatchdogLimits

STABLE_AFTER_S = 2.0
PREPARE_S = 0.1
"""Between two looks whether fork server and spare processes, which were all there, still are: the kernel is
asked for each. Where one is missing, or was taken, every look is such a look."""
SETTLED_S = 0.2
"""After the last start of a process; what starts in flight comes first."""
SPARE_ROLES = ("agent", "router", "tracker", "transmitters")
"""What vehicles in the air cannot do without, and a spare process can take over."""
START_RETRY_S = 0.2
SPARE_RETRY_S = 1.0
SPARE_SILENCE_S = 0.15
"""A spare process that has shown no progress for so long is not relied on."""
BACKGROUND_ROLES = ("simulator", "recorder")
"""Not replaced at once when they make no progress."""
KNOWING_ROLES = ("agent", "transmitters")
"""Processes of these roles tell whether vehicles fly."""
STOP_LIMIT_S = 12.0
"""Transmitter gateways land their vehicles meanwhile."""


class Supervisor:
    """Runs the processes of one host.

    Parameters
    ----------
    specs
        Processes in starting order.
    snapshot
        Snapshot of the fleet file handed to each.
    log_directory
        One log file per process goes here.
    forks
        Starts them; ended with them.
    clock
        Monotonic clock [s].
    without
        Names of processes that are not wanted at first.
    watchdog
        For how long processes may make no progress; None for as long as they like.
    priority
        Real-time priority at which spare processes begin to take over; 0 for none.
    host
        This host; empty for where the fleet file has its agents.
    guarded
        How many agents of another host may have to be started at once.
    """

    def __init__(
        self,
        specs: list[ProcessSpec],
        snapshot: Path,
        log_directory: Path,
        forks: ForkServer,
        clock: Callable[[], float] = time.monotonic,
        without: Collection[str] = (),
        watchdog: WatchdogLimits | None = None,
        priority: int = 0,
        host: str = "",
        guarded: int = 0,
    ) -> None:
        self.children = {spec.name: Child(spec, wanted=spec.name not in without) for spec in specs}
        self._snapshot, self._host = snapshot.resolve(), host
        self._logs = log_directory
        self._forks = forks
        self._clock = clock
        self._selector = selectors.DefaultSelector()
        self._prepare_at_s = self._spare_at_s = 0.0
        self.spare_failures = 0
        jobs = [(spec.role, spec.unit) for spec in specs if spec.role in SPARE_ROLES]
        spare_log = log_directory / "spare.log"
        self._spares = SpareProcesses(
            SpareProcess(self._snapshot, jobs, spare_log, forks, priority, host)
            for _ in range(SPARES + guarded)
        )
        self.spares_hung = 0
        blind = not any(spec.role in KNOWING_ROLES for spec in specs)
        self.liveness: Liveness | None = None if watchdog is None else Liveness(Watchdog(watchdog, blind))

    def start(self, name: str) -> list[str]:
        """Start one process; the spare process takes its place if it can and is ready.

        Returns
        -------
        list of str
            What is wrong, if anything: without a log it runs all the same; what cannot be started now, for
            instance for want of descriptors, is tried again a moment later.
        """
        child = self.children[name]
        child.restart_at_s = 0.0
        log_path = self._logs / f"{name}.log"
        lines = []
        try:
            self._logs.mkdir(parents=True, exist_ok=True)
            rotate(log_path)
            log_path.open("ab").close()
        except OSError as error:
            child.events["without_log"] += 1
            lines.append(f"{name}: writes no log: {error}")
            log_path = Path(os.devnull)
        try:
            self._launch(child, log_path)
        except OSError as error:
            child.events["start_failed"] += 1
            child.restart_at_s = self._clock() + START_RETRY_S
            lines.append(f"{name}: cannot be started: {error}; trying again")
        return lines

    def _launch(self, child: Child, log_path: Path) -> None:
        self._prepare_at_s = 0.0
        started = self._successor(child, log_path)
        if started is None:
            command = child.spec.command(self._snapshot, take_over=child.take_over)
            started = self._forks.start(command, log_path)
        child.take_over = False
        child.process, child.page = started
        child.started_s = self._clock()
        self._selector.register(child.process.descriptor, selectors.EVENT_READ, child.spec.name)

    def _successor(self, child: Child, log_path: Path) -> Started | None:
        """A spare process, if one is there, makes progress, and can do what this one did."""

        def usable(pid: int) -> bool:
            return self._silent_s(pid) <= SPARE_SILENCE_S

        spec = child.spec
        return self._spares.take(spec.role, spec.unit, log_path, usable, take_over=child.take_over)

    def start_all(self) -> list[str]:
        """Start every wanted process in order; returns what is wrong, as `start`."""
        lines = self._prepare_pilots()
        return lines + [
            line for name, child in self.children.items() if child.wanted for line in self.start(name)
        ]

    def _prepare_pilots(self) -> list[str]:
        """Have the fork server build what agents and spare processes fly with."""
        vehicles = [child.spec.unit for child in self.children.values() if child.spec.role == "agent"]
        if not vehicles:
            return []
        try:
            self._forks.prepare_fleet(self._snapshot, self._host, vehicles)
        except OSError as error:
            return [f"fork server: prepares no pilots: {error}"]
        return []

    def watch(self, timeout_s: float) -> list[str]:
        """Wait for deaths, restart what died, and end what hangs.

        Parameters
        ----------
        timeout_s
            How long to wait at most; a death ends the wait at once.

        Returns
        -------
        list of str
            A line per event, for the user.
        """
        now = self._clock()
        lines = []
        if now >= self._prepare_at_s:
            lines += self._prepare(now)
            self._prepare_at_s = now + PREPARE_S if self._spares.complete else now
        lines += self._start_and_stop() + self._end_hung(now)
        due = [child.restart_at_s - now for child in self.children.values() if child.restart_at_s > 0]
        wait_s = max(0.0, min([timeout_s, *due]))
        if self._selector.get_map():
            lines += [self._on_death(str(key.data)) for key, _ in self._selector.select(wait_s)]
        else:
            time.sleep(wait_s)
        for name, child in self.children.items():
            if child.restart_at_s > 0 and self._clock() >= child.restart_at_s:
                lines += self.start(name)
                if child.process is not None:
                    child.restarts += 1
                    lines.append(f"{name}: started again (restart {child.restarts})")
        return lines

    def _prepare(self, now_s: float) -> list[str]:
        """Have what the next start of a process needs, as long as one is wanted."""
        if not any(child.wanted for child in self.children.values()):
            return []
        lines = self._prepare_forks()
        if all(now_s - child.started_s > SETTLED_S for child in self.children.values()):
            self._prepare_spares(now_s)
        return lines

    def _prepare_forks(self) -> list[str]:
        """Have a fork server again, before it is needed."""
        try:
            again = self._forks.prepare()
        except OSError as error:
            return [f"fork server: cannot be started: {error}; trying again"]
        return ["fork server: had ended, started again"] if again else []

    def _prepare_spares(self, now_s: float) -> None:
        """Have spare processes; where that is not possible, vehicles fly without them until it is."""
        if now_s < self._spare_at_s:
            return
        try:
            self._spares.prepare()
        except OSError:
            self.spare_failures += 1
            self._spare_at_s = now_s + SPARE_RETRY_S

    def _end_hung(self, now_s: float) -> list[str]:
        """End what makes no progress; its death is then noticed as any other one."""
        if self.liveness is None:
            return []
        children = {
            child.process.pid: child
            for child in self.children.values()
            if child.process is not None and child.wanted
        }
        pages = {
            process: (child.page, Duty.BACKGROUND if child.spec.role in BACKGROUND_ROLES else Duty.FLIGHT)
            for process, child in children.items()
            if child.page is not None
        }
        pages |= {pid: (page, Duty.STANDBY) for pid, page in self._spares.pages.items()}
        lines = []
        for hung in self.liveness.check(now_s, pages):
            child = children.get(hung.process)
            if child is not None:
                child.hung += 1
                child.verdict = hung
            else:
                self.spares_hung += 1
                lines.append(f"spare: no progress for {hung.silent_s:.2f} s, replaced")
        return lines

    def _start_and_stop(self) -> list[str]:
        """Start what is wanted and was not, end what is not wanted any more, in stopping order."""
        lines = []
        leaving = [
            child.spec.stop_order
            for child in self.children.values()
            if not child.wanted and child.process is not None
        ]
        first = min(leaving, default=0)
        for name, child in self.children.items():
            if child.wanted and child.process is None and not child.restart_at_s:
                child.quick_deaths = 0
                lines += self.start(name)
                if child.process is not None:
                    lines.append(f"{name}: started")
            elif not child.wanted:
                child.restart_at_s = 0.0
                if child.spec.stop_order == first:
                    self._end_gently(child)
        return lines

    def _end_gently(self, child: Child) -> None:
        """Ask a process to end, and end it if it does not."""
        if child.process is None:
            return
        if child.leaving_since_s is None:
            child.leaving_since_s = self._clock()
            child.process.terminate()
        elif self._clock() - child.leaving_since_s > STOP_LIMIT_S:
            child.events["killed_at_stop"] += 1
            child.process.kill()
            # Once is enough, however many looks it takes until its death is seen.
            child.leaving_since_s = math.inf

    def _on_death(self, name: str) -> str:
        child = self.children[name]
        assert child.process is not None
        self._selector.unregister(child.process.descriptor)
        code = self._reap(child)
        child.leaving_since_s = None
        verdict, child.verdict = child.verdict, None
        if not child.wanted:
            return f"{name}: ended"
        if code == EXIT_ELSEWHERE:
            child.wanted = False
            return f"{name}: ended, because another agent flies {child.spec.unit}"
        now = self._clock()
        quick = now - child.started_s < STABLE_AFTER_S
        child.quick_deaths = child.quick_deaths + 1 if quick else 0
        child.restart_at_s = now + restart_pause_s(child.quick_deaths)
        cause = f"killed by {signal_name(-code)}" if code < 0 else f"ended with exit code {code}"
        if verdict is not None:
            cause = (
                f"hung: no progress for {verdict.silent_s:.2f} s, {verdict.limit_s:g} s are allowed; {cause}"
            )
        return f"{name}: {cause}; log: {self._logs / (name + '.log')}"

    def _reap(self, child: Child) -> int:
        assert child.process is not None
        code = child.process.wait()
        child.last_exit = code
        child.process = child.page = None
        return code

    def quick_deaths(self, name: str) -> int:
        """How often in a row a process has died shortly after its start."""
        return self.children[name].quick_deaths

    @property
    def flying(self) -> bool:
        """Whether a vehicle is in the air, as far as a process of this host knows."""
        pages = (child.page for child in self.children.values())
        return any(page is not None and page.phase is Phase.FLYING for page in pages)

    @property
    def spare_ready(self) -> bool:
        """Whether a warm process waits to replace another one."""
        return self._spares.ready() > 0

    @property
    def spares_complete(self) -> bool:
        """Whether as many of them wait as there shall be."""
        return self._spares.complete

    @property
    def spare_pids(self) -> tuple[int, ...]:
        """Process ids of the spare processes, the one that is taken first at the beginning."""
        return tuple(self._spares.pages)

    @property
    def watchdog_on(self) -> bool:
        """Whether processes that make no progress are ended."""
        return self.liveness is not None

    @property
    def forgiven(self) -> dict[str, int]:
        """How often processes were silent for longer than their limit without hanging, by reason."""
        return {} if self.liveness is None else self.liveness.forgiven

    def longest_silence_s(self, name: str) -> float:
        """Longest time without progress of a process that runs, since it works."""
        pid = self.pid(name)
        return 0.0 if self.liveness is None or pid is None else self.liveness.longest_s(pid)

    def _silent_s(self, process: int) -> float:
        return 0.0 if self.liveness is None else self.liveness.silent_s(process)

    def running(self) -> list[str]:
        """Names of the processes that run now."""
        return [name for name, child in self.children.items() if child.process is not None]

    def pid(self, name: str) -> int | None:
        """Process id, None while the process is down."""
        process = self.children[name].process
        return None if process is None else process.pid

    def stop_all(self) -> None:
        """Ask every process to end, in stopping order, and end those that do not."""
        self._spares.close()
        for child in self.children.values():
            child.wanted = False
        for order in sorted({child.spec.stop_order for child in self.children.values()}):
            group = [child for child in self.children.values() if child.spec.stop_order == order]
            self._stop_group([child for child in group if child.process is not None])
        self._forks.close()

    def _stop_group(self, group: list[Child]) -> None:
        for child in group:
            if child.process is not None:
                self._selector.unregister(child.process.descriptor)
                child.process.terminate()
        deadline_s = self._clock() + STOP_LIMIT_S
        for child in group:
            if child.process is None:
                continue
            try:
                child.process.wait(max(0.01, deadline_s - self._clock()))
            except subprocess.TimeoutExpired:
                child.events["killed_at_stop"] += 1
                child.process.kill()
            self._reap(child)
