/** The strip of time: plots of any signals of all vehicles, events, pause and scrub. */
import { make, offer, one, theme, write } from './dom.js';

const AXIS_PX = 52;

export class Strip {
  /** @param {() => void} onTime Called when another time is to be shown. */
  constructor(onTime) {
    this.onTime = onTime;
    this.plots = new Map();
    this.chosen = ['error_mm', 'z_m'];
    this.paused = false;
    this.section = one('#time');
    this.scrub = one('[name=scrub]', this.section);
    this.pause = one('[name=pause]', this.section);
    this.pause.addEventListener('click', () => this.setPaused(!this.paused));
    this.scrub.addEventListener('input', () => {
      this.setPaused(true);
      this.showTime();
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
    this.draw();
  }

  offerSignals() {
    const others = [...this.signals].filter(([name]) => !this.chosen.includes(name) && !name.startsWith('reference_'));
    offer(one('[name=signal]', this.section), others.map(([name, { label, unit }]) => [name, unit ? `${label} [${unit}]` : label]), 'a signal');
  }

  add(signal) {
    this.chosen.push(signal);
    this.build(signal);
    this.offerSignals();
    this.draw();
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
    const { label, unit } = this.signals.get(signal), colour = theme();
    const close = make('button', { type: 'button', textContent: '×', title: `Remove ${label}` });
    close.addEventListener('click', () => this.remove(signal));
    const box = make('div', { className: 'plot' }, make('h3', {}, unit ? `${label} [${unit}]` : label, close));
    one('#plots').append(box);
    const axis = { stroke: colour('quiet'), grid: { stroke: colour('grid'), width: 1 }, ticks: { stroke: colour('grid') }, font: '11px system-ui, sans-serif' };
    const plot = new uPlot({
      width: 280, height: 100, legend: { show: false }, cursor: { sync: { key: 'time' }, drag: { x: false, y: false } },
      scales: { x: { time: false } },
      axes: [{ ...axis, size: 26, values: (_, ticks) => ticks.map((tick) => `${tick} s`) }, { ...axis, size: AXIS_PX }],
      series: [{}, ...this.lines(signal).map(({ colour: stroke, signal: own }) => ({ stroke, width: 1.5, dash: own === signal ? undefined : [4, 4], points: { show: false } }))],
      hooks: { draw: [(drawn) => this.mark(drawn)] },
    }, [[]], box);
    this.plots.set(signal, { plot, box });
    this.resize();
  }

  /** Mark the shown time while paused. */
  mark(plot) {
    if (!this.paused) return;
    const x = Math.round(plot.valToPos(this.shownTime() - this.newest(), 'x', true)), { ctx, bbox } = plot;
    ctx.fillStyle = theme()('busy');
    ctx.fillRect(x, bbox.top, 2, bbox.height);
  }

  resize() {
    for (const { plot, box } of this.plots.values()) {
      const width = box.clientWidth, height = one('#plots').clientHeight - 20;
      if (width > 0 && height > 40) plot.setSize({ width, height });
    }
  }

  setPaused(paused) {
    this.paused = paused;
    this.pause.setAttribute('aria-pressed', paused);
    write(this.pause, paused ? 'Live' : 'Pause');
    this.rows = paused ? [...this.samples.rows] : null;
    if (paused) this.scrub.max = this.rows.length - 1;
    if (!paused) this.scrub.value = this.scrub.max;
    this.showTime();
  }

  newest() { return (this.rows ?? this.samples.rows).at(-1)?.[0] ?? 0; }

  shownTime() { return this.rows?.[Number(this.scrub.value)]?.[0] ?? this.newest(); }

  /** Row of the samples that is shown, null for the present. */
  shownRow() {
    if (!this.paused) return null;
    const shown = this.shownTime(), row = this.samples.rows.findIndex((one) => one[0] >= shown);
    return row < 0 ? null : row;
  }

  showTime() {
    const ago = this.newest() - this.shownTime();
    write(one('[name=ago]', this.section), this.paused ? `−${ago.toFixed(1)} s` : 'live');
    if (this.paused) for (const { plot } of this.plots.values()) plot.redraw(false);
    this.onTime();
  }

  /** Draw the newest samples, unless paused. */
  draw() {
    if (!this.samples || this.samples.rows.length < 2 || (this.paused && this.drawn)) return;
    this.drawn = true;
    const { times } = this.samples, newest = times.at(-1), before = times.map((time) => time - newest);
    if (!this.paused) this.scrub.max = this.scrub.value = times.length - 1;
    for (const [signal, { plot }] of this.plots) {
      plot.setData([before, ...this.lines(signal).map((line) => this.samples.column(line.name, line.signal))]);
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
