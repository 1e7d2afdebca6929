"""Promises of the commands about keep-out zones and lights."""

import pytest
from click.testing import Result
from support.scripted import ScriptedVehicle
from typer.testing import CliRunner

from rcopterx.bus.messages import Zone
from rcopterx.command_line import app


def run(*words: str) -> Result:
    return CliRunner().invoke(app, list(words))


def test_zones_are_set_listed_and_removed(up: str, vehicles: dict[str, ScriptedVehicle]) -> None:
    done = run("zone", "table", "-0.5,-0.4,0", "0.5,0.4,0.8", "--margin", "0.1", "-f", up)
    assert done.stdout == "table: vehicles keep out of it\n"
    (sent,) = vehicles["h2"].requests
    assert sent.zones.zones["table"] == Zone(min_m=(-0.5, -0.4, 0.0), max_m=(0.5, 0.4, 0.8), margin_m=0.1)
    listed = run("zone", "-f", up).stdout
    assert listed == "table: box from -0.5,-0.4,0 to 0.5,0.4,0.8 m, margin 0.1 m\n"
    assert run("zone", "table", "--remove", "-f", up).stdout == "table: removed\n"
    assert run("zone", "-f", up).stdout == ""


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["table"], "give two corners, or --remove"),
        (["table", "0,0,0"], "give two corners, or --remove"),
        (["table", "0,0,0", "1,1"], "three numbers separated by commas"),
        (["table", "0,0,0", "1,0,1"], "zones.table.max_m[1]"),
        (["table", "0,0,0", "1,2,1", "--cylinder"], "corners of a square"),
        (["My table", "0,0,0", "1,1,1"], "zones"),
        (["lamp", "--remove"], "no keep-out zone 'lamp', there are none"),
    ],
)
def test_wrong_zones_are_usage_errors_and_nothing_is_sent(
    up: str, vehicles: dict[str, ScriptedVehicle], words: list[str], reason: str
) -> None:
    done = run("zone", *words, "-f", up)
    assert done.exit_code
    assert reason in " ".join(done.stderr.replace("│", " ").split())
    assert "Traceback" not in done.stderr
    assert not vehicles["h1"].requests


def test_a_colour_is_sent_and_a_wrong_one_is_a_usage_error(
    up: str, vehicles: dict[str, ScriptedVehicle]
) -> None:
    assert run("light", "h1", "255,0,7", "-f", up).stdout == "h1: 255,0,7\n"
    assert [request.colour for request in vehicles["h1"].requests] == [(255, 0, 7)]
    for colour in ("256,0,0", "0.5,0,0", "1,2", "red"):
        assert run("light", "h1", colour, "-f", up).exit_code == 2
    assert len(vehicles["h1"].requests) == 1
