/** KILL by button and space bar, repeated until it is accepted; take-off, suspension, way home, landing and reset of the fleet. */
import { isConnected, link, request, send } from './link.js';

const AGAIN_MS = 100, TRIED_MS = 10000;
const button = document.getElementById('kill'), LABEL = button.innerHTML;
let pending = false, gaveUp = false, pressedAt = -Infinity;

const show = () => {
  const text = pending ? 'KILL waits: the page is not connected'
    : gaveUp ? 'KILL was NOT sent: the page is not connected'
    : isConnected() ? '' : 'Not connected: KILL does not reach the fleet';
  if (text) button.textContent = text;
  else button.innerHTML = LABEL;
  button.className = pending || gaveUp ? 'waiting' : isConnected() ? '' : 'disconnected';
};

const keepTrying = async () => {
  pending = true;
  while (pending) {
    show();
    await new Promise((resolve) => setTimeout(resolve, AGAIN_MS));
    try {
      await request('kill');
      pending = false;
    } catch {
      gaveUp = performance.now() - pressedAt > TRIED_MS;
      pending = !gaveUp;
    }
  }
};

const kill = async () => {
  pressedAt = performance.now();
  gaveUp = false;
  try {
    await request('kill');
  } catch {
    if (!pending) await keepTrying();
  }
  show();
};

button.addEventListener('click', kill);
link.addEventListener('connection', ({ detail }) => {
  if (detail) gaveUp = false;
  show();
});
link.addEventListener('texts', ({ detail }) => {
  document.querySelector('#requests [value=reset]').hidden = !detail.killed;
});
for (const one of document.querySelectorAll('#requests button')) {
  one.addEventListener('click', () => send(one.value, ['home', 'land'].includes(one.value) ? { name: null } : {}));
}

// The space bar is KILL wherever the focus is: sliders, lists and buttons would react to it themselves.
window.addEventListener('keydown', (event) => {
  if (event.code !== 'Space' || !event.isTrusted || event.ctrlKey || event.altKey || event.metaKey) return;
  event.preventDefault();
  event.stopImmediatePropagation();
  document.activeElement?.blur?.();
  if (!event.repeat) kill();
}, true);
// A focused button is pressed by the release of the space bar.
window.addEventListener('keyup', (event) => { if (event.code === 'Space') event.preventDefault(); }, true);
