/** One row per vehicle with the same columns: comparable at a glance. */
import { make, one, theme, write } from './dom.js';

const SPARK_S = 30, FULL_MM = 100;

export class Rows {
  /** @param {(name: string) => void} onSelect */
  constructor(onSelect) {
    this.body = one('#rows tbody');
    this.onSelect = onSelect;
    this.rows = new Map();
  }

  setFleet(fleet, samples) {
    this.samples = samples;
    this.rows.clear();
    this.body.replaceChildren(...fleet.vehicles.map((vehicle) => this.make(vehicle)));
  }

  make({ name, colour }) {
    const dot = make('span', { className: 'dot' });
    dot.style.background = colour;
    const cells = {
      chip: make('span', { className: 'chip off' }), leader: make('span'), number: make('span', { className: 'number' }),
      spark: make('canvas', { width: 116, height: 44 }), battery: make('span', { className: 'text' }), radio: make('span', { className: 'text' }),
    };
    const row = make('tr', { tabIndex: 0 }, ...[
      [dot], [make('span', { className: 'name', textContent: name })], [cells.chip], [cells.leader],
      [cells.spark, cells.number], [cells.battery], [cells.radio],
    ].map((content) => make('td', {}, ...content)));
    row.dataset.vehicle = name;
    const select = () => this.onSelect(name);
    row.addEventListener('click', select);
    row.addEventListener('keydown', (event) => { if (event.key === 'Enter') select(); });
    this.rows.set(name, { row, colour, ...cells });
    return row;
  }

  /** Mark a vehicle as selected. */
  select(name) {
    for (const [own, { row }] of this.rows) row.setAttribute('aria-selected', own === name);
  }

  /** Show the present state of all vehicles; `rows` is empty while the fleet is down. */
  show(rows) {
    for (const [name, cells] of this.rows) {
      const shown = rows[name] ?? { chip: { text: 'down', level: 'off' }, battery: { text: '', level: 'off' }, radio: { text: '', level: 'off' }, following: '', error_mm: null, silent: true };
      write(cells.chip, shown.chip.text, `chip ${shown.chip.level}`);
      write(cells.leader, shown.following || '–');
      write(cells.number, shown.error_mm === null ? '' : `${Math.round(shown.error_mm)} mm`);
      write(cells.battery, shown.battery.text || '–', `text ${shown.battery.level}`);
      write(cells.radio, shown.radio.text, `text ${shown.radio.level}`);
      cells.radio.title = shown.radio.text;
      cells.row.classList.toggle('silent', shown.silent);
    }
  }

  /** Draw the error of the last half minute before row `end` of the samples. */
  drawSparks(end) {
    const colour = theme()('line');
    for (const [name, { spark, colour: own }] of this.rows) {
      const values = this.samples.recent(name, 'error_mm', SPARK_S, end), context = spark.getContext('2d');
      const { width, height } = spark, count = SPARK_S * 10;
      const highest = Math.max(FULL_MM, ...values);
      context.clearRect(0, 0, width, height);
      context.fillStyle = colour;
      context.fillRect(0, height - 1, width, 1);
      context.beginPath();
      let pen = false;
      values.forEach((value, index) => {
        if (value === null) { pen = false; return; }
        const x = width * (1 - (values.length - index) / count), y = height - 2 - (height - 4) * value / highest;
        if (pen) context.lineTo(x, y);
        else context.moveTo(x, y);
        pen = true;
      });
      context.strokeStyle = own;
      context.lineWidth = 2;
      context.stroke();
    }
  }
}
