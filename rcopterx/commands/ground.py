"""The web page of a running fleet: `ground`, and the page of `demo`."""

import os
import subprocess
import sys
import threading
import webbrowser
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from importlib.util import find_spec
from tempfile import NamedTemporaryFile

import typer

from rcopterx.commands.fleet_option import RunningFleetOption, failure, wanted_fleet
from rcopterx.commands.interruption import until_ctrl_c

PORT = 8080
INSTALL = "pip install 'rcopterx[ground]'"
END_S = 5.0
JOIN_S = 2.0  # longest attempt to join the fleet


def ground(
    port: int = PORT, watch_only: bool = False, open_browser: bool = False, fleet: RunningFleetOption = None
) -> None:
    """Show and control the fleet in the browser until Ctrl-C. The space bar cuts all motors."""
    if find_spec("websockets") is None:
        raise failure(f"the web page needs websockets: {INSTALL}")
    from rcopterx.deploy.hosts.run_directory import run_directory
    from rcopterx.deploy.roles.run import end_with_parent
    from rcopterx.ground_station.page.guard import kept_key
    from rcopterx.ground_station.page.page import PageFrame, keep_showing
    from rcopterx.ground_station.scripting.fleet import Fleet

    end_with_parent()
    file, host = wanted_fleet(fleet)
    directory = run_directory(file.name, file.bus.namespace)
    key = kept_key(directory / ("watch.key" if watch_only else "page.key"))
    try:
        frame = PageFrame(port, fleet or file.name, key, steers=not watch_only)
    except OSError as error:
        raise failure(f"the page cannot be served: {error}") from None
    address = frame.server.address
    try:
        with until_ctrl_c() as interrupts, _opened(address) if open_browser else nullcontext():
            typer.echo(f"{address}  (Ctrl-C ends the page, the fleet goes on)")
            keep_showing(frame, lambda: Fleet(file, host, JOIN_S), interrupts)
    finally:
        frame.server.stop()


@contextmanager
def _opened(address: str) -> Iterator[None]:
    """Open an address in the browser by a file: other users can read the arguments of a browser's process."""
    with NamedTemporaryFile("w", prefix="rcopterx-", suffix=".html") as file:
        file.write(f'<meta http-equiv="refresh" content="0; url={address}">')
        file.flush()
        webbrowser.open(f"file://{file.name}")
        yield


@contextmanager
def page_of(fleet: str, announce: Callable[[str], object]) -> Iterator[None]:
    """Serve the page from another process; another thread passes its address or an error to `announce`."""
    if find_spec("websockets") is None:
        announce(f"no web page: it needs websockets: {INSTALL}")
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
    """Announce address and errors of the page, and the last line of one that breaks off otherwise."""
    assert page.stdout is not None
    announced = last = ""
    for line in page.stdout:
        last = line.strip() or last
        if line.startswith(("http", "error")):
            announced = last
            announce(f"web page: {line.partition('  (')[0].strip()}")
    if page.wait() > 0 and last != announced:
        announce(f"the web page has ended: {last}")
