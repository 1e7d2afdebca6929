"""Faults of the simulated laboratory: `inject`."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer
from typer import Argument, Option

from rcopterx.commands.fleet_option import RunningFleetOption, failure, running_fleet, wanted_fleet
from rcopterx.commands.output import print_table
from rcopterx.commands.parsing import check_known

if TYPE_CHECKING:
    from rcopterx.fleet.schema import FleetFile
    from rcopterx.simulator.faults import TimedFault

app = typer.Typer(add_completion=False)

KILL_AGENT: Final = "kill_agent"


@app.command(rich_help_panel="Try out faults")
def inject(
    fault: Annotated[str | None, Argument(metavar="FAULT", help="Fault to inject, see --list.")] = None,
    fields: Annotated[
        list[str] | None,
        Argument(metavar="FIELD=VALUE", help="Fields of the fault, for instance subject=h2 duration_s=0.2."),
    ] = None,
    scenario: Annotated[
        Path | None, Option(metavar="FILE", help="TOML file with faults and their times.")
    ] = None,
    show_list: Annotated[bool, Option("--list", help="List all faults and their fields.")] = False,
    fleet: RunningFleetOption = None,
) -> None:
    """Inject faults of Tracker, radios or vehicles into the simulator, now or from a scenario file.

    `kill_agent VEHICLE` ends an agent of this fleet on this computer.
    """
    if show_list:
        from rcopterx_studies.faults.scenario import fault_list

        agent = (KILL_AGENT, "VEHICLE", "Its agent ends as in a crash.")
        print_table(("fault", "fields", "effect"), [agent, *fault_list()])
        return
    from rcopterx.fleet.schema import FleetError
    from rcopterx.simulator.faults import fault_text
    from rcopterx_studies.faults.scenario import FaultRefusedError, inject_faults

    file, _ = wanted_fleet(fleet)
    if file.simulator is None:
        raise FleetError(f"{file.name} flies hardware: there is no simulator for faults")
    if fault == KILL_AGENT:
        _kill_agents(file, fields or [])
        return
    lines = _wanted(file, fault, fields or [], scenario)
    with running_fleet(fleet) as running:
        try:
            inject_faults(running.session, lines)
        except FaultRefusedError as error:
            raise failure(f"refused: {error}") from None
    for line in lines:
        typer.echo(f"{line.at_s:6.2f} s  {fault_text(line.fault)}")


def _wanted(
    file: "FleetFile", fault: str | None, fields: Sequence[str], scenario: Path | None
) -> tuple["TimedFault", ...]:
    """Faults of the command line; names of vehicles are replaced by their subjects where needed."""
    from rcopterx.fleet.schema import FleetError
    from rcopterx.simulator.faults import TimedFault
    from rcopterx_studies.faults.scenario import fault_from, field_from, read_scenario

    if scenario is not None:
        if fault is not None:
            raise FleetError("either a fault or --scenario")
        return read_scenario(scenario)
    if fault is None:
        raise FleetError("a fault is missing, see --list")
    values = dict(field_from(text) for text in fields)
    subjects = {vehicle.subject for vehicle in file.vehicles.values()}
    for name in ("subject", "other"):
        named = values.get(name)
        if isinstance(named, str) and named in file.vehicles and named not in subjects:
            values[name] = file.vehicles[named].subject
    return (TimedFault(0.0, fault_from(fault, values)),)


def _kill_agents(file: "FleetFile", vehicles: Sequence[str]) -> None:
    """End the agents of vehicles."""
    from rcopterx_studies.faults.agent_process import kill_agent

    if not vehicles:
        raise typer.BadParameter("a vehicle is missing: kill_agent VEHICLE", param_hint="FIELD=VALUE")
    check_known(vehicles, file.vehicles, "vehicle", "VEHICLE")
    for vehicle in vehicles:
        typer.echo(f"agent of {vehicle}: process {kill_agent(file, vehicle)} killed")
