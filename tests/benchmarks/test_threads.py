"""What threads of a fleet need is read from the kernel."""

import os
import threading

from rcopterx.benchmarks.threads import Usage, rates, table, threads_of


def test_the_threads_of_a_process_are_found_with_their_names_and_times() -> None:
    found = threads_of(os.getpid())
    own = found[threading.get_native_id()]
    assert set(found) >= {thread.native_id for thread in threading.enumerate()}
    assert own.run_s > 0.0
    assert own.faults > 0


def test_rates_are_those_of_threads_that_were_there_all_the_time() -> None:
    before = {1: Usage("main", 1.0, 100, 0, 10), 2: Usage("ended", 1.0, 0, 0, 0)}
    after = {1: Usage("main", 2.0, 300, 4, 10), 3: Usage("new", 9.0, 9, 9, 9)}
    assert rates(before, after, 2.0) == [Usage("main", 0.5, 100.0, 2.0, 0.0)]


def test_the_busiest_thread_comes_first_and_sleeping_ones_are_not_told() -> None:
    before = {thread: Usage(f"t{thread}", 0.0, 0, 0, 0) for thread in range(3)}
    after = {
        0: Usage("little", 0.1, 50, 0, 0),
        1: Usage("much", 0.3, 50, 0, 0),
        2: Usage("asleep", 0.0, 0, 0, 0),
    }
    text = table({"agent-h1": rates(before, after, 1.0)})
    assert "40.0%" in text[1]
    assert [line.split()[0] for line in text[2:]] == ["much", "little"]
