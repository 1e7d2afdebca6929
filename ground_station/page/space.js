// The space bar is KILL wherever the focus is, in the page and in the frame of its scene. Runs once in each.
if (!window.rcopterxSpace) {
  window.rcopterxSpace = true;
  window.addEventListener('keydown', (event) => {
    if (event.code !== 'Space' || !event.isTrusted || event.ctrlKey || event.altKey || event.metaKey) return;
    // Sliders, lists and buttons react to the space bar themselves.
    event.preventDefault();
    event.stopImmediatePropagation();
    document.activeElement?.blur?.();
    if (!event.repeat) parent.postMessage('space', '*');
  }, true);
  // A focused button is pressed by the release of the space bar.
  window.addEventListener('keyup', (event) => { if (event.code === 'Space') event.preventDefault(); }, true);
  parent.postMessage('ready', '*');
}
