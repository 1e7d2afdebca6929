"""Vehicle types and margins: `types` and `margins`."""

import typer

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


def margins(fleet: FleetArgument, vehicles: Vehicles = None, as_json: JsonOption = False) -> None:
    """Show gain, phase and delay margins of vehicles as a fleet file configures them.

    Also the peak of the sensitivity, and how many joint corners of the model's uncertainty are stable.
    Exit code 1 if an axis falls short of what the uncertainty of its model requires.
    """
    from rcopterx.ground_station.terminal.margins import COLUMNS, fleet_margins, rows_of

    file = fleet_file(fleet)
    check_known(vehicles or (), file.vehicles, "vehicle", "VEHICLE")
    document = fleet_margins(file, vehicles or file.vehicles)
    found = document["vehicles"]
    if as_json:
        print_document(document, as_json)
    else:
        headings = [heading.replace(" ", "\n", 1) for heading in COLUMNS]
        print_table(headings, (row for name in found for row in rows_of(name, found[name])))
    axes = (axis for vehicle in found.values() for axis in (vehicle["axes"] or {}).values())
    if any(axis["below_rule"] for axis in axes):
        raise typer.Exit(EXIT_FAILED)
