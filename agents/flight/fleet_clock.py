"""The Tracker's frame number as a clock."""


class FleetClock:
    """Counts the frame periods that have passed; frames bridged by coasting are counted once."""

    def __init__(self) -> None:
        self.epoch = 0
        self.frame = 0
        self.period_s = 0.0
        self.current_frame = 0  # number of the frame that belongs to the present, coasted ones included
        self.time_s = 0.0  # time since the first frame
        self.started = False

    def frames_until(self, epoch: int, frame: int, period_s: float) -> int:
        """Return the periods to predict up to a frame: 1 undisturbed, 0 after coasting, -1 if it is old."""
        if self.started and epoch == self.epoch:
            elapsed = frame - self.frame
            if elapsed <= 0:
                return -1
        elif self.started and epoch < self.epoch:
            return -1  # Epochs only grow: this one comes from a gateway that has been replaced.
        else:
            elapsed = 1 if self.started else 0
        coasted = self.current_frame - self.frame
        self.epoch, self.frame, self.period_s, self.started = epoch, frame, period_s, True
        self.current_frame = frame
        return max(elapsed - coasted, 0)

    def pass_period(self) -> None:
        """Advance by one frame period."""
        self.time_s += self.period_s

    def coast(self) -> None:
        """Advance by one frame period without a frame."""
        self.current_frame += 1
        self.pass_period()
