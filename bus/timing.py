"""Times of a command between the motion capture and the radio."""

from msgspec import Struct

from rcopterx.bus.message import Clock, Name, Seconds


class CommandTiming(Struct, frozen=True, kw_only=True):
    """Times of one command; each is on the monotonic clock of the host named beside it.

    Differences between hosts need the offset of their clocks, which routers measure
    (`rcopterx.bus.link_messages.LinkState.monotonic_offset_s`).
    """

    latency_s: Seconds
    """From capture to the Vicon gateway, as far as the Tracker and the network report it."""
    gateway_host: Name
    received_s: Clock
    """Arrival of the frame at the Vicon gateway, on the clock of `gateway_host`."""
    agent_host: Name
    arrived_s: Clock
    """Arrival of the pose at the agent, on the clock of `agent_host`."""
    began_s: Clock
    """Start of the controller: the estimate was ready, and plans of leaders had arrived or were overdue."""
    ready_s: Clock
    """End of the controller."""
