"""The table of manoeuvres and their checks: acceptance test, demonstration and `rcopterx fly NAME`."""

import math
from types import MappingProxyType
from typing import Final

from rcopterx.bus.messages import LeaderLink
from rcopterx.control.references.path_shapes import figure_eight
from rcopterx.ground_station.acceptance import steps
from rcopterx.ground_station.acceptance.checks import (
    ALWAYS,
    CONTROLLED,
    IN_THE_AIR,
    agents_started_again,
    avoided,
    controllers_flown,
    distance_kept,
    ends_at,
    followed,
    formation_held,
    heading_ends_at,
    in_time,
    reached_height,
    touched_down_gently,
    transmitters_undisturbed,
)
from rcopterx.ground_station.acceptance.flight import Manoeuvre
from rcopterx.ground_station.acceptance.paper_sequence import (
    PAPER_PERIOD_S,
    PAPER_SET_POINTS,
    Say,
    Wait,
    fly_paper_sequence,
)
from rcopterx.ground_station.acceptance.steps import Step, go_to, in_order, pause
from rcopterx.ground_station.scripting.fleet import Fleet
from rcopterx.vehicles.tuples import Three


def fly_paper_formation(fleet: Fleet, say: Say, wait: Wait) -> None:
    """The experiment of the paper's Fig. 3: set points of the leader, then other distances, then back."""
    fly_paper_sequence(fleet, say, wait)
    followers = {name: vehicle.follow[0] for name, vehicle in fleet.file.vehicles.items() if vehicle.follow}
    for name, link in followers.items():
        x, y, z = link.offset_m
        say(f"{name}: distance to {link.leader} grows by 0.2 m along x")
        fleet[name].follow(link.leader, (x - 0.2, y, z + 0.1))
    wait(PAPER_PERIOD_S)
    for name, link in followers.items():
        say(f"{name}: distance to {link.leader} as before")
        fleet[name].follow(link.leader, link.offset_m)
    wait(PAPER_PERIOD_S)


LEFT: Final = (-0.4, 0.5, 0.0)
RIGHT: Final = (-0.4, -0.5, 0.0)  # places of h2 and h3 in the trio


def _place(second_m: Three, third_m: Three, frame: str = "inertial") -> Step:
    """Move both followers of the trio to new offsets and wait until they are there."""
    return in_order(
        steps.follow("h2", "h1", second_m, frame), steps.follow("h3", "h1", third_m, frame), steps.formed()
    )


RADIUS_M: Final = 0.8
FIVE: Final = ("h1", "h2", "h3", "h4", "h5")


def on_circle(turn_deg: float) -> dict[str, Three]:
    """Places of five vehicles on a circle a metre above the floor, turned by an angle."""
    angles = {name: math.radians(turn_deg + 360.0 * number / len(FIVE)) for number, name in enumerate(FIVE)}
    return {
        name: (round(RADIUS_M * math.cos(angle), 3), round(RADIUS_M * math.sin(angle), 3), 1.0)
        for name, angle in angles.items()
    }


