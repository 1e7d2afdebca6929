"""The workbench of a radio: exclusive access to its transmitter, questions, and calibration."""

import os
import select
import signal
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import replace
from pathlib import Path

import typer

from rcopterx.commands.fleet_option import failure, running_fleet
from rcopterx.commands.output import print_changes
from rcopterx.commands.parsing import check_known
from rcopterx.deploy.hosts.run_directory import run_directory
from rcopterx.deploy.hosts.vehicle_states import reserved_state
from rcopterx.deploy.roles.transmitters import gateway_settings
from rcopterx.fleet.editing import write_calibration
from rcopterx.fleet.radios import calibration_of
from rcopterx.fleet.reading import fleet_path, load_fleet
from rcopterx.fleet.schema import FleetError, FleetFile
from rcopterx.ground_station.identification.hover_trim import STEADY, HoverError, measured_hover
from rcopterx.radios.calibration import Calibration, CalibrationError
from rcopterx.transmitter_gateway.workbench import Workbench, WorkbenchError

SIGN_QUESTIONS = {
    "pitch": ((0.5, 0.0, 0.0, 0.0), "u_x = +0.5: does the swash plate tilt nose-down?"),
    "roll": ((0.0, 0.5, 0.0, 0.0), "u_y = +0.5: does the swash plate tilt to the positive side of u_y?"),
    "yaw": ((0.0, 0.0, 0.0, 0.4), "u_psi = +0.4: would the yaw drive turn the nose to the left?"),
}
SHOW_S = 120.0
SPIN_S = 10.0
LARGEST_STEP_US = 60.0
ARMED_S = 0.3


class Dialogue:
    """Questions on standard error and answers on standard input while the radio keeps transmitting."""

    def __init__(self, bench: Workbench) -> None:
        self._bench = bench
        self._input = sys.stdin.fileno()
        self._waiting = b""

    def line(self, question: str, seconds: float = 3600.0) -> str | None:
        """Next line in lower case without blanks, None if late; `WorkbenchError` at the end of the input."""
        typer.echo(question, err=True)
        if not self._bench.run(seconds, self.has_line, [self._input]):
            return None
        first, _, self._waiting = self._waiting.partition(b"\n")
        return first.decode(errors="replace").strip().lower()

    def has_line(self) -> bool:
        """Read available input; return whether it has a whole line."""
        if b"\n" not in self._waiting and select.select([self._input], [], [], 0)[0]:
            if not (data := os.read(self._input, 4096)):
                raise WorkbenchError("standard input has ended without an answer; nothing was changed")
            self._waiting += data
        return b"\n" in self._waiting

    def yes(self, question: str) -> bool:
        """Ask until the answer is yes or no."""
        while True:
            answer = self.line(f"{question} [y/n]")
            if answer in ("y", "yes", "n", "no"):
                return answer.startswith("y")
            typer.echo(f"{answer!r}: y or n", err=True)


@contextmanager
def workbench(fleet: str, vehicle: str) -> Iterator[tuple[FleetFile, Path, Workbench]]:
    """Access to the transmitter of a vehicle that no gateway here serves; ends on throttle-low frames."""

    def stop(number: int, _frame: object) -> None:
        raise SystemExit(128 + number)

    def wait(descriptors: Sequence[int], timeout_s: float) -> Sequence[int]:
        return select.select(descriptors, [], [], timeout_s)[0]

    path = fleet_path(fleet)
    file = load_fleet(path)
    check_known([vehicle], file.vehicles, "vehicle", "VEHICLE")
    gateway = file.vehicles[vehicle].transmitter.gateway
    directory = run_directory(file.name, file.bus.namespace)
    settings = gateway_settings(file, gateway, directory)
    own = next(item for item in settings.transmitters if item.vehicle == vehicle)
    before = signal.signal(signal.SIGTERM, stop)
    try:
        # A serial port is exclusive by itself, the address of a vehicle is not.
        with closing(reserved_state(vehicle, directory)), Workbench(own, time.monotonic, wait) as bench:
            yield file, path, bench
    except (WorkbenchError, CalibrationError) as error:
        raise failure(error) from None
    finally:
        signal.signal(signal.SIGTERM, before)


