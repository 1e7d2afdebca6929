/** Formations by name, and waypoints that are clicked in the scene. */
import { offer, one } from './dom.js';
import { send } from './link.js';

export class Tools {
  /** @param {import('./scene.js').Scene} scene */
  constructor(scene) {
    this.scene = scene;
    this.formation = one('#formation');
    this.path = one('#path');
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
    this.volume = fleet.volume_m;
  }

  setWaypoints(places) {
    this.scene.waypoints = places;
    this.scene.dirty = true;
  }

  /** Whether clicks in the scene are waypoints now. */
  get drawing() { return Boolean(this.path?.open && one('[name=drawing]', this.path).checked); }

  /** Add a waypoint where a pixel meets the chosen height; whether clicks are waypoints now. */
  click({ x, y }) {
    if (!this.drawing) return false;
    const place = this.scene.camera.onLevel(x, y, Number(one('[name=height]', this.path).value));
    const inside = place?.every((value, axis) => value >= this.volume[0][axis] && value <= this.volume[1][axis]);
    if (inside) this.setWaypoints([...this.scene.waypoints, place.map((value) => Math.round(value * 1000) / 1000)]);
    return true;
  }
}
