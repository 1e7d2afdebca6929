// State, KILL, take-off and landing: they need neither viser's connection nor its scene, which is the frame below.
const AGAIN_MS = 100, EVERY_MS = 500, PATIENCE_MS = 2000, TRIED_MS = 10000;
const state = document.getElementById('state'), view = document.querySelector('iframe');
const button = document.getElementById('kill'), LABEL = button?.textContent;
let shown = '', connected = true, gone = false, pending = false, gaveUp = false, pressedAt = -Infinity;

// The other name of this computer: browsers then draw the scene in a process that cannot delay KILL.
const other = location.hostname === 'localhost' ? '127.0.0.1' : 'localhost';
const showView = () => {
  // A frame that loads loses keys: it gets no focus until its space bar is KILL.
  view.inert = button !== null;
  view.src = `http://${other}:${location.port}${location.pathname}view/`;
};

const asked = async (what) => {
  const answer = await fetch(what, {
    cache: 'no-store', headers: { 'X-Rcopterx': 'page' }, signal: AbortSignal.timeout(PATIENCE_MS),
  });
  if (!answer.ok) throw new Error(await answer.text());
  return answer.text();
};
const show = () => {
  state.className = connected ? '' : 'old';
  if (!button) return;
  button.textContent = pending ? 'KILL waits: the page is not connected'
    : gaveUp ? 'KILL was NOT sent: the page is not connected'
    : connected ? LABEL : 'Not connected: KILL does not reach the fleet';
  button.className = pending || gaveUp ? 'waiting' : connected ? '' : 'disconnected';
};
const follow = async () => {
  try {
    const text = await asked('state');
    // viser connects again only where it has the focus.
    if (gone) showView();
    [connected, gone, gaveUp] = [true, false, false];
    if (shown !== text) state.innerHTML = shown = text;
  } catch (error) {
    connected = false;
    gone ||= error instanceof TypeError;
  }
  show();
  setTimeout(follow, EVERY_MS);
};
const kill = async () => {
  pressedAt = performance.now();
  gaveUp = false;
  try {
    await asked('kill');
  } catch {
    if (!pending) await keepTrying();
  }
  show();
};
const keepTrying = async () => {
  pending = true;
  while (pending) {
    show();
    await new Promise((resolve) => setTimeout(resolve, AGAIN_MS));
    try {
      await asked('kill');
      pending = false;
    } catch {
      gaveUp = performance.now() - pressedAt > TRIED_MS;
      pending = !gaveUp;
    }
  }
};
button?.addEventListener('click', kill);
for (const one of document.querySelectorAll('#requests button')) {
  one.addEventListener('click', () => asked(one.value).catch(() => {}));
}
window.addEventListener('message', (event) => {
  if (event.data === 'ready' && event.source === view.contentWindow) view.inert = false;
  if (button && event.data === 'space' && [window, view.contentWindow].includes(event.source)) kill();
});
follow();
// The header is painted first.
requestAnimationFrame(() => setTimeout(showView));
