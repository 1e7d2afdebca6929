/** The connection to the process of the page: one WebSocket for the state, single requests for everything else. */

const AGAIN_MS = 500, SILENT_MS = 2000, PATIENCE_MS = 2000, CHECK_MS = 250;

/** Dispatches `fleet`, `motion`, `texts` and `samples` with their content as `detail`, and `connection`. */
export const link = new EventTarget();

let connected = true, heardAt = performance.now(), socket = null;

/** Whether the process of the page is reached. */
export const isConnected = () => connected;

/** Give parts of the page what has arrived. */
export const publish = (name, detail) => link.dispatchEvent(new CustomEvent(name, { detail }));

const setConnected = (now) => {
  if (now === connected) return;
  connected = now;
  publish('connection', now);
};

const open = () => {
  const own = socket = new WebSocket(`${location.href.replace(/^http/, 'ws').replace(/[?#].*/, '')}feed`);
  own.onmessage = ({ data }) => {
    heardAt = performance.now();
    const message = JSON.parse(data);
    setConnected(true);
    for (const part of ['fleet', 'samples', 'motion', 'texts']) {
      if (part in message) publish(part, message[part]);
    }
  };
  own.onclose = () => {
    if (own !== socket) return;
    setConnected(false);
    setTimeout(open, AGAIN_MS);
  };
};

/** Begin to receive, when all listeners have been added. */
export const begin = () => {
  open();
  setInterval(() => {
    if (connected && performance.now() - heardAt > SILENT_MS) setConnected(false);
  }, CHECK_MS);
};

/**
 * Send a request; answers of the fleet arrive as notices.
 * @param {string} what Name of a method of `PageSteering`.
 * @param {object} values Its arguments by name.
 * @returns {Promise<void>} Settled when the process of the page has it; rejected with the reason if it refuses.
 */
export const request = async (what, values = {}) => {
  const answer = await fetch(`do?${encodeURIComponent(JSON.stringify({ do: what, arguments: values }))}`, {
    cache: 'no-store', headers: { 'X-Rcopterx': 'page' }, signal: AbortSignal.timeout(PATIENCE_MS),
  });
  if (!answer.ok) throw new Error((await answer.text()).trim());
};

/** Send a request from a control; what the process of the page rejects is shown like a refusal of the fleet. */
export const send = (what, values) => request(what, values).catch(({ message }) => publish('rejected', message));
