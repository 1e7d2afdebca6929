/** Draws places [m] on a canvas through a camera. */
import { Camera } from './camera.js';

const LIGHT = [0.35, -0.25, 0.9];

/** Vector of a body frame in the inertial frame, by quaternion x, y, z, w. */
const turned = ([x, y, z, w], [a, b, c]) => {
  const [u, v, t] = [2 * (y * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y * a)];
  return [a + w * u + y * t - z * v, b + w * v + z * u - x * t, c + w * t + x * v - y * u];
};

const normalOf = ([a, b, c]) => {
  const [p, q] = [[0, 1, 2].map((i) => b[i] - a[i]), [0, 1, 2].map((i) => c[i] - b[i])];
  const cross = [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]];
  const length = Math.hypot(...cross) || 1;
  return cross.map((value) => value / length);
};

export class Painter {
  /** @param {HTMLCanvasElement} canvas */
  constructor(canvas) {
    this.canvas = canvas;
    this.context = canvas.getContext('2d');
    this.camera = new Camera();
  }

  /** Take on the size of the canvas on the page; whether it has changed. */
  resize() {
    const { clientWidth: width, clientHeight: height } = this.canvas, ratio = Math.min(2, devicePixelRatio);
    if (this.canvas.width === Math.round(width * ratio) && this.canvas.height === Math.round(height * ratio)) return false;
    [this.canvas.width, this.canvas.height] = [Math.round(width * ratio), Math.round(height * ratio)];
    this.context.setTransform(ratio, 0, 0, ratio, 0, 0);
    this.camera.resize(width, height);
    return true;
  }

  clear() {
    this.context.clearRect(0, 0, this.camera.width, this.camera.height);
  }

  /** Lines between pairs of places. */
  segments(pairs, colour, width = 1, dash = []) {
    const { context } = this;
    context.beginPath();
    for (const [from, to] of pairs) {
      const ends = this.camera.segment(from, to);
      if (!ends) continue;
      context.moveTo(ends[0][0], ends[0][1]);
      context.lineTo(ends[1][0], ends[1][1]);
    }
    context.strokeStyle = colour;
    context.lineWidth = width;
    context.lineCap = 'round';
    context.setLineDash(dash);
    context.stroke();
    context.setLineDash([]);
  }

  /** A line through places. */
  line(places, colour, width, dash) {
    this.segments(places.slice(1).map((place, index) => [places[index], place]), colour, width, dash);
  }

  /** A filled polygon, unless a corner is behind the camera. */
  polygon(places, fill) {
    const corners = places.map((place) => this.camera.project(place));
    if (corners.includes(null)) return;
    this.context.beginPath();
    for (const [x, y] of corners) this.context.lineTo(x, y);
    this.context.closePath();
    this.context.fillStyle = fill;
    this.context.fill();
  }

  /** A ball, or with `ring` its outline; the radius is in metres, at least `least` pixels. */
  ball(place, radius, colour, { ring = 0, least = 3 } = {}) {
    const at = this.camera.project(place);
    if (!at) return;
    this.context.beginPath();
    this.context.arc(at[0], at[1], Math.max(least, radius * this.camera.focal / at[2]), 0, 2 * Math.PI);
    if (ring) {
      this.context.strokeStyle = colour;
      this.context.lineWidth = ring;
      this.context.stroke();
    } else {
      this.context.fillStyle = colour;
      this.context.fill();
    }
  }

  /** Text beside a place, with a halo. */
  text(place, text, colour, halo, { font = '12px system-ui, sans-serif', rise = 0, align = 'center' } = {}) {
    const at = this.camera.project(place);
    if (!at) return;
    const { context } = this;
    context.font = font;
    context.textAlign = align;
    context.textBaseline = 'middle';
    context.lineJoin = 'round';
    context.lineWidth = 4;
    context.strokeStyle = halo;
    context.strokeText(text, at[0], at[1] - rise);
    context.fillStyle = colour;
    context.fillText(text, at[0], at[1] - rise);
  }

  /** A convex body with its attitude, lit from above. */
  body(faces, place, attitude, colour, dark) {
    const { camera, context } = this;
    const seen = [];
    for (const face of faces) {
      const points = face.points.map((point) => turned(attitude, point).map((value, axis) => value + place[axis]));
      const normal = normalOf(points);
      const facing = [0, 1, 2].reduce((sum, axis) => sum + normal[axis] * (points[0][axis] - camera.eye[axis]), 0);
      if (facing >= 0 && !face.rotor) continue;
      const depth = points.reduce((sum, point) => sum + camera.view(point)[2], 0) / points.length;
      const light = 0.62 + 0.38 * Math.max(-0.6, normal[0] * LIGHT[0] + normal[1] * LIGHT[1] + normal[2] * LIGHT[2]);
      seen.push({ face, points, light, depth });
    }
    for (const { face, points, light } of seen.sort((a, b) => b.depth - a.depth)) {
      context.globalAlpha = face.rotor ? 0.28 : 1;
      context.filter = 'none';
      this.polygon(points, face.rotor || face.dark ? dark : shaded(colour, light));
    }
    context.globalAlpha = 1;
  }
}

const shades = new Map();

/** A colour `#rrggbb` times a light. */
const shaded = (colour, light) => {
  const key = `${colour}${Math.round(light * 20)}`;
  if (!shades.has(key)) {
    const parts = [1, 3, 5].map((at) => Math.min(255, Math.round(parseInt(colour.slice(at, at + 2), 16) * Math.round(light * 20) / 20)));
    shades.set(key, `rgb(${parts})`);
  }
  return shades.get(key);
};
