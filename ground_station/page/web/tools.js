/** Formations by name, and waypoints and keep-out zones that are clicked in the scene. */
import { make, offer, one } from './dom.js';
import { send } from './link.js';

export class Tools {
  /** @param {import('./scene.js').Scene} scene */
  constructor(scene) {
    this.scene = scene;
    this.formation = one('#formation');
    this.path = one('#path');
    this.zone = one('#zone');
    if (!this.formation) return;
    const value = (name) => one(`[name=${name}]`, this.formation).value;
    one('[name=fly]', this.formation).addEventListener('click', () => send('formation', { shape: value('shape'), leader: value('leader'), spacing_m: Number(value('spacing')), assign: one('[name=assign]', this.formation).checked }));
    one('[name=promote]', this.formation).addEventListener('click', () => send('promote', { name: value('leader') }));
    one('[name=fly]', this.path).addEventListener('click', () => send('fly_through', { name: one('[name=vehicle]', this.path).value, places_m: this.scene.waypoints }));
    one('[name=clear]', this.path).addEventListener('click', () => this.setWaypoints([]));
  }

  setFleet(fleet) {
    if (!fleet.steers) return;
    const names = fleet.vehicles.map((vehicle) => vehicle.name);
    offer(one('[name=leader]', this.formation), names);
    offer(one('[name=shape]', this.formation), fleet.shapes);
    offer(one('[name=vehicle]', this.path), names);
    one('[name=height]', this.path).max = fleet.volume_m[1][2];
    one('[name=top]', this.zone).value = fleet.volume_m[1][2];
    this.volume = fleet.volume_m;
  }

  /** List keep-out zones, each with a button that removes it. */
  showZones(zones) {
    const list = this.zone && one('ul', this.zone), names = Object.keys(zones);
    if (!list || list.dataset.shown === names.join()) return;
    list.dataset.shown = names.join();
    list.replaceChildren(...names.map((name) => {
      const remove = make('button', { type: 'button', textContent: `Remove ${name}` });
      remove.addEventListener('click', () => send('remove_zone', { zone: name }));
      return make('li', {}, remove);
    }));
    if (names.includes(one('[name=name]', this.zone).value)) {
      one('[name=name]', this.zone).value = `zone${[...Array(names.length + 1).keys()].map((i) => i + 1).find((i) => !names.includes(`zone${i}`))}`;
    }
  }

  /** Set a corner of a zone where a pixel meets the floor; the second one of two opposite ones sends the zone. */
  clickCorner({ x, y }) {
    const floor = this.scene.camera.onLevel(x, y, 0), value = (name) => one(`[name=${name}]`, this.zone).value;
    if (!floor) return;
    const place = floor.map((number, axis) => Math.min(this.volume[1][axis], Math.max(this.volume[0][axis], number)));
    const { corner } = this.scene;
    this.scene.corner = corner ? null : place;
    this.scene.dirty = true;
    if (!corner) return;
    const shape = value('shape'), millimetres = (number) => Math.round(number * 1000);
    const middle = [0, 1].map((axis) => millimetres((corner[axis] + place[axis]) / 2));
    const half = [0, 1].map((axis) => millimetres(Math.abs(corner[axis] - place[axis]) / 2));
    const reach = shape === 'cylinder' ? half.map(() => Math.max(...half)) : half; // square to the millimetre
    const at = (sign, z) => [...middle.map((number, axis) => (number + sign * reach[axis]) / 1000), z];
    send('set_zone', { zone: value('name'), low_m: at(-1, 0), high_m: at(1, Number(value('top'))), shape });
    one('[name=drawing]', this.zone).checked = false;
  }

  setWaypoints(places) {
    this.scene.waypoints = places;
    this.scene.dirty = true;
  }

  /** Whether clicks in the scene are waypoints now. */
  get drawing() { return Boolean(this.path?.open && one('[name=drawing]', this.path).checked); }

  /** Add a waypoint where a pixel meets the chosen height; whether clicks are waypoints now. */
  click({ x, y }) {
    if (this.zone?.open && one('[name=drawing]', this.zone).checked) {
      this.clickCorner({ x, y });
      return true;
    }
    if (!this.drawing) return false;
    const place = this.scene.camera.onLevel(x, y, Number(one('[name=height]', this.path).value));
    const inside = place?.every((value, axis) => value >= this.volume[0][axis] && value <= this.volume[1][axis]);
    if (inside) this.setWaypoints([...this.scene.waypoints, place.map((value) => Math.round(value * 1000) / 1000)]);
    return true;
  }
}
