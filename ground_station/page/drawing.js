// Limits how often a browser draws, so that the panel reacts however slowly it draws. Runs once.
if (!window.rcopterx) {
  // A browser without a graphics card draws on the processor, and handles no key meanwhile. After every picture
  // it therefore pauses for several times the drawing time, and it draws coarse pictures.
  const graphics = document.createElement('canvas').getContext('webgl2');
  const named = graphics?.getExtension('WEBGL_debug_renderer_info');
  const renderer = named ? graphics.getParameter(named.UNMASKED_RENDERER_WEBGL) : '';
  graphics?.getExtension('WEBGL_lose_context')?.loseContext();
  const software = /swiftshader|llvmpipe|software/i.test(renderer);
  const LEAST_MS = software ? 150 : 30, REST = 4, SLOW_MS = 40, OFTEN = 8, COARSE = 0.5;
  const coarse = () => window.__viserTestpoints?.devSettings?.set({ fixedDpr: COARSE });
  window.rcopterx = { frames: 0, took_ms: 0, renderer };
  if (software) coarse();

  const draw = window.requestAnimationFrame.bind(window);
  const cancel = window.cancelAnimationFrame.bind(window);
  const waiting = new Map(), drawn = new MessageChannel();
  let number = 1e9, busy = false, restUntil = 0, began = 0, slow = 0;
  const schedule = () => {
    if (busy || waiting.size === 0) return;
    busy = true;
    setTimeout(() => draw(frame), Math.max(0, restUntil - performance.now()));
  };
  const frame = (time) => {
    began = performance.now();
    const callbacks = [...waiting.values()];
    waiting.clear();
    drawn.port2.postMessage(0);
    for (const callback of callbacks) {
      try { callback(time); } catch (error) { setTimeout(() => { throw error; }); }
    }
  };
  drawn.port1.onmessage = () => {
    const now = performance.now(), took = now - began;
    restUntil = now + Math.max(LEAST_MS - took, REST * took);
    slow = took > SLOW_MS ? slow + 1 : 0;
    if (slow === OFTEN) coarse();
    window.rcopterx.frames += 1;
    window.rcopterx.took_ms = took;
    busy = false;
    schedule();
  };
  // Drawing requests every frame with the same function; animations of the panel have new ones and do not wait.
  const known = new WeakSet();
  window.requestAnimationFrame = (callback) => {
    if (!known.has(callback)) {
      known.add(callback);
      return draw(callback);
    }
    waiting.set(++number, callback);
    schedule();
    return number;
  };
  window.cancelAnimationFrame = (id) => { if (!waiting.delete(id)) cancel(id); };
}
