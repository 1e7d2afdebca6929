"""A hundred helicopters in slow motion: python hundred.py [SPEED|lockstep].

Rings become crowns, a group changes its leader, a wave runs through all groups, and the whole formation flies
a figure-eight. At the default speed of 0.05 this takes about half an hour on two cores.
"""

import math
import sys

from rcopterx import figure_eight, launched

HEAD = "h1"
HEIGHT_M = 1.0
CROWN_M = 0.15
WAVE_M = 0.25
MOVE_S = 5.0
EIGHT = figure_eight((0.0, 0.0, HEIGHT_M), (0.4, 0.2), 16.0)


def links_of(file, leader):
    """Followers of a vehicle by the fleet file, with their offsets."""
    links = {name: vehicle.follow[0] for name, vehicle in file.vehicles.items() if vehicle.follow}
    return {name: link.offset_m for name, link in links.items() if link.leader == leader}


def crowns(fleet, height_m):
    """Every other vehicle of each ring flies higher than its leader, the others lower."""
    groups = groups_of(fleet.file)
    for leader in groups:
        ring = {
            name: offset_m for name, offset_m in links_of(fleet.file, leader).items() if name not in groups
        }
        for number, (name, (x, y, _)) in enumerate(ring.items()):
            fleet[name].follow(leader, (x, y, height_m if number % 2 else -height_m), transition_s=MOVE_S)
    fleet.wait(MOVE_S)
    fleet.wait_for_formation()


def groups_of(file):
    """Vehicles that others follow by the fleet file, the head first, with their offsets to it."""
    leaders = {vehicle.follow[0].leader for vehicle in file.vehicles.values() if vehicle.follow}
    offsets_m = links_of(file, HEAD)
    return {HEAD: (0.0, 0.0, 0.0)} | {name: offsets_m[name] for name in offsets_m if name in leaders}


def wave(fleet, height_m):
    """Groups rise and sink, each by its place along x."""
    for name, (x, y, _) in groups_of(fleet.file).items():
        if name != HEAD:
            fleet[name].follow(HEAD, (x, y, height_m * math.sin(x)), transition_s=MOVE_S)
    fleet.wait(MOVE_S)
    fleet.wait_for_formation()


def change_leader(fleet):
    """The last group follows the one before it, at the same place, and then the head again."""
    *_, (before, (bx, by, _)), (last, (x, y, z)) = groups_of(fleet.file).items()
    for leader, offset_m in ((before, (x - bx, y - by, 0.0)), (HEAD, (x, y, z))):
        fleet[last].follow(leader, offset_m)
        fleet.wait_for_formation()


def fly(fleet):
    """The whole show."""
    fleet.take_off(height_m=HEIGHT_M)
    fleet.wait_for_formation()
    show = {
        "rings become crowns": lambda fleet: crowns(fleet, CROWN_M),
        "crowns become rings": lambda fleet: crowns(fleet, 0.0),
        "the last group changes its leader": change_leader,
        "wave": lambda fleet: wave(fleet, WAVE_M),
        "wave back": lambda fleet: wave(fleet, 0.0),
        "figure-eight": lambda fleet: fleet[HEAD].fly(EIGHT, wait=True),
    }
    for name, part in show.items():
        print(name, flush=True)
        part(fleet)
        missed = sum(fleet.state_of(name).agent.diagnostics.missed_ticks for name in fleet.file.vehicles)
        print(f"  {missed} control periods missed so far", flush=True)
    fleet.wait_for_formation()


def main(pace="0.05"):
    """Start the fleet and fly; `rcopterx report` shows the figures of the flight afterwards."""
    pace = {"lockstep": True} if pace == "lockstep" else {"speed": float(pace)}
    with launched("hundred", **pace) as fleet:
        fly(fleet)


if __name__ == "__main__":
    main(*sys.argv[1:])
