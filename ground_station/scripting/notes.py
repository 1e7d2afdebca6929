"""Lines about motion capture, flight logs and hosts: problems that block take-off, and notes that do not."""

from collections.abc import Mapping, Sequence
from typing import Final

from rcopterx.bus.host_messages import LauncherStatus, LinkState, RouterStatus, TrackerStatus
from rcopterx.bus.log_messages import RecorderStatus
from rcopterx.ground_station.scripting.state import STALE_S, since

STALLED_S: Final = 2.0  # a launcher that has not checked its processes for so long is reported


def tracker_problems(status: TrackerStatus | None, age_s: float | None, names: Sequence[str]) -> list[str]:
    """Problems that the Vicon gateway reports for vehicles; `status` is None before the first one."""
    if status is None or age_s is None or age_s > STALE_S:
        return [f"Vicon gateway not responding{since(age_s)}"]
    if status.state != "up":
        return [f"Tracker: {status.trying}; does it run, and stream at tracker.address?"]
    listed = ", ".join(repr(subject.subject) for subject in status.subjects if subject.listed)
    found = []
    for subject in status.subjects:
        if subject.vehicle not in names:
            continue
        if not subject.listed:
            missing = f"{subject.vehicle}: subject {subject.subject!r} is not in the Tracker's list"
            found.append(f"{missing} (it lists: {listed or 'nothing'})")
        elif subject.ambiguous:
            found.append(f"{subject.vehicle}: the Tracker lists several subjects {subject.subject!r}")
        elif subject.shown_at_m is not None:
            place = ", ".join(f"{value:.0f}" for value in subject.shown_at_m)
            found.append(f"{subject.subject} is shown at ({place}) m: millimetres?")
        elif subject.same_place_as:
            found.append(
                f"{subject.vehicle}: {subject.subject!r} and {subject.same_place_as!r} are shown at the same "
                "place: one body for two subjects? Disable one in the Tracker"
            )
    return found


def tracker_notes(status: TrackerStatus | None) -> list[str]:
    """Subjects of no vehicle, and a raw recording of the Tracker's stream."""
    if status is None:
        return []
    notes = [
        f"subject {subject.subject!r} is in no vehicle"
        for subject in status.subjects
        if subject.vehicle is None and subject.listed
    ]
    return notes + ([f"raw recording: {status.recording}"] if status.recording else [])


def recorder_notes(host: str, status: RecorderStatus, responds: bool) -> list[str]:
    """Problems of the flight log of a host."""
    found = []
    if not responds:
        found.append(f"flight log: the recorder on {host} is not responding")
    elif status.state == "stopped":
        found.append(f"flight log: recording stopped: {status.reason}")
    if status.lost:
        found.append(f"flight log: {status.lost} messages lost")
    return found


def launcher_notes(host: str, status: LauncherStatus) -> list[str]:
    """Processes of a host that died or hung, a watchdog that is off, more agents than the host serves."""
    deaths = [
        f"{name} {restarts}" + (f" ({status.hung[name]} hung)" if status.hung.get(name) else "")
        for name, restarts in status.restarts.items()
        if restarts
    ]
    notes = [f"host {host}: started again: {', '.join(deaths)}"] if deaths else []
    if not status.watchdog:
        notes.append(f"host {host}: the watchdog is off, processes that hang are not replaced")
    if status.stalled_s >= STALLED_S:
        notes.append(
            f"host {host}: the launcher has not checked its processes for {status.stalled_s:.0f} s; land"
        )
    return notes + capacity_notes(host, status)


def capacity_notes(host: str, status: LauncherStatus) -> list[str]:
    """A line if a host runs more agents than it serves without missed periods, or measures that."""
    if status.measuring:
        return [f"host {host}: measures how many vehicles it can fly; take-off waits for the result"]
    if status.crowded:
        return [
            f"host {host}: runs the agents of {len(status.running)} vehicles, but can fly at most about "
            f"{status.flies[-1]}, and {status.flies[0]} without lower control rates; fly fewer, move some to "
            "other hosts, or use shorter horizons, longer control periods or fewer frames per second"
        ]
    if status.control_every == 1:
        return []
    return [
        f"host {host}: can fly about {status.flies[0]} such vehicles, but runs the agents of "
        f"{len(status.running)}, which therefore control one of {status.control_every} periods; move some to "
        "other hosts, or shorten their horizons"
    ]


def link_notes(statuses: Mapping[str, RouterStatus], here: str) -> list[str]:
    """A line for every link that is missing, and for every host that is linked with `here`."""
    lines, missing = [], set()
    for host, status in sorted(statuses.items()):
        for other, state in sorted(status.links.items()):
            if not state.linked:
                missing.add(tuple(sorted((host, other))))
            elif host == here:
                redialled = f", redials: {state.redials}" if state.redials else ""
                late = f", late beats: {state.late}" if state.late else ""
                lines.append(f"host {other}: {_clock(state, here)}{redialled}{late}")
    return [f"hosts {first} and {second} are not linked" for first, second in sorted(missing)] + lines


def clock_differences(statuses: Mapping[str, RouterStatus], here: str, limit_s: float) -> list[str]:
    """A line for every host whose clock differs from that of `here` by more than a limit."""
    links = statuses[here].links if here in statuses else {}
    return [
        f"host {other}: {_clock(state, here)}; set the clocks, for instance by chrony"
        for other, state in sorted(links.items())
        if state.clock_offset_s is not None and abs(state.clock_offset_s) > limit_s
    ]


def _clock(state: LinkState, here: str) -> str:
    if state.clock_offset_s is None or state.round_trip_s is None:
        return "linked"
    offset_ms, uncertain_ms = 1e3 * state.clock_offset_s, 5e2 * state.round_trip_s
    side = "ahead of" if offset_ms >= 0 else "behind"
    return (
        f"clock {abs(offset_ms):.1f} +- {uncertain_ms:.1f} ms {side} that of {here}, "
        f"round trip {1e3 * state.round_trip_s:.1f} ms"
    )
