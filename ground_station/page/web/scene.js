/** The scene: floor, volume, vehicles, plans, trails, references, links, waypoints. */
import { theme } from './dom.js';
import { Painter } from './painter.js';
import { shapeOf } from './shapes.js';

const TRAIL_S = 5, CELL_M = 0.2, SECTION_M = 1, DEVIATIONS = 2, ENLARGED = 100, CLICK_PX = 5;
const VIEWS = { home: [-2.5, 0.42], top: [-Math.PI / 2, Math.PI / 2 - 1e-3], side: [-Math.PI / 2, 0.02] };

export class Scene {
  /**
   * @param {HTMLCanvasElement} canvas
   * @param {(event: {x: number, y: number}) => void} onClick Receives clicks that are no drags.
   */
  constructor(canvas, onClick) {
    this.painter = new Painter(canvas);
    this.camera = this.painter.camera;
    this.onClick = onClick;
    this.options = { wind: false, uncertainty: false };
    this.motion = {};
    this.labels = {};
    this.waypoints = [];
    this.zones = {};
    this.corner = null; // first one of a zone that is drawn
    this.ghosts = {};
    this.dirty = this.untouched = true;
    this.view = 'home';
    this.readTheme();
    matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => this.readTheme());
    new ResizeObserver(() => { this.dirty = true; }).observe(canvas);
    this.listen(canvas);
  }

  readTheme() {
    const colour = theme();
    this.colours = Object.fromEntries(['back', 'floor', 'grid', 'edge', 'ink', 'quiet', 'red', 'card'].map((name) => [name, colour(name)]));
    this.dirty = true;
  }

  /** Show another fleet. */
  setFleet(fleet, samples) {
    this.fleet = fleet;
    this.samples = samples;
    this.look(this.view);
  }

  /** Show keep-out zones by name. */
  setZones(zones) {
    if (JSON.stringify(zones) === JSON.stringify(this.zones)) return;
    this.zones = zones;
    this.dirty = true;
  }

  /** Show the whole volume from a side by name. */
  look(view) {
    this.view = view;
    this.untouched = true;
    if (this.fleet) this.camera.fit(this.fleet.volume_m, ...VIEWS[view]);
    this.dirty = true;
  }

  listen(canvas) {
    const fingers = new Map();
    let moved = 0;
    canvas.addEventListener('pointerdown', (event) => {
      canvas.setPointerCapture(event.pointerId);
      if (fingers.size === 0) moved = 0;
      fingers.set(event.pointerId, [event.clientX, event.clientY]);
    });
    canvas.addEventListener('pointermove', (event) => {
      const before = fingers.get(event.pointerId);
      if (!before) return;
      const [dx, dy] = [event.clientX - before[0], event.clientY - before[1]];
      const spread = () => {
        const [a, b] = [...fingers.values()];
        return Math.hypot(a[0] - b[0], a[1] - b[1]);
      };
      const apart = fingers.size === 2 ? spread() : 0;
      fingers.set(event.pointerId, [event.clientX, event.clientY]);
      moved += Math.hypot(dx, dy);
      if (moved < CLICK_PX) return;
      this.untouched = false;
      if (fingers.size === 2) {
        this.camera.zoom(apart / Math.max(1, spread()));
        this.camera.pan(dx / 2, dy / 2);
      } else if (event.buttons & 2 || event.shiftKey) this.camera.pan(dx, dy);
      else this.camera.orbit(dx, dy);
      this.dirty = true;
    });
    const end = (event) => {
      if (fingers.delete(event.pointerId) && moved < CLICK_PX && event.type === 'pointerup') {
        this.onClick({ x: event.offsetX, y: event.offsetY });
      }
    };
    canvas.addEventListener('pointerup', end);
    canvas.addEventListener('pointercancel', end);
    canvas.addEventListener('contextmenu', (event) => event.preventDefault());
    canvas.addEventListener('wheel', (event) => {
      event.preventDefault();
      this.untouched = false;
      this.camera.zoom(Math.exp(Math.max(-60, Math.min(60, event.deltaY)) * 0.004));
      this.dirty = true;
    }, { passive: false });
  }

  /** Vehicle that is drawn at a pixel; undefined if there is none. */
  vehicleAt({ x, y }) {
    const near = this.fleet.vehicles.map(({ name }) => {
      const place = this.motion[name]?.place, at = place && this.camera.project(place);
      return [name, at ? Math.hypot(at[0] - x, at[1] - y) : Infinity];
    });
    return near.filter(([, pixels]) => pixels < 30).sort((a, b) => a[1] - b[1])[0]?.[0];
  }

  /** Draw if something has changed; whether it has. */
  draw(end) {
    const { painter } = this;
    if (painter.resize() && this.untouched && this.fleet) this.camera.fit(this.fleet.volume_m, ...VIEWS[this.view]);
    if (!this.dirty || !this.fleet || this.camera.width === 0) return false;
    this.dirty = false;
    painter.clear();
    this.drawRoom();
    this.drawZones();
    const shown = this.fleet.vehicles.filter(({ name }) => this.motion[name]?.place);
    for (const vehicle of shown) this.drawGround(vehicle);
    this.drawLinks(shown);
    for (const vehicle of shown) this.drawLines(vehicle, end);
    const depth = ({ name }) => this.camera.view(this.motion[name].place)[2];
    for (const vehicle of [...shown].sort((a, b) => depth(b) - depth(a))) this.drawVehicle(vehicle);
    for (const vehicle of shown) this.drawLabel(vehicle);
    this.drawSubjects();
    this.drawWaypoints();
    return true;
  }

  drawRoom() {
    const { painter, colours } = this, [low, high] = this.fleet.volume_m, z = 0;
    const across = (axis, step) => {
      const lines = [];
      for (let at = Math.ceil(low[axis] / step - 1e-6) * step; at <= high[axis] + 1e-6; at += step) {
        lines.push(axis === 0 ? [[at, low[1], z], [at, high[1], z]] : [[low[0], at, z], [high[0], at, z]]);
      }
      return lines;
    };
    painter.polygon([[low[0], low[1], z], [high[0], low[1], z], [high[0], high[1], z], [low[0], high[1], z]], colours.floor);
    painter.segments([...across(0, CELL_M), ...across(1, CELL_M)], colours.grid, 1);
    painter.segments([...across(0, SECTION_M), ...across(1, SECTION_M)], colours.edge, 1);
    const corner = (i) => [0, 1, 2].map((axis) => (i >> axis & 1 ? high : low)[axis]);
    const edges = [1, 2, 4].flatMap((bit) => [...Array(8).keys()].filter((i) => !(i & bit)).map((i) => [corner(i), corner(i | bit)]));
    painter.segments(edges, colours.edge, 1);
    painter.segments([[[0, 0, z], [0.4, 0, z]]], '#d62728', 2.5);
    painter.segments([[[0, 0, z], [0, 0.4, z]]], '#2ca02c', 2.5);
    painter.text([0.47, 0, z], 'x', '#d62728', colours.floor);
    painter.text([0, 0.47, z], 'y', '#2ca02c', colours.floor);
    for (const axis of [0, 1]) {
      const side = axis === 0 ? (this.camera.eye[1] < 0 ? low[1] - 0.1 : high[1] + 0.1) : (this.camera.eye[0] < 0 ? low[0] - 0.1 : high[0] + 0.1);
      for (let at = Math.ceil(low[axis]); at <= high[axis]; at += 1) {
        painter.text(axis === 0 ? [at, side, z] : [side, at, z], `${at} m`, colours.quiet, colours.back, { font: '11px system-ui, sans-serif' });
      }
    }
  }

  /** Keep-out zones without their margins: floor, walls, top and name. */
  drawZones() {
    const { painter, colours } = this;
    for (const [name, { min_m: low, max_m: high, shape }] of Object.entries(this.zones)) {
      const [corners, reach] = shape === 'cylinder' ? [24, 0.5] : [4, Math.SQRT1_2];
      const ring = [...Array(corners).keys()].map((i) => (2 * i + 1) * Math.PI / corners).map((angle) => (
        [Math.cos(angle), Math.sin(angle)].map((share, axis) => (low[axis] + high[axis]) / 2 + share * reach * (high[axis] - low[axis]))));
      const [bottom, top] = [low[2], high[2]].map((z) => ring.map(([x, y]) => [x, y, z]));
      const walls = bottom.map((_, i) => [bottom[i], bottom[(i + 1) % corners], top[(i + 1) % corners], top[i]]);
      painter.context.globalAlpha = 0.12;
      for (const side of [bottom, ...walls, top]) painter.polygon(side, colours.red);
      painter.context.globalAlpha = 0.6;
      const upright = shape === 'cylinder' ? [] : walls;
      painter.segments([...walls.flatMap(([a, b, c, d]) => [[a, b], [c, d]]), ...upright.map(([a, , , d]) => [a, d])], colours.red, 1);
      painter.context.globalAlpha = 1;
      painter.text([...[0, 1].map((axis) => (low[axis] + high[axis]) / 2), high[2]], name, colours.red, colours.back);
    }
    if (this.corner) painter.ball(this.corner, 0.03, colours.red, { ring: 2, least: 5 });
  }

  /** Shadow on the floor and the height above it. */
  drawGround({ name, colour }) {
    const [x, y, z] = this.motion[name].place;
    const shadow = [...Array(16).keys()].map((i) => [x + 0.09 * Math.cos(i * Math.PI / 8), y + 0.09 * Math.sin(i * Math.PI / 8), 0]);
    this.painter.context.globalAlpha = 0.18;
    this.painter.polygon(shadow, this.colours.ink);
    this.painter.context.globalAlpha = 0.5;
    this.painter.segments([[[x, y, 0], [x, y, z]]], colour, 1, [2, 4]);
    this.painter.context.globalAlpha = 1;
  }

  drawLinks(shown) {
    const pairs = shown.flatMap(({ name }) => (this.motion[name].following ?? [])
      .filter((leader) => this.motion[leader]?.place)
      .map((leader) => [this.motion[name].place, this.motion[leader].place]));
    this.painter.segments(pairs, this.colours.quiet, 1.5, [7, 6]);
  }

  drawLines({ name, colour }, end) {
    const { painter } = this, { place, plan, reference, wind_m_s2: wind, deviation_m: deviation } = this.motion[name];
    painter.context.globalAlpha = 0.55;
    painter.line([...this.samples.trail(name, TRAIL_S, end), place], this.colours.quiet, 1.5);
    painter.context.globalAlpha = 1;
    if (plan) {
      painter.line(plan, colour, 4);
      painter.ball(plan[plan.length - 1], 0.02, colour);
    }
    if (reference) painter.ball(reference, 0.035, colour, { ring: 2, least: 4 });
    const ghost = this.ghosts[name];
    if (ghost) {
      painter.line([place, ghost], colour, 1.5, [3, 5]);
      painter.segments([[ghost, [ghost[0], ghost[1], 0]]], colour, 1, [2, 4]);
    }
    if (this.options.wind && wind) {
      const tip = [place[0] + wind[0], place[1] + wind[1], place[2]];
      painter.segments([[place, tip]], this.colours.ink, 2.5);
      painter.ball(tip, 0.02, this.colours.ink);
    }
    if (this.options.uncertainty && deviation) {
      painter.context.globalAlpha = 0.25;
      painter.ball(place, ENLARGED * DEVIATIONS * Math.max(...deviation), colour);
      painter.context.globalAlpha = 1;
    }
  }

  drawVehicle({ name, colour, airframe }) {
    const { place, attitude } = this.motion[name];
    this.painter.body(shapeOf(airframe), place, attitude ?? [0, 0, 0, 1], colour, this.colours.ink);
  }

  /** Tracked subjects that are no vehicles, as a wand: a ball, its height, where it is expected, its name. */
  drawSubjects() {
    const { painter, colours } = this;
    for (const name of this.fleet.subjects ?? []) {
      const { place, plan } = this.motion[name] ?? {};
      if (!place) continue;
      const [x, y, z] = place;
      painter.segments([[[x, y, 0], [x, y, z]]], colours.quiet, 1, [2, 4]);
      if (plan) painter.line(plan, colours.quiet, 3);
      painter.ball(place, 0.05, colours.ink, { ring: 2, least: 6 });
      painter.text(place, name, colours.ink, colours.back, { rise: 24 });
    }
  }

  drawLabel({ name }) {
    const { text, alarming } = this.labels[name] ?? { text: name };
    const colour = alarming ? this.colours.red : this.colours.ink;
    this.painter.text(this.motion[name].place, text, colour, this.colours.back, { font: '650 14px system-ui, sans-serif', rise: 30 });
  }

  drawWaypoints() {
    this.painter.line(this.waypoints, '#c99a1c', 2, [6, 5]);
    this.waypoints.forEach((place, index) => {
      this.painter.ball(place, 0.04, '#c99a1c', { least: 5 });
      this.painter.text(place, `${index + 1}`, this.colours.ink, this.colours.back, { rise: 14 });
    });
  }
}
