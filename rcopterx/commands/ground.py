"""The web page of a running fleet: `ground`, and the page of `demo`."""

import os
import subprocess
import sys
import threading
import time
import webbrowser
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from importlib.util import find_spec
from tempfile import NamedTemporaryFile
from typing import TYPE_CHECKING, Annotated

import typer

from rcopterx.commands.fleet_option import (
    RunningFleetOption,
    failure,
    joined_fleet,
    wanted_fleet,
)
from rcopterx.commands.interruption import Interrupts, until_ctrl_c

if TYPE_CHECKING:
    from rcopterx.ground_station.page.page import FleetPage

UPDATE_S = 0.05
PORT = 8080
INSTALL = "pip install 'rcopterx[ground]'"
END_S = 5.0
COMES_UP_S = 15.0  # how long the page waits for a fleet that is being started


def ground(
    port: Annotated[
        int,
        typer.Option(
            metavar="PORT", min=1, max=65535, help="Port of the web page; the next free one if it is in use."
        ),
    ] = PORT,
    watch_only: Annotated[bool, typer.Option("--watch-only", help="Show a page without controls.")] = False,
    open_browser: Annotated[bool, typer.Option("--open", help="Open the page in the browser.")] = False,
    fleet: RunningFleetOption = None,
) -> None:
    """Show and control the fleet in the browser until Ctrl-C. The space bar cuts all motors."""
    if find_spec("viser") is None:
        raise failure(f"the web page needs viser: {INSTALL}")
    from rcopterx.deploy.hosts.run_directory import run_directory
    from rcopterx.deploy.roles.run import end_with_parent
    from rcopterx.ground_station.page.guard import PageServer, kept_key
    from rcopterx.ground_station.page.page import FleetPage, PageFrame

    end_with_parent()
    file, host = wanted_fleet(fleet)
    directory = run_directory(file.name, file.bus.namespace)
    key = kept_key(directory / ("watch.key" if watch_only else "page.key"))
    server = PageServer(port, f"rcopterx {file.name}", key)
    try:
        with until_ctrl_c() as interrupts:
            # Browsers load the page while a fleet that has just been started comes up.
            frame = PageFrame(server, file.name, steers=not watch_only)
            typer.echo(f"{server.address}  (Ctrl-C ends the page, the fleet goes on)")
            with (
                _opened(server.address) if open_browser else nullcontext(),
                joined_fleet(file, host, fleet, COMES_UP_S) as running,
            ):
                _keep(FleetPage(running, frame), running.session.clock, interrupts)
    finally:
        server.stop()


@contextmanager
def _opened(address: str) -> Iterator[None]:
    """Open an address in the browser by a file: other users can read the arguments of a browser's process."""
    with NamedTemporaryFile("w", prefix="rcopterx-", suffix=".html") as file:
        file.write(f'<meta http-equiv="refresh" content="0; url={address}">')
        file.flush()
        webbrowser.open(f"file://{file.name}")
        yield


def _keep(page: "FleetPage", clock: Callable[[], float], interrupts: Interrupts) -> None:
    """Update the page until Ctrl-C."""
    next_s = time.monotonic()
    while not interrupts.is_set():
        page.update(clock())
        # Late updates are not caught up.
        next_s = max(next_s + UPDATE_S, time.monotonic())
        time.sleep(max(0.0, next_s - time.monotonic()))


@contextmanager
def page_of(fleet: str, announce: Callable[[str], object]) -> Iterator[None]:
    """Serve the page from another process; another thread passes its address or an error to `announce`."""
    if find_spec("viser") is None:
        announce(f"no web page: it needs viser: {INSTALL}")
        yield
        return
    # Without a desktop a text browser would occupy the terminal.
    desktop = ["--open"] if os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY") else []
    page = subprocess.Popen(
        [sys.executable, "-u", "-m", "rcopterx", "ground", "-f", fleet, *desktop],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
        env=os.environ | {"RCOPTERX_PARENT": str(os.getpid())},
    )
    reader = threading.Thread(target=_announce_lines, args=(page, announce), daemon=True)
    reader.start()
    try:
        yield
    finally:
        page.terminate()
        try:
            page.wait(END_S)
        except subprocess.TimeoutExpired:
            page.kill()
            page.wait()
        reader.join(END_S)


def _announce_lines(page: subprocess.Popen[str], announce: Callable[[str], object]) -> None:
    assert page.stdout is not None
    for line in page.stdout:
        if line.startswith(("http", "error")):
            announce(f"web page: {line.partition('  (')[0].strip()}")
