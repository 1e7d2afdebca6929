"""Fleet files from the configuration of other software: `import`."""

from pathlib import Path
from typing import Annotated

import typer

from rcopterx.commands.fleet_option import user_errors
from rcopterx.commands.parsing import three

app = typer.Typer(help="Write a fleet file from the configuration of other software.", no_args_is_help=True)

MOTION_CAPTURE = "motion_capture.yaml"
SourceFile = Annotated[
    Path, typer.Argument(metavar="CRAZYFLIES", exists=True, dir_okay=False, help="File crazyflies.yaml.")
]


@app.command()
def crazyswarm2(
    source: SourceFile,
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Fleet file to write, for instance lab.toml.")],
    motion_capture: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help=f"Default: {MOTION_CAPTURE} beside the other one."),
    ] = None,
    rate_hz: Annotated[
        float | None,
        typer.Option("--rate", metavar="HZ", help="Capture rate; only a Vicon Tracker reports its own."),
    ] = None,
    volume_min: Annotated[
        str, typer.Option(metavar="X,Y,Z", help="Lower corner of the flight volume in metres.")
    ] = "-1.5,-1.5,0",
    volume_max: Annotated[
        str, typer.Option(metavar="X,Y,Z", help="Upper corner of the flight volume in metres.")
    ] = "1.5,1.5,2",
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
