"""KILL in the browser: a button and the space bar, in a script of their own, so that no press is lost.

viser's own buttons will not do: of the messages of its panel it sends one in 50 ms and forgets the others, it
sends nothing while it is not connected, and hides buttons when the panel is folded up. Its commands are sent
at once, by their key: the script presses that key until viser has taken it, and says so where it cannot.
"""

import threading
from typing import Any, Final

import viser
from viser import _messages

from rcopterx.ground_station.page.steering import Steering

LABEL: Final = "KILL: cut all motors (space bar)"
ANCHOR: Final = '<i id="rcopterx-connected"></i>'
"""The script sees by it whether viser is connected."""
STYLE: Final = """<style>
#rcopterx-kill {
  position: fixed; top: 12px; left: 50%; transform: translateX(-50%); z-index: 10000;
  width: min(24em, calc(100vw - 24px)); height: 3.4em; border: 0; border-radius: 6px; cursor: pointer;
  color: #fff; background: #e03131; font: 700 1.05rem system-ui, sans-serif;
  box-shadow: 0 1px 6px rgba(0, 0, 0, 0.35);
}
#rcopterx-kill:hover, #rcopterx-kill:active { background: #b02525; }
#rcopterx-kill.waiting { background: #e8590c; font-size: 0.9rem; }
#rcopterx-kill.unheard { background: #5c5f66; font-size: 0.9rem; }
.mantine-Notifications-root[data-position^="top"] { top: calc(3.4em + 32px) !important; }
</style>"""
"""Keeps the button at the top of the window, whatever is scrolled or opened, and notices below it."""
KILL_SCRIPT: Final = """
if (!window.rcopterxKill) {
  const LABEL = '%LABEL%', TRIED_MS = 10000, WATCHED_MS = 1000, AGAIN_MS = 100;
  const button = document.createElement('button');
  button.id = 'rcopterx-kill';
  button.type = 'button';
  button.textContent = LABEL;
  document.body.append(button);
  let pressedAt = -Infinity, sentAt = -Infinity, pending = false, gaveUp = false;
  const connected = () => {
    const anchor = document.getElementById('rcopterx-connected');
    return anchor !== null && getComputedStyle(anchor).pointerEvents !== 'none';
  };
  const SPACE = { key: ' ', code: 'Space', bubbles: true, cancelable: true };
  const send = () => {
    // Whoever takes the key keeps others from it: that tells that viser knows its command.
    if (!connected() || document.body.dispatchEvent(new KeyboardEvent('keydown', SPACE))) return false;
    sentAt = performance.now();
    return true;
  };
  const press = () => {
    pressedAt = performance.now();
    gaveUp = false;
    pending = !send();
    show();
  };
  const show = () => {
    const says = pending ? 'KILL waits: the page is not connected'
      : gaveUp ? 'KILL was NOT sent: the page is not connected'
      : connected() ? LABEL : 'Not connected: KILL does not reach the fleet';
    if (button.textContent !== says) button.textContent = says;
    button.className = pending || gaveUp ? 'waiting' : connected() ? '' : 'unheard';
  };
  const tend = () => {
    const now = performance.now();
    // What was sent while the connection broke may not have arrived.
    if (!pending && !connected() && now - sentAt < WATCHED_MS) pending = true;
    if (pending && now - pressedAt > TRIED_MS) { pending = false; gaveUp = true; }
    if (pending) pending = !send();
    if (connected() && !pending) gaveUp = false;
    show();
  };
  setInterval(tend, AGAIN_MS);
  button.addEventListener('click', press);
  window.addEventListener('keydown', (event) => {
    if (event.code !== 'Space' || !event.isTrusted || event.ctrlKey || event.altKey || event.metaKey) return;
    // Sliders, lists and buttons would do something else.
    event.preventDefault();
    event.stopImmediatePropagation();
    document.activeElement?.blur?.();
    if (!event.repeat) press();
  }, true);
  // A focused button is pressed by the release of the space bar.
  window.addEventListener('keyup', (event) => { if (event.code === 'Space') event.preventDefault(); }, true);
  window.rcopterxKill = { press };
}
""".replace("%LABEL%", LABEL)
"""Runs once in every browser."""


def add_kill_button(server: viser.ViserServer, steering: Steering) -> None:
    """Put KILL into every browser that connects.

    Parameters
    ----------
    server
        Where browsers connect.
    steering
        Is told of every press, in a thread of its own: requests that wait may have taken all of viser's.
    """

    async def on_trigger(_: Any) -> None:
        threading.Thread(target=steering.kill, name="kill").start()

    server.gui.add_html(STYLE + ANCHOR)
    server.gui.add_command(
        "KILL: cut all motors", description="Latching; reset to fly again.", hotkey="space"
    ).on_trigger(on_trigger)
    server.gui._websock_interface.queue_message(_messages.RunJavascriptMessage(KILL_SCRIPT))
