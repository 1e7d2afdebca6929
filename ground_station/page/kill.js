// KILL in the browser: a button and the space bar. Runs once; see browser.py.
if (!window.rcopterxKill) {
  const LABEL = 'KILL: cut all motors (space bar)', TRIED_MS = 10000, WATCHED_MS = 1000, AGAIN_MS = 100;
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
