"""Properties of the schemes on which their papers stand."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.records import replace
from support.vehicle_types import COAXIAL_LAG

from rcopterx.control.interfaces import Estimate
from rcopterx.control.plugins import SCHEMES
from rcopterx.control.references.trajectory import hold
from rcopterx.control.scheme import Neighbour, Scheme, Situation
from rcopterx.vehicles.state import Array
from rcopterx_studies.schemes.admm import Iterate
from rcopterx_studies.schemes.distributed_lqr import distributed_gains
from rcopterx_studies.schemes.messages import Samples
from rcopterx_studies.schemes.planner import Plane, WayPlanner
from rcopterx_studies.schemes.replanning import Announced
from rcopterx_studies.schemes.tracked import SchemePath

PERIOD_S = 0.02
STAGES = 8
Graph = Mapping[str, Sequence[str]]
"""Leaders of each vehicle."""


def at_rest(position_m: Array) -> Estimate:
    return Estimate(np.array([*position_m, 0.0, 0.0, 0.0, 0.0, 0.0]), COAXIAL_LAG.hover_input, np.zeros(4))


class Swarm:
    """Schemes that exchange messages over perfect links, at vehicles that stay where they are."""

    def __init__(self, name: str, places_m: Mapping[str, Array], leaders: Graph, **settings: object) -> None:
        self.schemes: dict[str, Any] = {}
        self.places_m, self.leaders = places_m, leaders
        self.goals_m = dict(places_m)
        self.messages: dict[str, Any] = {}
        self.age_s = 0.0
        for vehicle, place in places_m.items():
            self.schemes[vehicle] = SCHEMES.build(name, COAXIAL_LAG, PERIOD_S, settings)
            self.schemes[vehicle].reset(at_rest(place), COAXIAL_LAG.hover_input)

    def situation(self, vehicle: str, time_s: float) -> Situation:
        neighbours = {}
        for other, message in self.messages.items():
            followed, follows = other in self.leaders[vehicle], vehicle in self.leaders[other]
            if other != vehicle:
                offset = self.goals_m[vehicle] - self.goals_m[other] if followed or follows else None
                neighbours[other] = Neighbour(message, self.age_s, offset, followed)
        reference = hold(self.goals_m[vehicle], 0.0, PERIOD_S, 50)
        return Situation(vehicle, time_s, at_rest(self.places_m[vehicle]), reference, neighbours)

    def exchange(self, time_s: float) -> None:
        sent = {
            vehicle: scheme.exchange(self.situation(vehicle, time_s))
            for vehicle, scheme in self.schemes.items()
        }
        self.messages |= {vehicle: message for vehicle, message in sent.items() if message is not None}


def chain(*places_m: tuple[float, float, float]) -> tuple[dict[str, Array], Graph]:
    names = [f"h{number}" for number in range(1, len(places_m) + 1)]
    leaders = {name: names[max(number - 1, 0) : number] for number, name in enumerate(names)}
    return dict(zip(names, map(np.array, places_m), strict=True)), leaders


@pytest.mark.parametrize("name", SCHEMES.available())
def test_scheme_is_a_controller_with_messages(name: str) -> None:
    scheme = SCHEMES.build(name, COAXIAL_LAG, PERIOD_S, {})
    assert isinstance(scheme, Scheme)
    assert scheme.exchanges >= 1


@pytest.mark.parametrize("name", SCHEMES.available())
def test_vehicle_without_neighbours_goes_to_its_reference(name: str) -> None:
    start, goal = np.array([0.0, 0.0, 1.0]), np.array([0.3, 0.0, 1.0])
    swarm = Swarm(name, {"h1": start}, {"h1": ()})
    swarm.goals_m["h1"] = goal
    for frame in range(40):
        swarm.exchange(frame * PERIOD_S)
    step = swarm.schemes["h1"].step(at_rest(start), hold(goal, 0.0, PERIOD_S, 50), COAXIAL_LAG.hover_input)
    assert step.inputs[:10, 0].max() > 0.01
    assert step.plan.position_m[-1, 0] > 0.01


@pytest.mark.parametrize("edges", [(("h1", "h2"), ("h2", "h3")), (("h1", "h2"), ("h2", "h3"), ("h3", "h1"))])
def test_consensus_converges_with_the_eigenvalues_of_the_laplacian(edges: Sequence[tuple[str, str]]) -> None:
    """Also on a cycle of leaders; the mode of an eigenvalue decays with s^2 + lambda d s + lambda k = 0."""
    places, _ = chain((0.0, 0.0, 1.0), (0.003, 0.0, 1.0), (-0.004, 0.0, 1.0))
    leaders = {name: [leader for leader, follower in edges if follower == name] for name in places}
    # No vehicle has a task: each follows another one.
    leaders["h1"] = leaders["h1"] or ["h2"]
    k, d = 2.0, 3.0
    swarm = Swarm("consensus", places, leaders, stiffness_per_s2=k, damping_per_s=d)
    swarm.goals_m = dict.fromkeys(places, np.zeros(3))
    swarm.age_s = PERIOD_S
    adjacency = np.zeros((3, 3))
    for one, other in edges:
        i, j = int(one[1]) - 1, int(other[1]) - 1
        adjacency[i, j] = adjacency[j, i] = 1.0
    values, modes = np.linalg.eigh(np.diag(adjacency.sum(axis=0)) - adjacency)
    decay = min(-max(np.roots([1.0, d * value, k * value]).real) for value in values[1:])
    spreads = []
    for frame in range(round(4.0 / PERIOD_S)):
        swarm.exchange(frame * PERIOD_S)
        x = np.array([swarm.messages[name].position_m[0] for name in places])
        spreads.append(float(np.linalg.norm(modes[:, 1:].T @ x)))
    seconds = 2.0
    rate = np.log(spreads[-1 - round(seconds / PERIOD_S)] / spreads[-1]) / seconds
    assert rate == pytest.approx(decay, rel=0.1)
    assert -0.004 < x.mean() < 0.003


def central_plan(places_m: Sequence[Array], edges: Sequence[tuple[int, int]], goal_m: Array, K: int) -> Array:
    """Positions of the coupled problem of `rcopterx_studies.schemes.admm`, solved at once."""
    h, task, coupling, effort, count = 0.1, 10.0, 10.0, 0.1, len(places_m)
    steps = np.arange(K)
    response = np.where(steps[:, None] >= steps, h**2 * (steps[:, None] - steps + 0.5), 0.0)
    G = np.kron(np.eye(count), response)
    start = np.repeat(np.array(places_m), K, axis=0)
    W, target = np.zeros((count * K, count * K)), np.zeros((count * K, 3))
    W[:K, :K] += task * np.eye(K)
    target[:K] = task * goal_m
    for i, j in edges:
        pair = np.zeros((K, count * K))
        pair[:, i * K : (i + 1) * K], pair[:, j * K : (j + 1) * K] = np.eye(K), -np.eye(K)
        # Either vehicle has the coupling among its own terms.
        W += 2 * coupling * pair.T @ pair
    accelerations = np.linalg.solve(G.T @ W @ G + effort * np.eye(count * K), G.T @ (target - W @ start))
    return (start + G @ accelerations).reshape(count, K, 3)


def test_admm_converges_to_the_solution_of_the_coupled_problem() -> None:
    places, leaders = chain((0.0, 0.0, 1.0), (0.02, 0.0, 1.0), (-0.01, 0.03, 1.0))
    swarm = Swarm("admm", places, leaders, stages=STAGES)
    swarm.goals_m = dict.fromkeys(places, np.array([0.05, 0.0, 1.02]))
    for _ in range(600):
        swarm.exchange(0.01)
    wanted = central_plan(list(places.values()), [(0, 1), (1, 2)], swarm.goals_m["h1"], STAGES)
    for name, plan in zip(places, wanted, strict=True):
        message: Iterate = swarm.messages[name]
        assert np.abs(message.average.to_numpy() - plan).max() < 2e-4


@pytest.mark.parametrize("stages", [2, STAGES + 4])
def test_admm_ignores_a_leader_with_another_number_of_stages(stages: int) -> None:
    places, leaders = chain((0.0, 0.0, 1.0), (0.5, 0.0, 1.0))
    swarm = Swarm("admm", places, leaders, stages=STAGES)
    swarm.schemes["h1"] = SCHEMES.build("admm", COAXIAL_LAG, PERIOD_S, {"stages": stages})
    swarm.schemes["h1"].reset(at_rest(places["h1"]), COAXIAL_LAG.hover_input)
    swarm.goals_m["h1"] = places["h1"] + [0.3, 0.0, 0.0]
    for frame in range(20):
        swarm.exchange(frame * PERIOD_S)
    assert np.abs(swarm.messages["h1"].average.to_numpy() - places["h1"]).max() > 0.01, "flies its task"
    assert np.abs(swarm.messages["h2"].average.to_numpy() - places["h2"]).max() < 1e-6, "stays"


@pytest.mark.parametrize("stage", [-(10**12), -STAGES, 1 + STAGES, 10**12])
def test_admm_ignores_plans_without_a_common_stage(stage: int) -> None:
    places, leaders = chain((0.0, 0.0, 1.0), (0.5, 0.0, 1.0))
    swarm = Swarm("admm", places, leaders, stages=STAGES)
    far = Samples.of(np.linspace(0.0, 1.0, STAGES)[:, None] + places["h1"])
    swarm.messages = {"h1": Iterate(stage, far, {"h2": far}), "h2": None}
    for _ in range(4):
        message = swarm.schemes["h2"].exchange(swarm.situation("h2", 0.01))
        assert np.abs(message.average.to_numpy() - places["h2"]).max() < 1e-6


def test_distributed_lqr_is_the_central_one_where_all_vehicles_know_each_other() -> None:
    A, B = np.array([[1.0, 0.02], [0.0, 1.0]]), np.array([[0.0002], [0.02]])
    Q, Q_relative, R, n = np.diag([4.0, 1.0]), np.diag([9.0, 2.0]), np.eye(1), 3
    own, relative = distributed_gains(A, B, Q, Q_relative, R, n)
    laplacian = n * np.eye(n) - np.ones((n, n))
    cost = np.kron(np.eye(n), Q) + np.kron(laplacian, Q_relative)
    everything = np.kron(np.eye(n), A), np.kron(np.eye(n), B)
    central, _ = distributed_gains(*everything, cost, 0 * cost, np.eye(n), 1)
    distributed = np.kron(np.eye(n), own) + np.kron(laplacian, relative)
    assert np.allclose(central, distributed, atol=1e-6)


def head_on() -> Swarm:
    places = {"h1": np.array([-0.8, 0.0, 1.0]), "h2": np.array([0.8, 0.0, 1.0])}
    swarm = Swarm("on_demand", places, {"h1": (), "h2": ()})
    swarm.goals_m = {"h1": places["h2"], "h2": places["h1"]}
    return swarm


def closest_m(swarm: Swarm, times_s: Array) -> float:
    ways = [swarm.messages[name].at(times_s) for name in ("h1", "h2")]
    return float(np.linalg.norm(ways[0] - ways[1], axis=1).min())


def test_on_demand_plans_straight_until_a_collision_is_predicted() -> None:
    swarm = head_on()
    times_s = np.linspace(0.0, 2.0, 41)
    swarm.exchange(0.0)
    straight = swarm.messages["h1"].at(times_s)
    assert np.abs(straight[:, 1]).max() < 1e-6
    assert closest_m(swarm, times_s) < 0.1
    for number in range(1, 4):
        swarm.exchange(0.2 * number)
    bent = swarm.messages["h1"].at(times_s + 0.6)
    assert np.abs(bent[:, 1]).max() > 0.05


def test_event_triggered_vehicle_that_hears_nothing_of_one_nearby_keeps_its_way() -> None:
    places, leaders = chain((0.0, 0.0, 1.0), (-0.6, 0.0, 1.0))
    swarm = Swarm("event_triggered", places, leaders)
    swarm.goals_m["h1"] = np.array([0.5, 0.0, 1.0])
    swarm.exchange(0.0)
    swarm.age_s = 0.5
    before: Announced = swarm.messages["h1"]
    swarm.exchange(0.2)
    swarm.exchange(0.4)
    deaf: Announced = swarm.messages["h1"]
    swarm.age_s = 0.0
    swarm.exchange(0.6)
    hearing: Announced = swarm.messages["h1"]
    later = np.array([3.0])
    assert np.allclose(deaf.at(later), before.at(later), atol=0.3)
    assert np.linalg.norm(hearing.at(later) - [0.5, 0.0, 1.0]) < np.linalg.norm(deaf.at(later) - [0.5, 0, 1])


def test_only_the_most_urgent_vehicles_plan_in_a_round() -> None:
    places, leaders = chain(*[(3.0 * number, 0.0, 1.0) for number in range(4)])
    swarm = Swarm("event_triggered", places, dict.fromkeys(leaders, ()), planning=1)
    swarm.goals_m = {
        name: place + np.array([0.1 + 0.1 * number, 0.0, 0.0])
        for number, (name, place) in enumerate(places.items())
    }
    for number in range(3):
        swarm.exchange(0.2 * number)
    planned = [name for name, message in swarm.messages.items() if message.begins_s > 0.5]
    assert planned == ["h4"]


class LossySwarm(Swarm):
    """Receivers miss messages, each by itself; vehicles are where their ways are."""

    def __init__(self, name: str, places_m: Mapping[str, Array], loss: float, seed: int) -> None:
        super().__init__(name, places_m, dict.fromkeys(places_m, ()))
        self.loss, self.random = loss, np.random.default_rng(seed)
        self.announced: dict[str, list[Announced]] = {vehicle: [] for vehicle in places_m}
        self.inboxes: dict[str, dict[str, tuple[Any, float]]] = {vehicle: {} for vehicle in places_m}

    def situation(self, vehicle: str, time_s: float) -> Situation:
        received = self.inboxes[vehicle].items()
        neighbours = {
            other: Neighbour(message if time_s - at_s < 1.0 else None, time_s - at_s, None, False)
            for other, (message, at_s) in received
        }
        return replace(super().situation(vehicle, time_s), neighbours=neighbours)

    def flown(self, vehicle: str, times_s: Array) -> Array:
        """Positions on the way that is flown; one that begins later is not yet."""
        begun = [each for each in self.announced[vehicle] if each.begins_s <= times_s[0] + 1e-6]
        return begun[-1].at(times_s)

    def exchange(self, time_s: float) -> None:
        self.messages.clear()
        super().exchange(time_s)
        for sender, message in self.messages.items():
            self.announced[sender].append(message)
            for receiver in self.inboxes:
                if receiver != sender and self.random.random() >= self.loss:
                    self.inboxes[receiver][sender] = message, time_s


@pytest.mark.parametrize(
    ("name", "loss"), [("on_demand", 0.0), ("event_triggered", 0.0), ("event_triggered", 0.3)]
)
def test_opposite_vehicles_change_places_without_coming_close(name: str, loss: float) -> None:
    """Event-triggered vehicles stay apart also where many messages are lost."""
    turns = np.arange(4) * np.pi / 2
    places = {f"h{k}": np.array([1.2 * np.cos(a), 1.2 * np.sin(a), 1.0]) for k, a in enumerate(turns)}
    swarm = LossySwarm(name, places, loss, seed=3)
    swarm.goals_m = {vehicle: place * [-1.0, -1.0, 1.0] for vehicle, place in places.items()}
    closest_m = np.inf
    for number in range(60):
        swarm.exchange(0.2 * number)
        times_s = 0.2 * number + np.linspace(0.0, 0.18, 4)
        for vehicle in places:
            swarm.places_m[vehicle] = swarm.flown(vehicle, times_s[:1])[0]
        at = np.array([swarm.flown(vehicle, times_s) for vehicle in places])
        gaps = np.linalg.norm(at[:, None] - at[None], axis=-1) + 9.0 * np.eye(4)[..., None]
        closest_m = min(closest_m, float(gaps.min()))
    assert closest_m > 0.3
    ends = {vehicle: swarm.flown(vehicle, times_s[-1:])[0] for vehicle in places}
    if not loss:
        assert max(float(np.linalg.norm(ends[each] - swarm.goals_m[each])) for each in places) < 0.1


@given(st.lists(st.tuples(*3 * [st.floats(-1.0, 1.0)]), min_size=2, max_size=6))
def test_way_in_a_message_is_the_way_that_was_packed(rows: list[tuple[float, float, float]]) -> None:
    way = SchemePath(np.zeros(3), np.ones(3), np.array(rows), 0.1)
    times_s = np.linspace(0.0, 1.0, 11)
    again = SchemePath.unpacked(way.packed(), 0.1)
    for one, other in zip(way.at(times_s), again.at(times_s), strict=True):
        assert np.allclose(one, other, atol=1e-5)


def test_way_ends_at_rest_after_braking() -> None:
    way = SchemePath(np.zeros(3), np.zeros(3), np.ones((4, 3)), 0.1)
    _, velocity, _ = way.at(np.array([0.4]))
    _, stopped, _ = way.braked(velocity[0]).at(np.array([5.0]))
    assert np.abs(stopped).max() < 1e-9


@pytest.mark.parametrize("data", [b"", b"1234", np.full(3, np.nan, "<f4").tobytes()])
def test_samples_that_are_no_rows_of_finite_numbers_are_refused(data: bytes) -> None:
    with pytest.raises(ValueError, match="rows of three finite"):
        Samples(data)


def test_announced_way_of_one_row_is_refused() -> None:
    with pytest.raises(ValueError, match="a path needs a position and a velocity"):
        Announced(0.0, Samples.of(np.zeros((1, 3))), 0.1)


def test_planner_stays_beyond_a_plane_and_within_its_reach() -> None:
    reach = np.array([0.8, 0.8, 1.0])
    planner = WayPlanner(10, 0.1, reach, np.full(3, 2.0), 1.0, 0.02, planes=2)
    targets = np.zeros((11, 3))
    way = planner.plan(np.array([0.6, 0.0, 0.0]), np.zeros(3), targets)
    aside = planner.plan(
        np.array([0.6, 0.0, 0.0]), np.zeros(3), targets, [Plane(9, np.array([1.0, 0.0, 0.0]), 0.4)]
    )
    at = np.array([0.9])
    assert way.at(at)[0][0, 0] < 0.35
    assert aside.at(at)[0][0, 0] == pytest.approx(0.4, abs=0.01)
    assert (np.abs(way.acceleration_m_s2) <= reach + 1e-4).all()
