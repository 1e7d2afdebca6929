"""What routers say of the links between hosts, and of the clocks of hosts, in words."""

from collections.abc import Mapping

from rcopterx.bus.link_messages import LinkState, RouterStatus


def host_notes(statuses: Mapping[str, RouterStatus], here: str) -> list[str]:
    """A line for every host that the router used here is linked with, and for every link that is missing.

    Parameters
    ----------
    statuses
        Newest status of the routers that are heard, by host.
    here
        Host whose router is used: clocks are compared with its clock.
    """
    lines = []
    missing = set()
    for host, status in sorted(statuses.items()):
        for other, state in sorted(status.links.items()):
            if not state.linked:
                missing.add(tuple(sorted((host, other))))
            elif host == here:
                lines.append(f"host {other}: {_clock(state, here)}{_incidents(state)}")
    return [f"hosts {first} and {second} are not linked" for first, second in sorted(missing)] + lines


def clock_differences(statuses: Mapping[str, RouterStatus], here: str, limit_s: float) -> list[str]:
    """A line for every host whose clock differs from that of `here` by more than a limit [s]."""
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


def _incidents(state: LinkState) -> str:
    redialled = f", redials: {state.redials}" if state.redials else ""
    late = f", late beats: {state.late}" if state.late else ""
    return redialled + late
