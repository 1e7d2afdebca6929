"""KILL in the browser: a button and the space bar, in a script of their own, so that no press is lost.

Buttons of viser are not reliable enough: viser sends one message of its panel in 50 ms and drops the others,
sends nothing while it is not connected, and hides buttons when the panel is folded up. It sends commands at
once, by their key: the script presses that key until viser has accepted it, and shows when that is not
possible.
"""

import threading
from typing import Any, Final

import viser
from viser import _messages

from rcopterx.ground_station.page.steering import Steering

LABEL: Final = "KILL: cut all motors (space bar)"
ANCHOR: Final = '<i id="rcopterx-connected"></i>'
"""The script reads from its style whether viser is connected."""
STYLE: Final = """<style>
#rcopterx-kill {
  position: fixed; top: 12px; left: 50%; transform: translateX(-50%); z-index: 10000;
  width: min(24em, calc(100vw - 24px)); height: 3.4em; border: 0; border-radius: 6px; cursor: pointer;
  color: #fff; background: #e03131; font: 700 1.05rem system-ui, sans-serif;
  box-shadow: 0 1px 6px rgba(0, 0, 0, 0.35);
}
#rcopterx-kill:hover, #rcopterx-kill:active { background: #b02525; }
#rcopterx-kill.waiting { background: #e8590c; font-size: 0.9rem; }
#rcopterx-kill.disconnected { background: #5c5f66; font-size: 0.9rem; }
.mantine-Notifications-root[data-position^="top"] { top: calc(3.4em + 32px) !important; }
</style>"""
"""Keeps the button at the top of the window, and notifications below it."""
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
    // viser prevents the default action of a key that it accepts.
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
    button.className = pending || gaveUp ? 'waiting' : connected() ? '' : 'disconnected';
  };
  const check = () => {
    const now = performance.now();
    // A message that was sent shortly before the connection broke may be lost.
    if (!pending && !connected() && now - sentAt < WATCHED_MS) pending = true;
    if (pending && now - pressedAt > TRIED_MS) { pending = false; gaveUp = true; }
    if (pending) pending = !send();
    if (connected() && !pending) gaveUp = false;
    show();
  };
  setInterval(check, AGAIN_MS);
  button.addEventListener('click', press);
  window.addEventListener('keydown', (event) => {
    if (event.code !== 'Space' || !event.isTrusted || event.ctrlKey || event.altKey || event.metaKey) return;
    // Sliders, lists and buttons react to the space bar themselves.
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
    """Put KILL into every browser that connects."""

    async def on_trigger(_: Any) -> None:
        # All threads of viser may be busy with requests that wait.
        threading.Thread(target=steering.kill, name="kill").start()

    server.gui.add_html(STYLE + ANCHOR)
    server.gui.add_command(
        "KILL: cut all motors", description="Latching; reset to fly again.", hotkey="space"
    ).on_trigger(on_trigger)
    server.gui._websock_interface.queue_message(_messages.RunJavascriptMessage(KILL_SCRIPT))
