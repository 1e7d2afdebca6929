"""The loops of a launcher, supervision and watchdog, keep nothing, whatever happens for a long time."""

from support.garbage import assert_flat
from support.supervised import LIMITS, Supervise, beating, fake, kill, watch_until
from support.waiting import FakeClock, wait_for
from support.watched import DEAF, OTHER, THIRD, Host

from rcopterx.bus.heartbeat import LoopPhase
from rcopterx.deploy.watchdog.watchdog import Duty


def test_a_watchdog_keeps_nothing_of_processes_that_beat_are_silent_or_are_replaced() -> None:
    host = Host(LoopPhase.FLYING, LoopPhase.FLYING, LoopPhase.WORKING, others=Duty.FLIGHT)

    def check(number: int) -> None:
        silent = (DEAF,) if number % 50 < 20 else (OTHER, THIRD) if number % 70 < 30 else ()
        host.look(*silent)

    assert_flat(check, 2000)


def test_a_supervisor_keeps_nothing_of_processes_that_live(supervise: Supervise) -> None:
    supervisor = supervise(beating("tracker"), beating("radio", "works"), fake("other"), watchdog=LIMITS)
    supervisor.start_all()
    watch_until(supervisor, lambda: supervisor.running(), "does not start")
    assert_flat(lambda _: supervisor.watch(0.0005), 2000)


def test_a_supervisor_keeps_nothing_of_processes_that_die(supervise: Supervise) -> None:
    clock = FakeClock()
    supervisor = supervise(fake("mortal"), clock=clock)
    supervisor.start_all()

    def replaced(_: int) -> None:
        before = kill(supervisor, "mortal")
        clock.advance(1000.0)
        wait_for(lambda: supervisor.watch(0.001) and supervisor.pid("mortal") not in (None, before), "dead")

    assert_flat(replaced, 80)
