/** A camera that orbits a point: projection of places [m] to pixels, and rays back. z points upwards. */

const FIELD = Math.PI / 5, NEAR_M = 0.05, LOWEST = -0.1, HIGHEST = Math.PI / 2 - 1e-3, MARGIN = 0.94;
const add = (a, b, k = 1) => [a[0] + k * b[0], a[1] + k * b[1], a[2] + k * b[2]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

export class Camera {
  constructor() {
    this.target = [0, 0, 0.5];
    this.distance = 5;
    this.azimuth = -2.5;
    this.elevation = 0.5;
    this.resize(300, 150);
  }

  /** Set the size of the picture in pixels. */
  resize(width, height) {
    this.width = width;
    this.height = height;
    this.focal = height / 2 / Math.tan(FIELD / 2);
    this.update();
  }

  /** Compute eye and axes. */
  update() {
    const [ca, sa, ce, se] = [Math.cos(this.azimuth), Math.sin(this.azimuth), Math.cos(this.elevation), Math.sin(this.elevation)];
    this.forward = [-ce * ca, -ce * sa, -se];
    this.right = [-sa, ca, 0];
    this.up = [-se * ca, -se * sa, ce];
    this.eye = add(this.target, this.forward, -this.distance);
  }

  /** Coordinates of a place in the frame of the camera: right, up, depth [m]. */
  view(place) {
    const away = add(place, this.eye, -1);
    return [dot(away, this.right), dot(away, this.up), dot(away, this.forward)];
  }

  /** Pixels and depth of a place; null behind the camera. */
  project(place) {
    const [x, y, depth] = this.view(place);
    return depth < NEAR_M ? null : this.pixels(x, y, depth);
  }

  /** Pixels of a point in the frame of the camera. */
  pixels(x, y, depth) {
    return [this.width / 2 + this.focal * x / depth, this.height / 2 - this.focal * y / depth, depth];
  }

  /** Pixels of both ends of a line, cut off behind the camera; null if nothing is left. */
  segment(from, to) {
    let a = this.view(from), b = this.view(to);
    if (a[2] < NEAR_M && b[2] < NEAR_M) return null;
    if (a[2] < NEAR_M) a = this.cut(b, a);
    if (b[2] < NEAR_M) b = this.cut(a, b);
    return [this.pixels(...a), this.pixels(...b)];
  }

  /** Point of a line at the nearest depth. */
  cut(visible, hidden) {
    const share = (visible[2] - NEAR_M) / (visible[2] - hidden[2]);
    return [0, 1, 2].map((axis) => visible[axis] + share * (hidden[axis] - visible[axis]));
  }

  /** Direction from the eye through a pixel. */
  ray(x, y) {
    const across = (x - this.width / 2) / this.focal, upwards = (this.height / 2 - y) / this.focal;
    return add(add(this.forward, this.right, across), this.up, upwards);
  }

  /** Place at a height [m] under a pixel; null if the ray does not meet it. */
  onLevel(x, y, height) {
    const ray = this.ray(x, y), distance = (height - this.eye[2]) / ray[2];
    return Number.isFinite(distance) && distance > 0 ? add(this.eye, ray, distance) : null;
  }

  /** Height [m] of the vertical line through a place that is nearest to a pixel. */
  onVertical(x, y, place) {
    const ray = this.ray(x, y), flat = Math.hypot(ray[0], ray[1]);
    const distance = Math.hypot(place[0] - this.eye[0], place[1] - this.eye[1]) / flat;
    return this.eye[2] + distance * ray[2];
  }

  orbit(dx, dy) {
    this.azimuth -= dx * 0.006;
    this.elevation = Math.min(HIGHEST, Math.max(LOWEST, this.elevation + dy * 0.006));
    this.update();
  }

  pan(dx, dy) {
    const scale = this.distance / this.focal;
    this.target = add(add(this.target, this.right, -dx * scale), this.up, dy * scale);
    this.update();
  }

  zoom(factor) {
    this.distance = Math.min(50, Math.max(0.5, this.distance * factor));
    this.update();
  }

  /** Show a whole box between two corners [m], centred, from a direction [rad]. */
  fit([low, high], azimuth, elevation) {
    this.azimuth = azimuth;
    this.elevation = elevation;
    this.target = [0, 1, 2].map((axis) => (low[axis] + high[axis]) / 2);
    this.distance = 100;
    this.update();
    const corners = [...Array(8).keys()].map((i) => [0, 1, 2].map((axis) => (i >> axis & 1 ? high : low)[axis]));
    const widest = MARGIN * this.width / 2 / this.focal, highest = MARGIN * this.height / 2 / this.focal;
    const needed = corners.map((corner) => {
      const [x, y, depth] = this.view(corner);
      return Math.max(Math.abs(x) / widest, Math.abs(y) / highest) - (depth - this.distance);
    });
    this.distance = Math.max(...needed);
    this.update();
  }
}
