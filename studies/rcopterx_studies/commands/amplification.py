"""Growth of errors along a formation: `amplification`."""

import typer

from rcopterx.commands.fleet_option import EXIT_FAILED, FleetArgument, fleet_file
from rcopterx.commands.output import JsonOption, print_document, print_table

app = typer.Typer(add_completion=False)


@app.command(rich_help_panel="Experiment")
def amplification(fleet: FleetArgument, as_json: JsonOption = False) -> None:
    """Show how errors grow along the formation of a fleet file.

    The largest factor over all frequencies by which deviations grow from vehicle to vehicle in a long line
    (below 1 they fade), and the horizontal error by gusts on a vehicle and all above it, relative to that by
    a gust on it alone. Exit code 1 if errors grow too much.
    """
    from rcopterx_studies.experiments.amplification import formation_amplifications

    document = formation_amplifications(fleet_file(fleet))
    vehicles = document["vehicles"] or {}
    if as_json:
        print_document(document, as_json)
    elif document["unknown"]:
        typer.echo(document["unknown"])
    else:
        rows = (
            (name, str(found["above"]), f"{found['passed_on']:.2f}", f"{found['together']:.2f}")
            for name, found in vehicles.items()
        )
        print_table(("vehicle", "vehicles\nabove", "passed\non", "errors\ntogether"), rows)
    for name in document["beyond"]:
        typer.echo(
            f"{name}: errors grow {vehicles[name]['together']:.2f} times along its leaders, at most "
            f"{document['limit']} is allowed; lower deviation_share, or let it follow a vehicle "
            "nearer to the head",
            err=as_json,
        )
    if document["beyond"]:
        raise typer.Exit(EXIT_FAILED)
