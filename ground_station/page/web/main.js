/** Assembles the page: what arrives goes to its parts, and what is selected belongs to this browser. */
import './bar.js';
import { showAlarms, showLines } from './alarms.js';
import { one } from './dom.js';
import { beginFilm, isRecorded, showStep } from './film.js';
import { Handles } from './handles.js';
import { begin, link } from './link.js';
import { Rows } from './rows.js';
import { Samples } from './samples.js';
import { Scene } from './scene.js';
import { Selected } from './selected.js';
import { Strip } from './strip.js';
import { Tools } from './tools.js';

const STRIP_MS = 250, LEAST_MS = 30;
const stage = one('#stage');
const scene = new Scene(one('canvas', stage), (at) => {
  if (tools.click(at)) return;
  const name = scene.vehicleAt(at);
  if (name) select(name);
});
const tools = new Tools(scene), handles = new Handles(one('#handles'), scene);
const rows = new Rows((name) => select(name === selected.name ? null : name)), selected = new Selected();
const strip = new Strip(() => showMotion());
let fleet = null, samples = null, live = {}, texts = null, stripAt = 0, drawnAt = 0;

/** What can be measured: pictures drawn, and when vehicles were drawn first [ms]. */
window.rcopterx = { pictures: 0, firstVehicle: null };

const select = (name) => {
  selected.select(name);
  rows.select(name);
  handles.select(name);
  if (texts) selected.show(texts.rows ?? {}, texts.powers ?? {});
};

/** Motion of a past row: places and headings only. */
const past = (row) => Object.fromEntries(fleet.vehicles.map(({ name }) => {
  const place = samples.place(name, row), heading = samples.rows[row][1 + samples.names.indexOf(name)][samples.at.get('heading_deg')];
  const half = (heading ?? 0) * Math.PI / 360;
  return [name, place ? { place, attitude: [0, 0, Math.sin(half), Math.cos(half)] } : {}];
}));

const showMotion = () => {
  if (!fleet) return;
  const row = strip.shownRow();
  if (row === null) scene.motion = live;
  else scene.motion = isRecorded() ? showStep(row, strip.shareOfRow(row)) : past(row);
  scene.dirty = true;
};

link.addEventListener('fleet', ({ detail }) => {
  fleet = detail;
  samples = new Samples(fleet);
  scene.setFleet(fleet, samples);
  for (const part of [handles, selected, tools]) part.setFleet(fleet);
  for (const part of [rows, strip]) part.setFleet(fleet, samples);
  select(null);
  const suggestion = one('#suggestion');
  if (suggestion) suggestion.textContent = fleet.suggestion;
});
link.addEventListener('samples', ({ detail }) => {
  samples?.add(detail);
  if (isRecorded()) strip.setPaused(true, samples.firstSeen());
});
link.addEventListener('motion', ({ detail }) => {
  live = detail;
  if (!strip.paused) showMotion();
});
link.addEventListener('texts', ({ detail }) => {
  texts = detail;
  scene.setZones(texts.zones ?? {});
  tools.showZones(texts.zones ?? {});
  if (texts.down) live = {};
  if (texts.down && !strip.paused) showMotion();
  for (const [name, row] of Object.entries(texts.rows ?? {})) {
    const alarming = row.chip.level === 'red';
    scene.labels[name] = { text: alarming ? `${name} · ${row.chip.text}` : name, alarming };
  }
  rows.show(texts.rows ?? {});
  selected.show(texts.rows ?? {}, texts.powers ?? {});
  showAlarms(texts.alarms ?? []);
  showLines(one('#problems'), texts.problems ?? []);
  showLines(one('#notes'), texts.notes ?? []);
  if (!strip.paused || isRecorded()) strip.showEvents(texts.events ?? [], texts.time_s);
});

/** Draw what has changed, at most some thirty times a second. */
const draw = (now) => {
  requestAnimationFrame(draw);
  strip.play(now);
  if (!samples || now - drawnAt < LEAST_MS) return;
  drawnAt = now;
  const row = strip.shownRow();
  if (scene.draw(row === null ? undefined : row + 1)) {
    window.rcopterx.pictures += 1;
    handles.draw(row === null && !tools.drawing);
    if (window.rcopterx.firstVehicle === null && Object.values(scene.motion).some(({ place }) => place)) {
      window.rcopterx.firstVehicle = performance.now();
      document.documentElement.dataset.drawn = 'yes';
    }
  }
  if (now - stripAt > STRIP_MS) {
    stripAt = now;
    strip.draw();
    rows.drawSparks(isRecorded() && row !== null ? row + 1 : undefined);
  }
};

for (const button of document.querySelectorAll('#views button')) button.addEventListener('click', () => scene.look(button.value));
for (const box of document.querySelectorAll('#views input')) {
  box.addEventListener('change', () => {
    scene.options[box.name] = box.checked;
    scene.dirty = true;
  });
}
one('#show').addEventListener('click', ({ target }) => {
  target.textContent = stage.classList.toggle('shown') ? 'Hide the scene' : 'Show the scene';
  scene.dirty = true;
});
const VIEW_KEYS = { 0: 'home', t: 'top', s: 'side' };
window.addEventListener('keydown', (event) => {
  if (event.target.matches('input, select') || event.ctrlKey || event.altKey || event.metaKey) return;
  if (VIEW_KEYS[event.key]) scene.look(VIEW_KEYS[event.key]);
  else if (fleet?.vehicles[Number(event.key) - 1]) select(fleet.vehicles[Number(event.key) - 1].name);
});
(isRecorded() ? beginFilm : begin)();
requestAnimationFrame(draw);