ROWS: Final = (
    Manoeuvre(
        "paper-formation",
        "Set points, a yaw step of 540 degrees and changes of distance, as in the paper's Fig. 3",
        (len(PAPER_SET_POINTS) + 2) * PAPER_PERIOD_S,
        fly_paper_formation,
        (*ALWAYS, in_time),
    ),
    Manoeuvre(
        "hover", "Hover in formation for ten seconds", 10.0,
        pause(10.0),
        (*ALWAYS, in_time),
    ),
    Manoeuvre(
        "take-off-and-land", "From the floor to one metre and back, rotors off", 13.0,
        in_order(steps.take_off(), pause(2.0), steps.land(), pause(0.5)),
        (*CONTROLLED, reached_height(1.0), touched_down_gently, distance_kept),
        from_floor=True,
    ),
    Manoeuvre(
        "position-steps", "Steps of the leader along each axis", 14.0,
        in_order(
            go_to((0.5, 0.0, 1.0)), go_to((0.5, 0.4, 1.0)), go_to((0.5, 0.4, 1.4)),
            go_to((0.0, 0.0, 1.0)), steps.formed(), pause(1.0),
        ),
        (*ALWAYS, formation_held(), ends_at("h1", (0.0, 0.0, 1.0)), transmitters_undisturbed),
    ),
    Manoeuvre(
        "yaw-steps", "Steps of the leader's heading to 90, -90 and 180 degrees", 12.0,
        in_order(
            go_to((0.0, 0.0, 1.0), 90), go_to((0.0, 0.0, 1.0), -90), go_to((0.0, 0.0, 1.0), 180),
            steps.formed(), pause(1.0),
        ),
        (*ALWAYS, formation_held(), heading_ends_at("h1", 180), transmitters_undisturbed),
    ),
    Manoeuvre(
        "formation-changes", "Triangle, column, line abreast, triangle", 20.0,
        in_order(
            go_to((0.5, 0.0, 1.0)),
            _place((-0.5, 0.0, 0.0), (-1.0, 0.0, 0.0)),
            _place((0.0, 0.6, 0.0), (0.0, -0.6, 0.0)),
            _place(LEFT, RIGHT),
            go_to((0.0, 0.0, 1.0)), steps.formed(), pause(1.0),
        ),
        (*ALWAYS, formation_held(), distance_kept, ends_at("h2", (*LEFT[:2], 1.0))),
    ),
    Manoeuvre(
        "smooth-transition",
        "A follower's offset moves to another place within four seconds while the leader flies", 12.0,
        in_order(
            steps.follow("h2", "h1", (-0.8, 0.3, 0.3), transition_s=4.0),
            go_to((0.3, 0.0, 1.0)), go_to((0.3, 0.2, 1.0)), steps.formed(), pause(1.0),
        ),
        (*ALWAYS, formation_held(), ends_at("h2", (-0.5, 0.5, 1.3))),
    ),
    Manoeuvre(
        "heading-frame",
        "Offsets that turn with the leader's heading: half a turn in steps of 45 degrees", 20.0,
        in_order(
            _place(LEFT, RIGHT, "heading"),
            *(go_to((0.0, 0.0, 1.0), yaw_deg) for yaw_deg in (45, 90, 135, 180)),
            steps.formed(), pause(1.0),
        ),
        (*ALWAYS, formation_held(100.0, 400.0), distance_kept, ends_at("h2", (0.4, -0.5, 1.0), 0.15)),
    ),
    Manoeuvre(
        "leader-change",
        "A follower becomes the leader of the formation in flight; everybody keeps its place", 12.0,
        in_order(
            pause(1.0), steps.promote("h2"), steps.formed(),
            go_to((-0.2, 0.6, 1.2), name="h2"), steps.formed(), pause(1.0),
        ),
        (
            *ALWAYS, formation_held(), followed("h2"), followed("h1", "h2"), transmitters_undisturbed,
            ends_at("h1", (0.2, 0.1, 1.2)),
        ),
    ),
    Manoeuvre(
        "leader-change-and-back", "Leader and follower change roles twice while flying", 10.0,
        in_order(
            steps.promote("h2"), steps.formed(), pause(1.0), steps.promote("h1"), steps.formed(), pause(1.0),
            go_to((0.3, 0.0, 1.0)), steps.formed(),
        ),
        (*ALWAYS, formation_held(), followed("h1"), followed("h2", "h1"), transmitters_undisturbed),
    ),
    Manoeuvre(
        "chain", "Five vehicles, each follows the one before; the leader makes steps", 16.0,
        in_order(
            go_to((0.3, 0.0, 1.0)), go_to((0.3, 0.2, 1.3)), go_to((0.0, 0.0, 1.0)),
            steps.formed(), pause(1.0),
        ),
        (*ALWAYS, formation_held(), followed("h5", "h4"), distance_kept),
        fleet="quintet",
    ),
    Manoeuvre(
        "mixed-types",
        "Two helicopters and a quadrotor in one formation; the helicopter leads, then the quadrotor", 20.0,
        in_order(
            go_to((0.4, 0.0, 1.2)), go_to((0.4, 0.2, 1.0), 90), steps.formed(),
            steps.promote("q1"), steps.formed(),
            go_to((-0.3, 0.5, 1.2), name="q1"), steps.formed(), pause(1.0),
        ),
        (*ALWAYS, formation_held(), followed("q1"), followed("h1", "q1"), distance_kept),
        fleet="mixed",
    ),
    Manoeuvre(
        "two-leaders", "A follower keeps between two leaders with weights 1 and 2", 12.0,
        in_order(
            steps.follow_several(
                "h3",
                LeaderLink(leader="h1", offset_m=RIGHT, weight=1.0),
                LeaderLink(leader="h2", offset_m=(0.0, -1.0, 0.0), weight=2.0),
            ),
            steps.formed(), go_to((0.3, 0.2, 1.0)), steps.formed(), pause(1.0),
        ),
        (*ALWAYS, formation_held(), followed("h3", "h1", "h2"), ends_at("h3", (-0.1, -0.3, 1.0))),
    ),
    Manoeuvre(
        "leave-and-return", "A follower leaves the formation, flies by itself, and comes back", 14.0,
        in_order(
            steps.lead("h3"), go_to((-0.8, -0.8, 1.3), name="h3"), go_to((0.3, 0.0, 1.0)),
            steps.follow("h3", "h1", RIGHT), steps.formed(), pause(1.0),
        ),
        (*ALWAYS, formation_held(), followed("h3", "h1"), distance_kept),
    ),
    Manoeuvre(
        "land-and-return",
        "A follower lands while the others fly on, takes off again and is back in formation", 20.0,
        in_order(
            steps.land("h3"), go_to((0.2, 0.0, 1.0)), steps.take_off("h3"), steps.formed(),
            go_to((0.0, 0.0, 1.0)), steps.formed(), pause(1.0),
        ),
        (*CONTROLLED, formation_held(), followed("h3", "h1"), ends_at("h3", (-0.4, -0.5, 1.0))),
    ),
    Manoeuvre(
        "leave-and-join",
        "A follower lands and its agent ends; it is started again, takes off and joins the formation", 25.0,
        in_order(
            steps.leave("h3"), go_to((0.2, 0.0, 1.0)), steps.join("h3"),
            go_to((0.0, 0.0, 1.0)), steps.formed(), pause(1.0),
        ),
        (
            *CONTROLLED, formation_held(), followed("h3", "h1"), agents_started_again("h3"),
            ends_at("h3", (-0.4, -0.5, 1.0)),
        ),
    ),
    Manoeuvre(
        "controller-switch",
        "A follower flies with one controller after the other while the leader moves", 14.0,
        in_order(
            pause(1.0), go_to((0.2, 0.0, 1.0)),
            steps.tune("h2", lambda vehicle: vehicle.tune("pid")),
            go_to((0.2, 0.2, 1.0)), go_to((0.0, 0.2, 1.0)),
            steps.tune("h2", lambda vehicle: vehicle.tune("cascade")),
            go_to((0.0, 0.0, 1.0)), steps.formed(), pause(1.0),
        ),
        (
            *IN_THE_AIR, controllers_flown("h2", "cascade", "pid", "cascade"),
            formation_held(100.0, 250.0), transmitters_undisturbed, ends_at("h2", (*LEFT[:2], 1.0)),
        ),
    ),
    Manoeuvre(
        "tuning", "Weights and horizon change in flight; weights that make no sense are refused", 10.0,
        in_order(
            steps.tune("h2", lambda vehicle: vehicle.tune(input_weights=(20.0, 20.0, 30.0, 200.0))),
            go_to((0.2, 0.0, 1.0)),
            steps.tune("h1", lambda vehicle: vehicle.tune(horizon=30)),
            go_to((0.2, 0.2, 1.1)),
            steps.refused("a negative weight", lambda fleet: fleet["h2"].tune(input_weights=(-1.0, 1, 1, 1))),
            steps.tune("h1", lambda vehicle: vehicle.tune(horizon=50)),
            go_to((0.0, 0.0, 1.0)), steps.formed(), pause(1.0),
        ),
        (*IN_THE_AIR, formation_held(), transmitters_undisturbed, ends_at("h2", (*LEFT[:2], 1.0))),
    ),
    Manoeuvre(
        "figure-eight", "The leader flies a figure-eight twice, 12 s each, and the formation with it", 30.0,
        in_order(
            steps.fly_path(figure_eight((0.0, 0.0, 1.1), (0.5, 0.25), 12.0, turns=2.0)),
            steps.formed(), pause(1.0),
        ),
        (
            *IN_THE_AIR, formation_held(), transmitters_undisturbed, ends_at("h1", (0.0, 0.0, 1.1)),
            ends_at("h2", (*LEFT[:2], 1.1)),
        ),
    ),
    Manoeuvre(
        "identify", "The leader's sticks move a little for 40 s, and its model is fitted to the flight", 50.0,
        in_order(steps.identify("h1", 40.0), steps.formed(), pause(1.0)),
        (*IN_THE_AIR, transmitters_undisturbed, ends_at("h1", (0.0, 0.0, 1.0))),
    ),
    Manoeuvre(
        "place-swapping",
        "Five vehicles on a circle are sent across it at the same moment, and back again", 14.0,
        in_order(
            *(steps.lead(name) for name in FIVE[1:]),
            steps.go_together(on_circle(72.0)), pause(1.0),
            steps.go_together(on_circle(252.0)), pause(1.0),
            steps.go_together(on_circle(72.0)), pause(1.0),
        ),
        (
            *CONTROLLED, distance_kept, avoided, transmitters_undisturbed,
            *(ends_at(name, place) for name, place in on_circle(72.0).items()),
        ),
        fleet="quintet",
    ),
    Manoeuvre(
        "refusals", "Invalid requests are refused with the reason and have no effect", 5.0,
        in_order(
            steps.refused("following itself", lambda fleet: fleet["h2"].follow("h2")),
            steps.refused("an unknown leader", lambda fleet: fleet["h2"].follow("h9")),
            steps.refused("a cycle", lambda fleet: fleet["h1"].follow("h3")),
            steps.refused("a set point outside", lambda fleet: fleet["h1"].go_to((0.0, 0.0, 9.0))),
            steps.refused("a set point for a follower", lambda fleet: fleet["h2"].go_to((0.0, 0.0, 1.0))),
            steps.refused("a take-off in flight", lambda fleet: fleet["h1"].take_off()),
            pause(2.0),
        ),
        (*ALWAYS, formation_held(), transmitters_undisturbed, ends_at("h2", (*LEFT[:2], 1.0))),
    ),
)  # fmt: skip

MANOEUVRES: Final = MappingProxyType({row.name: row for row in ROWS})
