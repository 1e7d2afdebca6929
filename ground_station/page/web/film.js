/** Recorded flights in the document: what their page received, at any of their times. */
import { make, offer, one } from './dom.js';
import { publish } from './link.js';
import { drawPlaces } from './places.js';
import { Samples } from './samples.js';

const block = one('#films');
let shown = null, textsAt = null;

/** Whether the document is a recording, and no fleet answers. */
export const isRecorded = () => block !== null;

const unpacked = (text) => {
  const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream('deflate'))).json();
};

/** Texts of a film as they were: each entry has only what has changed. */
const whole = (texts) => {
  let before = {};
  return texts.map(([step, changed]) => [step, before = { ...before, ...changed }]);
};

const open = (film) => {
  shown = { ...film, texts: whole(film.texts) };
  textsAt = null;
  const fleet = { ...film.fleet, recorded: true }, samples = new Samples(fleet);
  publish('fleet', fleet);
  publish('samples', film.samples);
  samples.add(film.samples);
  drawPlaces(one('#places'), fleet, samples, film.motion);
};

/** Begin to show the first film, when all listeners have been added. */
export const beginFilm = async () => {
  const films = await unpacked(block.textContent);
  if (films.length > 1) {
    const choice = make('select', { ariaLabel: 'flight' });
    offer(choice, films.map(({ name }, index) => [String(index), name]));
    choice.addEventListener('change', () => open(films[Number(choice.value)]));
    one('#recorded').append(' ', choice);
  }
  open(films[0]);
};

/** Motion at a step and a share of the way to the next one; publishes the texts of the step. */
export const showStep = (step, share) => {
  let low = 0, high = shown.texts.length - 1;
  while (low < high) {
    const middle = Math.ceil((low + high) / 2);
    if (shown.texts[middle][0] <= step) low = middle;
    else high = middle - 1;
  }
  if (low !== textsAt && shown.texts.length) {
    textsAt = low;
    publish('texts', shown.texts[low][1]);
  }
  const [now, next] = [shown.motion[step], shown.motion[step + 1]];
  return Object.fromEntries(Object.entries(now).map(([name, motion]) => {
    const to = next?.[name]?.place;
    const place = motion.place && to ? motion.place.map((value, axis) => value + share * (to[axis] - value)) : motion.place;
    return [name, { ...motion, place }];
  }));
};
