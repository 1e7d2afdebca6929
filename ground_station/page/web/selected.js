/** The selected vehicle: leader, controller, set point, weights, what it has learned, details. */
import { choose, make, offer, one, write } from './dom.js';
import { send } from './link.js';

const LARGEST_POWER = 3, STEP = 0.25;

export class Selected {
  constructor() {
    this.section = one('#selected');
    this.name = null;
    this.powers = '';
    this.details = [];
  }

  setFleet(fleet) {
    this.fleet = fleet;
    this.vehicles = new Map(fleet.vehicles.map((vehicle) => [vehicle.name, vehicle]));
    this.subjects = fleet.subjects ?? [];
    if (fleet.steers && !this.listening) this.listen();
    one('#details').ontoggle = () => this.showDetails();
  }

  control(name) { return one(`[name=${name}]`, this.section); }

  listen() {
    this.listening = true;
    this.control('leader').addEventListener('change', ({ target }) => send('follow', { name: this.name, leader: target.value || null }));
    this.control('controller').addEventListener('change', ({ target }) => send('use_controller', { name: this.name, controller: target.value }));
    this.control('light').addEventListener('change', ({ target }) => {
      const colour = [1, 3, 5].map((at) => parseInt(target.value.slice(at, at + 2), 16));
      send('light', { name: this.name, colour });
    });
    for (const what of ['home', 'land']) this.control(what).addEventListener('click', () => send(what, { name: this.name }));
    one('#goto').addEventListener('submit', (event) => {
      event.preventDefault();
      const [x, y, z, heading] = ['x', 'y', 'z', 'heading'].map((name) => Number(this.control(name).value));
      send('go_to', { name: this.name, place_m: [x, y, z], yaw_rad: heading * Math.PI / 180 });
    });
    this.sliders = Object.fromEntries(this.fleet.groups.map((group) => {
      const slider = make('input', { type: 'range', min: -LARGEST_POWER, max: LARGEST_POWER, step: STEP, value: 0 });
      slider.dataset.group = group;
      const factor = make('output', { textContent: '× 1' });
      slider.addEventListener('input', () => write(factor, `× ${Number((2 ** slider.value).toPrecision(2))}`));
      one('#tune .sliders').append(make('label', {}, group, slider, factor));
      return [group, slider];
    }));
    this.control('apply').addEventListener('click', () => send('weigh', {
      name: this.name,
      powers: Object.fromEntries(Object.entries(this.sliders).map(([group, slider]) => [group, Number(slider.value)])),
    }));
    this.control('undo').addEventListener('click', () => {
      this.powers = ''; // the page may never have received the weights that are undone
      send('weigh', { name: this.name, powers: null });
    });
  }

  /** Select a vehicle, or none. */
  select(name) {
    this.name = name;
    this.section.hidden = name === null;
    this.powers = '';
    this.goal = '';
    if (name === null) return;
    const title = one('h2', this.section);
    write(title, name);
    title.style.color = this.vehicles.get(name).colour;
  }

  /** Show the state of the selected vehicle; choices follow it, which others may have changed. */
  show(rows, powers) {
    const row = rows[this.name];
    if (!row) return;
    this.details = row.details;
    const list = one('#learned');
    if (list.dataset.drawn !== row.learned.join('\n')) {
      list.dataset.drawn = row.learned.join('\n');
      list.replaceChildren(...row.learned.map((text) => make('li', { textContent: text })));
    }
    this.showDetails();
    if (!this.fleet.steers) return;
    offer(this.control('leader'), [...this.vehicles.keys(), ...this.subjects].filter((name) => name !== this.name), '(no leader)');
    choose(this.control('leader'), row.leader);
    offer(this.control('controller'), this.fleet.controllers);
    choose(this.control('controller'), row.controller);
    this.showGoal(row.set_point);
    this.showPowers(powers[this.name] ?? {});
  }

  /** Suggest the present set point, until somebody types another one. */
  showGoal(setPoint) {
    if (!setPoint || this.goal === String(setPoint) || one('#goto').contains(document.activeElement)) return;
    this.goal = String(setPoint);
    ['x', 'y', 'z', 'heading'].forEach((name, index) => choose(this.control(name), Number(setPoint[index].toFixed(2))));
  }

  /** Put the sliders where the weights are, when these have changed. */
  showPowers(powers) {
    const wanted = JSON.stringify(powers);
    if (this.powers === wanted) return;
    this.powers = wanted;
    for (const [group, slider] of Object.entries(this.sliders)) {
      slider.value = powers[group] ?? 0;
      slider.dispatchEvent(new Event('input'));
    }
  }

  showDetails() {
    if (!one('#details').open) return;
    const table = one('#details table'), { details } = this;
    while (table.rows.length > details.length) table.deleteRow(-1);
    details.forEach(([name, text, alarming], index) => {
      const row = table.rows[index] ?? table.insertRow();
      while (row.cells.length < 2) row.insertCell();
      write(row.cells[0], name);
      write(row.cells[1], text, alarming ? 'alarming' : '');
    });
  }
}
