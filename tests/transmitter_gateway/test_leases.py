"""Whatever agents ask for and whenever they command: at most one of them counts, and the newest one."""

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from rcopterx.transmitter_gateway.command_validator import MOST_AGENTS, RESERVED_S, Leases


def test_the_first_agent_that_asks_gets_a_lease_and_keeps_it() -> None:
    leases = Leases()
    assert leases.bid(7, 0.0, fresh=False, take_over=False) == 1
    assert leases.bid(7, 0.01, fresh=False, take_over=False) == 1
    assert leases.commanding == 0
    assert not leases.command(1)
    assert leases.commanding == 1
    assert leases.bid(7, 5.0, fresh=True, take_over=False) == 1


def test_an_agent_gets_no_lease_while_another_one_commands_unless_it_is_to_take_over() -> None:
    leases = Leases()
    leases.command(leases.bid(7, 0.0, fresh=False, take_over=False))
    assert leases.bid(8, 1.0, fresh=True, take_over=False) == 0
    assert leases.bid(8, 1.0, fresh=True, take_over=True) == 2
    assert leases.commanding == 1
    assert not leases.lost(1)
    assert leases.command(2)
    assert leases.lost(1)


def test_of_two_agents_that_start_at_once_the_first_one_has_time_to_command() -> None:
    leases = Leases()
    assert leases.bid(7, 0.0, fresh=False, take_over=False) == 1
    assert leases.bid(8, RESERVED_S / 2, fresh=False, take_over=False) == 0
    assert leases.bid(8, RESERVED_S, fresh=False, take_over=False) == 2


def test_an_agent_that_lost_gets_a_later_lease_once_nobody_commands() -> None:
    leases = Leases()
    leases.command(leases.bid(7, 0.0, fresh=False, take_over=False))
    leases.command(leases.bid(8, 1.0, fresh=True, take_over=True))
    assert leases.bid(7, 2.0, fresh=True, take_over=False) == 0
    assert leases.bid(7, 3.0, fresh=False, take_over=False) == 3


def test_a_restarted_gateway_continues_after_the_last_lease_and_lets_its_agent_command_first() -> None:
    leases = Leases()
    leases.resume(4, 5, 0.0)
    assert not leases.lost(4)
    assert leases.was_issued(5)
    assert not leases.was_issued(6)
    assert leases.bid(7, 0.0, fresh=False, take_over=False) == 0
    assert leases.bid(7, RESERVED_S, fresh=False, take_over=False) == 6


def test_a_gateway_without_predecessor_issues_a_lease_at_once() -> None:
    leases = Leases()
    leases.resume(0, 0, 0.0)
    assert leases.bid(7, 0.0, fresh=False, take_over=False) == 1


def test_only_the_agents_that_bid_last_are_remembered() -> None:
    leases = Leases()
    numbers = [leases.bid(agent, 0.0, fresh=False, take_over=True) for agent in range(MOST_AGENTS + 1)]
    assert leases.bid(MOST_AGENTS, 0.0, fresh=False, take_over=True) == numbers[MOST_AGENTS]
    assert leases.bid(0, 0.0, fresh=False, take_over=True) != numbers[0]


AGENTS = st.integers(0, 4)


class LeaseMachine(RuleBasedStateMachine):
    """Agents that use the leases they got, and a gateway that is restarted."""

    def __init__(self) -> None:
        super().__init__()
        self.leases = Leases()
        self.now_s = 0.0
        self.numbers: dict[int, int] = {}
        self.commanded: list[int] = []

    @rule(seconds=st.floats(0, 0.3))
    def let_time_pass(self, seconds: float) -> None:
        self.now_s += seconds

    @rule(agent=AGENTS, fresh=st.booleans(), take_over=st.booleans())
    def bid(self, agent: int, fresh: bool, take_over: bool) -> None:
        number = self.leases.bid(agent, self.now_s, fresh=fresh, take_over=take_over)
        if number:
            assert not self.leases.lost(number)
            self.numbers[agent] = number

    @rule(agent=AGENTS)
    def command(self, agent: int) -> None:
        lease = self.numbers.get(agent, 0)
        if self.leases.was_issued(lease) and not self.leases.lost(lease):
            self.leases.command(lease)
            self.commanded.append(lease)

    @rule()
    def gateway_restarts(self) -> None:
        restarted = Leases()
        restarted.resume(self.leases.commanding, self.leases.issued, self.now_s)
        self.leases = restarted

    @invariant()
    def no_lease_has_two_agents(self) -> None:
        assert len(set(self.numbers.values())) == len(self.numbers)

    @invariant()
    def leases_that_command_only_grow(self) -> None:
        assert self.commanded == sorted(self.commanded)


LeaseMachine.TestCase.settings = settings(max_examples=60, stateful_step_count=30, deadline=None)
TestLeasesAreUnambiguous = LeaseMachine.TestCase
