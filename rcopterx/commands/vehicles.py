"""Vehicle types and margins: `types` and `margins`."""

from collections.abc import Sequence
from typing import Annotated

import typer
from typer import Option

from rcopterx.commands.fleet_option import EXIT_FAILED, FleetArgument, fleet_file
from rcopterx.commands.output import JsonOption, print_document, print_table
from rcopterx.commands.parsing import check_known
from rcopterx.commands.steer import Vehicles


def types(as_json: JsonOption = False) -> None:
    """List the vehicle types that fleet files and new-lab can name, those of installed packages included."""
    from rcopterx.fleet.vehicle_types import type_names, vehicle_type

    found = [vehicle_type(name) for name in type_names()]
    document = {
        one.name: {
            "text": one.file.text,
            "protocol": one.file.transmitter.protocol,
            "settings": one.file.transmitter.settings,
            "airframe": one.model.airframe,
            "thrust_to_weight": one.model.input_gain[2] / one.model.gravity_m_s2,
            "hover_thrust": one.model.hover_thrust,
            "lowest_ceiling_m": one.file.lowest_ceiling_m,
        }
        for one in found
    }
    width = max(map(len, document))
    lines = (f"{one.name:{width}}  {one.file.text}" for one in found)
    print_document(document, as_json, lambda _: "\n".join(lines))


def margins(
    fleet: FleetArgument,
    vehicles: Vehicles = None,
    formation: Annotated[bool, Option("--formation", help="Show how errors grow along it instead.")] = False,
    as_json: JsonOption = False,
) -> None:
    """Show gain, phase and delay margins of vehicles as a fleet file configures them.

    Also the peak of the sensitivity, and how many joint corners of the model's uncertainty are stable.

    With --formation: the largest factor over all frequencies by which deviations grow from vehicle to vehicle
    in a long line (below 1 they fade), and the horizontal error by gusts on a vehicle and all above it,
    relative to that by a gust on it alone. Exit code 1 if an axis falls short of what the uncertainty of
    its model requires, or if errors grow too much along the formation.
    """
    from rcopterx.ground_station.terminal.margins import (
        COLUMNS,
        FORMATION_COLUMNS,
        fleet_margins,
        formation_margins,
        formation_rows,
        rows_of,
    )

    file = fleet_file(fleet)
    check_known(vehicles or (), file.vehicles, "vehicle", "VEHICLE")
    document = formation_margins(file) if formation else fleet_margins(file, vehicles or file.vehicles)
    if as_json:
        print_document(document, as_json)
    elif formation:
        print_table(_two_lines(FORMATION_COLUMNS), formation_rows(document))
        if document["unknown"]:
            typer.echo(document["unknown"])
        for name in document["beyond"]:
            grown = document["vehicles"][name]["together"]
            typer.echo(
                f"{name}: errors grow {grown:.2f} times along its leaders, at most {document['limit']} is "
                "allowed; lower deviation_share, or let it follow a vehicle nearer to the head"
            )
    else:
        rows = (row for name, found in document["vehicles"].items() for row in rows_of(name, found))
        print_table(_two_lines(COLUMNS), rows)
    axes = () if formation else (found["axes"] or {} for found in document["vehicles"].values())
    if document.get("beyond") or any(axis["below_rule"] for own in axes for axis in own.values()):
        raise typer.Exit(EXIT_FAILED)


def _two_lines(headings: Sequence[str]) -> list[str]:
    return [heading.replace(" ", "\n", 1) for heading in headings]
