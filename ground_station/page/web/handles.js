/** Handles of set points: elements above the canvas, so that the camera does not get their events. */
import { make } from './dom.js';
import { send } from './link.js';

const LINGER_MS = 1500; // until the fleet reports the new set point

export class Handles {
  /**
   * @param {HTMLElement} layer Lies above the canvas.
   * @param {import('./scene.js').Scene} scene
   */
  constructor(layer, scene) {
    this.layer = layer;
    this.scene = scene;
    this.shown = new Map();
    this.held = new Map(); // place by vehicle while it is dragged, and until it is reported
    this.dragged = null;
  }

  /** Add the handles of a fleet. */
  setFleet(fleet) {
    this.layer.replaceChildren();
    this.shown.clear();
    this.volume = fleet.volume_m;
    if (!fleet.steers) return;
    for (const { name, colour } of fleet.vehicles) {
      const plane = make('button', { type: 'button', className: 'handle', title: `${name}: drag to move it at its height` }, make('span', { textContent: '✥' }));
      const lift = make('button', { type: 'button', className: 'handle lift', title: `${name}: drag to change its height` }, make('span', { textContent: '↕' }));
      for (const handle of [plane, lift]) {
        handle.dataset.vehicle = name;
        handle.style.color = colour;
        handle.tabIndex = -1;
        handle.hidden = true;
        this.listen(handle, name, handle === lift);
      }
      this.layer.append(plane, lift);
      this.shown.set(name, [plane, lift]);
    }
  }

  listen(handle, name, vertical) {
    let grip = [0, 0];
    const inLayer = (event) => {
      const box = this.layer.getBoundingClientRect();
      return [event.clientX - box.left, event.clientY - box.top];
    };
    handle.addEventListener('pointerdown', (event) => {
      const place = this.placeOf(name);
      if (!place || event.button !== 0) return;
      handle.setPointerCapture(event.pointerId);
      handle.classList.add('dragged');
      const at = this.scene.camera.project(place), [x, y] = inLayer(event);
      grip = [x - at[0], y - at[1]];
      this.dragged = name;
      this.held.set(name, { place, until: Infinity });
    });
    handle.addEventListener('pointermove', (event) => {
      if (this.dragged !== name || !handle.classList.contains('dragged')) return;
      const [x, y] = inLayer(event).map((value, axis) => value - grip[axis]), before = this.held.get(name).place;
      const { camera } = this.scene;
      const wanted = vertical ? [before[0], before[1], camera.onVertical(x, y, before)] : camera.onLevel(x, y, before[2]);
      if (wanted) this.hold(name, wanted);
    });
    const end = (event) => {
      if (!handle.classList.contains('dragged')) return;
      handle.classList.remove('dragged');
      this.dragged = null;
      const { place } = this.held.get(name);
      this.held.get(name).until = event.type === 'pointerup' ? performance.now() + LINGER_MS : 0;
      delete this.scene.ghosts[name];
      if (event.type === 'pointerup') {
        send('move', { name, place_m: place.map((value) => Math.round(value * 1000) / 1000) });
      }
    };
    handle.addEventListener('pointerup', end);
    handle.addEventListener('pointercancel', end);
  }

  /** Hold a place within the volume. */
  hold(name, place) {
    const within = place.map((value, axis) => Math.min(this.volume[1][axis], Math.max(this.volume[0][axis], value)));
    this.held.get(name).place = this.scene.ghosts[name] = within;
    this.scene.dirty = true;
  }

  /** Place of a handle: where it is held, else as the fleet reports it. */
  placeOf(name) {
    const held = this.held.get(name);
    if (held && performance.now() < held.until) return held.place;
    this.held.delete(name);
    return this.scene.motion[name]?.handle;
  }

  /** Raise the handles of a vehicle above those of others. */
  select(name) {
    for (const [own, both] of this.shown) for (const handle of both) handle.classList.toggle('raised', own === name);
  }

  /** Put the handles where they belong, or hide all. */
  draw(visible) {
    for (const [name, [plane, lift]] of this.shown) {
      const place = visible && this.scene.motion[name] ? this.placeOf(name) : null;
      const at = place && this.scene.camera.project(place);
      plane.hidden = lift.hidden = !at;
      if (at) plane.style.transform = lift.style.transform = `translate(${at[0]}px, ${at[1]}px)`;
    }
  }
}