def own_model_match(file: FleetFile, vehicle: str) -> int:
    """Number of the vehicle's model match; `FleetError` if another vehicle has the same."""
    number = file.vehicles[vehicle].transmitter.model_match
    for name, other in file.vehicles.items():
        if name != vehicle and other.transmitter.model_match == number:
            raise FleetError(
                f"vehicles.{vehicle}.transmitter.model_match: {number} is also that of {name}; "
                "give every vehicle its own"
            )
    return number


def check_signs(bench: Workbench, dialogue: Dialogue, calibration: Calibration) -> Calibration:
    """Deflect every axis, motors off, and ask whether it moves in the right direction."""
    for axis, (u, question) in SIGN_QUESTIONS.items():
        bench.show(u, seconds=SHOW_S)
        if not dialogue.yes(question):
            channel = getattr(calibration, axis)
            calibration = replace(calibration, **{axis: replace(channel, sign=-channel.sign)})
    bench.show((0.0, 0.0, 0.0, 0.0), seconds=0.1)
    return calibration


def find_throttle(
    bench: Workbench, dialogue: Dialogue, calibration: Calibration, hover_thrust: float
) -> Calibration:
    """Let the user raise the throttle of the tethered vehicle to both points; the second one is hover."""
    found: dict[str, float] = {}
    dialogue.line("Tether the vehicle, keep clear of the rotors, then press return.")
    low_us = us = calibration.throttle.low_us
    while missing := [name for name in ("us0", "hover") if name not in found]:
        points = " and ".join(f"'{name}'" for name in missing)
        question = f"{us:g} us. A pulse width to try for {SPIN_S:g} s, 'stop', or {points} if this is it:"
        answer = dialogue.line(question, SPIN_S)
        if answer is None or answer == "stop":
            us = low_us
            bench.show((0.0, 0.0, 0.0, 0.0), seconds=0.1)
        elif answer in missing:
            found[answer] = us
        else:
            if us == low_us:  # flight controllers arm only with low throttle
                bench.show((0.0, 0.0, 0.0, 0.0), throttle_us=low_us, seconds=SPIN_S)
                bench.run(ARMED_S)
            us = _tried(bench, answer, us)
    bench.show((0.0, 0.0, 0.0, 0.0), seconds=0.1)
    throttle = replace(calibration.throttle, us0=found["us0"], us_hover=found["hover"], u_hover=hover_thrust)
    return replace(calibration, throttle=throttle)


def _tried(bench: Workbench, answer: str, present_us: float) -> float:
    """Throttle [us] after an answer that should be a pulse width; a wrong answer changes nothing."""
    try:
        wanted_us = float(answer)
    except ValueError:
        typer.echo(f"{answer!r}: a number, stop, us0 or hover", err=True)
        return present_us
    if not wanted_us <= present_us + LARGEST_STEP_US:
        typer.echo(f"{wanted_us:g} us: at most {LARGEST_STEP_US:g} us more at a time", err=True)
        return present_us
    try:
        bench.show((0.0, 0.0, 0.0, 0.0), throttle_us=wanted_us, seconds=SPIN_S)
    except WorkbenchError as error:
        typer.echo(str(error), err=True)
        return present_us
    return wanted_us


def trim_hover(vehicle: str, seconds: float, fleet: str) -> None:
    """Store mean inputs of a hover in the running fleet as trims, effective from the next start."""
    with running_fleet(fleet, [vehicle]) as running:
        path = fleet_path(fleet)
        calibration = calibration_of(load_fleet(path), vehicle)
        try:
            mean = measured_hover(running, vehicle, seconds)
            trimmed = calibration.trimmed(mean)
        except (HoverError, CalibrationError) as error:
            raise failure(f"{vehicle}: {error}") from None
        typer.echo(f"{vehicle}: mean inputs pitch {mean[0]:+.3f}, roll {mean[1]:+.3f}, yaw {mean[3]:+.3f}")
        if max(abs(mean[0]), abs(mean[1]), abs(mean[3])) < STEADY:
            typer.echo(f"{vehicle}: all below {STEADY:g}, trimmed")
            return
        print_changes(vehicle, write_calibration(path, vehicle, trimmed))
        typer.echo(f"{vehicle}: land, start the fleet again, and repeat until all are below {STEADY:g}")
