/** The strip of time: plots of any signals of all vehicles, events, pause and scrub; a recording is played. */
import { make, offer, one, theme, write } from './dom.js';
import { newPlot } from './plots.js';

export class Strip {
  /** @param {() => void} onTime Called when another time is to be shown. */
  constructor(onTime) {
    this.onTime = onTime;
    this.plots = new Map();
    this.chosen = ['error_mm', 'z_m'];
    this.paused = this.playing = false;
    this.section = one('#time');
    this.scrub = one('[name=scrub]', this.section);
    this.pause = one('[name=pause]', this.section);
    this.speed = one('[name=speed]', this.section);
    this.pause.addEventListener('click', () => (this.recorded ? this.setPlaying(!this.playing) : this.setPaused(!this.paused)));
    this.scrub.addEventListener('input', () => {
      if (!this.paused) this.setPaused(true, Number(this.scrub.value));
      this.show(this.rows[Number(this.scrub.value)][0]);
    });
    one('[name=signal]', this.section).addEventListener('change', ({ target }) => {
      if (target.value) this.add(target.value);
      target.value = '';
    });
    matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => this.rebuild());
    new ResizeObserver(() => this.resize()).observe(one('#plots'));
  }

  setFleet(fleet, samples) {
    this.fleet = fleet;
    this.samples = samples;
    this.signals = new Map(fleet.signals.map(([name, label, unit]) => [name, { label, unit }]));
    this.recorded = Boolean(fleet.recorded);
    this.speed.hidden = !this.recorded;
    this.setPlaying(false);
    this.setPaused(false);
    this.rebuild();
  }

  rebuild() {
    if (!this.fleet) return;
    for (const { plot } of this.plots.values()) plot.destroy();
    this.plots.clear();
    one('#plots').replaceChildren();
    for (const signal of this.chosen) this.build(signal);
    this.offerSignals();
    this.draw(true);
  }

  offerSignals() {
    const others = [...this.signals].filter(([name]) => !this.chosen.includes(name) && !name.startsWith('reference_'));
    offer(one('[name=signal]', this.section), others.map(([name, { label, unit }]) => [name, unit ? `${label} [${unit}]` : label]), 'a signal');
  }

  add(signal) {
    this.chosen.push(signal);
    this.build(signal);
    this.offerSignals();
    this.draw(true);
  }

  remove(signal) {
    this.chosen = this.chosen.filter((name) => name !== signal);
    this.plots.get(signal).plot.destroy();
    this.plots.get(signal).box.remove();
    this.plots.delete(signal);
    this.offerSignals();
    this.resize();
  }

  /** Signals of a plot: the chosen one, and its reference where there is one. */
  lines(signal) {
    const both = [signal, `reference_${signal}`].filter((name) => this.signals.has(name));
    return this.fleet.vehicles.flatMap(({ name, colour }) => both.map((own) => ({ name, colour, signal: own })));
  }

  build(signal) {
    const { label, unit } = this.signals.get(signal);
    const close = make('button', { type: 'button', textContent: '×', title: `Remove ${label}` });
    close.addEventListener('click', () => this.remove(signal));
    const box = make('div', { className: 'plot' }, make('h3', {}, unit ? `${label} [${unit}]` : label, close));
    one('#plots').append(box);
    const lines = this.lines(signal).map(({ colour, signal: own }) => ({ stroke: colour, dash: own === signal ? undefined : [4, 4] }));
    const plot = newPlot(box, lines, { draw: [(drawn) => this.mark(drawn)] });
    plot.over.addEventListener('click', () => {
      if (!this.paused) this.setPaused(true);
      this.show(this.origin() + plot.posToVal(plot.cursor.left, 'x'));
    });
    this.plots.set(signal, { plot, box });
    this.resize();
  }

  /** Mark the shown time while paused. */
  mark(plot) {
    if (!this.paused) return;
    const x = Math.round(plot.valToPos(this.at - this.origin(), 'x', true)), { ctx, bbox } = plot;
    ctx.fillStyle = theme()('busy');
    ctx.fillRect(x, bbox.top, 2, bbox.height);
  }

  resize() {
    for (const { plot, box } of this.plots.values()) {
      const width = box.clientWidth, height = one('#plots').clientHeight - 20;
      if (width > 0 && height > 40) plot.setSize({ width, height });
    }
  }

  /** Show row `row` of the present samples, or go on with the newest. */
  setPaused(paused, row = this.samples.rows.length - 1) {
    this.paused = paused;
    this.rows = paused ? [...this.samples.rows] : null;
    this.markedRow = null;
    if (!this.recorded) {
      this.pause.setAttribute('aria-pressed', paused);
      write(this.pause, paused ? 'Live' : 'Pause');
    }
    if (!paused) this.scrub.value = this.scrub.max;
    if (this.recorded && paused) this.draw(true);
    if (paused) this.scrub.max = this.rows.length - 1;
    this.show(paused ? this.rows[row]?.[0] ?? 0 : 0);
  }

  /** Play a recording, or stop; from its beginning if it has ended. */
  setPlaying(playing) {
    if (playing && this.at >= this.rows.at(-1)[0]) this.show(this.rows[0][0]);
    this.playing = playing;
    if (this.recorded) {
      this.pause.setAttribute('aria-pressed', playing);
      write(this.pause, playing ? 'Pause' : 'Play');
    }
  }

  /** Go on playing at a time of the browser [ms]. */
  play(now) {
    const passed = (now - (this.playedAt ?? now)) / 1000 * Number(this.speed.value);
    this.playedAt = now;
    if (!this.playing) return;
    this.show(this.at + passed);
    if (this.at >= this.rows.at(-1)[0]) this.setPlaying(false);
  }

  /** Show a time [s] of the rows. */
  show(time) {
    if (this.paused && this.rows.length) {
      this.at = Math.min(Math.max(time, this.rows[0][0]), this.rows.at(-1)[0]);
      const row = this.rowAt(this.rows, this.at);
      if (this.markedRow !== row) for (const { plot } of this.plots.values()) plot.redraw(false);
      this.scrub.value = this.markedRow = row;
    }
    const age = this.paused && this.rows.length ? this.at - this.origin() : 0;
    write(one('[name=ago]', this.section), !this.paused ? 'live' : `${age.toFixed(1).replace('-', '−')} s`);
    this.onTime();
  }

  /** Last row that is not later than a time [s]. */
  rowAt(rows, time) {
    let low = 0, high = rows.length - 1;
    while (low < high) {
      const middle = Math.ceil((low + high) / 2);
      if (rows[middle][0] <= time) low = middle;
      else high = middle - 1;
    }
    return low;
  }

  /** Time [s] from which plots count: the newest of a running fleet, the first of a recording. */
  origin() {
    const rows = this.rows ?? this.samples.rows;
    return rows.at(this.recorded ? 0 : -1)?.[0] ?? 0;
  }

  /** Row of the samples that is shown, null for the present. */
  shownRow() { return this.paused && this.rows.length ? this.rowAt(this.samples.rows, this.at) : null; }

  /** How much of the time between a row and the next one has passed. */
  shareOfRow(row) {
    const [from, to] = [this.samples.rows[row][0], this.samples.rows[row + 1]?.[0]];
    return to === undefined ? 0 : Math.min(1, (this.at - from) / (to - from));
  }

  /** Draw the newest samples; only if `anew` while paused. */
  draw(anew = false) {
    const rows = this.rows ?? this.samples?.rows;
    if (!rows || rows.length < 2 || (this.paused && !anew)) return;
    const origin = this.origin(), times = rows.map((row) => row[0] - origin);
    if (!this.paused) this.scrub.max = this.scrub.value = rows.length - 1;
    for (const [signal, { plot }] of this.plots) {
      plot.setData([times, ...this.lines(signal).map((line) => this.samples.column(line.name, line.signal, rows))]);
    }
  }

  /** Show the events with their age, newest first. */
  showEvents(events, now) {
    const list = one('#events'), lines = events.length ? events : [[now, '', 'nothing has happened yet', false]];
    while (list.children.length > lines.length) list.lastChild.remove();
    lines.forEach(([time, vehicle, words, alarming], index) => {
      const row = list.children[index] ?? list.appendChild(make('li', {}, make('span'), make('span'), make('b')));
      const age = now - time;
      write(row.children[0], !vehicle ? '' : age < 120 ? `${age.toFixed(0)} s` : `${(age / 60).toFixed(0)} min`);
      write(row.children[1], vehicle);
      write(row.children[2], words);
      row.className = alarming ? 'alarming' : '';
    });
  }
}
