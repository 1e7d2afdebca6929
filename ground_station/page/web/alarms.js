/** Alarms and what prevents take-off: above the scene, so that nothing moves when they come and go. */
import { make, one } from './dom.js';

let drawn = '';

/** Show alarms, present ones first. */
export const showAlarms = (alarms) => {
  const wanted = JSON.stringify(alarms);
  if (wanted === drawn) return;
  drawn = wanted;
  one('#alarms').replaceChildren(...alarms.map(({ vehicles, text, remedy, level, count, over }) => {
    const who = vehicles.length ? `${vehicles.join(', ')}: ` : '', often = count > 1 ? `, ${count} times` : '';
    const line = make('div', { className: `alarm ${level}${over ? ' over' : ''}` }, make('b', { textContent: `${who}${text}${often}` }));
    if (over) line.append(make('span', { textContent: ' · over' }));
    else if (remedy) line.append(make('span', { textContent: ` · ${remedy}` }));
    return line;
  }));
};

/** Show lines in a list that is hidden while it is empty. */
export const showLines = (section, lines) => {
  section.hidden = lines.length === 0;
  const list = one('ul', section);
  if (list.dataset.drawn === lines.join('\n')) return;
  list.dataset.drawn = lines.join('\n');
  list.replaceChildren(...lines.map((text) => make('li', { textContent: text })));
};
