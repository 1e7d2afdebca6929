"""Fleet files from the configuration of other software: `import`."""

from pathlib import Path
from typing import Annotated

import typer

from rcopterx.commands.fleet_option import user_errors
from rcopterx.commands.parsing import three

app = typer.Typer(help="Write a fleet file from files of other software.", no_args_is_help=True)

MOTION_CAPTURE = "motion_capture.yaml"
SourceFile = Annotated[
    Path, typer.Argument(metavar="CRAZYFLIES", exists=True, dir_okay=False, help="File crazyflies.yaml.")
]


FleetFile = Annotated[
    Path, typer.Argument(metavar="FILE", help="Fleet file to write, for instance lab.toml.")
]
LowerCorner = Annotated[
    str, typer.Option("--volume-min", metavar="X,Y,Z", help="Lower corner of the flight volume in metres.")
]
UpperCorner = Annotated[
    str, typer.Option("--volume-max", metavar="X,Y,Z", help="Upper corner of the flight volume in metres.")
]


@app.command()
def crazyswarm2(
    source: SourceFile,
    file: FleetFile,
    motion_capture: Annotated[
        Path | None, typer.Option(metavar="FILE", help=f"Default: {MOTION_CAPTURE} beside the other one.")
    ] = None,
    rate_hz: Annotated[
        float | None,
        typer.Option("--rate", metavar="HZ", help="Capture rate; only a Vicon Tracker reports its own."),
    ] = None,
    volume_min: LowerCorner = "-1.5,-1.5,0",
    volume_max: UpperCorner = "1.5,1.5,2",
) -> None:
    """Write the fleet file of the enabled Crazyflies of Crazyswarm2, with their motion capture."""
    from rcopterx.deploy.crazyswarm import read_tracker, read_vehicles
    from rcopterx.deploy.new_laboratory import NewLaboratory, name_of, write_fleet_file

    with user_errors():
        vehicles = read_vehicles(source)
        brand, address = read_tracker(motion_capture or source.with_name(MOTION_CAPTURE))
        laboratory = NewLaboratory(
            name=name_of(file.stem),
            tracker=address,
            brand=brand,
            rate_hz=rate_hz,
            volume_min_m=three(volume_min),
            volume_max_m=three(volume_max),
            protocol=None,
            type="crazyflie",
            vehicles=vehicles,
        )
        write_fleet_file(file, laboratory)
    typer.echo(f"{file}: {', '.join(one.name for one in vehicles)}; its first lines list the next steps")


@app.command()
def skybrush(
    show: Annotated[
        Path,
        typer.Argument(
            metavar="SHOW",
            exists=True,
            dir_okay=False,
            help="File .skyc, or a zip of CSV files.",
        ),
    ],
    file: FleetFile,
    volume_min: LowerCorner = "-1.5,-1.5,0",
    volume_max: UpperCorner = "1.5,1.5,2",
) -> None:
    """Write the fleet file of a simulated vehicle for each drone of a show of Skybrush."""
    from rcopterx.deploy.new_laboratory import NewLaboratory, name_of, write_fleet_file
    from rcopterx.deploy.skybrush import read_vehicles

    with user_errors():
        vehicles = read_vehicles(show)
        laboratory = NewLaboratory(
            name=name_of(file.stem),
            tracker="127.0.0.1:18801",
            volume_min_m=three(volume_min),
            volume_max_m=three(volume_max),
            protocol=None,
            type="coaxial",
            vehicles=vehicles,
            simulated=True,
        )
        write_fleet_file(file, laboratory)
    typer.echo(f"{file}: {len(vehicles)} vehicles; fly the show: examples/light_show --fleet {file}")
