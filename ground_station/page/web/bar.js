/** The bar: state of the fleet in one sentence, flight time, flight log; answers to requests. */
import { make, one, write } from './dom.js';
import { isRecorded } from './film.js';
import { isConnected, link } from './link.js';

const NOTICE_MS = 6000, RECENT_S = 6;
const bar = one('#bar'), sentence = one('#sentence'), notices = one('#notices');
let newest = null, shown = { text: sentence.textContent, level: bar.className };

const clock = (seconds) => `${Math.floor(seconds / 60)}:${String(Math.floor(seconds % 60)).padStart(2, '0')}`;

const show = () => {
  const connected = isConnected();
  write(sentence, connected ? shown.text : 'The page is not connected: what it shows is old');
  bar.className = connected ? shown.level : 'off';
  document.body.classList.toggle('old', !connected);
  if (!isRecorded()) document.title = `${connected ? shown.text : 'not connected'} · rcopterx`;
};

const notify = ({ text, refused }) => {
  const element = make('div', { className: refused ? 'notice refused' : 'notice', textContent: refused ? `Refused: ${text}` : text });
  notices.append(element);
  setTimeout(() => element.remove(), NOTICE_MS);
};

link.addEventListener('connection', show);
link.addEventListener('rejected', ({ detail }) => notify({ text: detail, refused: true }));
link.addEventListener('fleet', ({ detail }) => {
  write(one('#fleet'), detail.name);
  newest = null; // another process of the page, or another fleet, counts its answers anew
});
link.addEventListener('texts', ({ detail: texts }) => {
  shown = texts.sentence;
  show();
  write(one('#flown'), typeof texts.took_off_s !== 'number' ? '–' : clock(texts.time_s - texts.took_off_s));
  if (!isRecorded()) write(one('#recording'), texts.recording ? `● ${texts.recording}` : '–');
  for (const notice of texts.notices ?? []) {
    if (newest === null ? texts.time_s - notice.time_s < RECENT_S : notice.number > newest) notify(notice);
  }
  newest = Math.max(newest ?? 0, ...(texts.notices ?? []).map((notice) => notice.number));
});
