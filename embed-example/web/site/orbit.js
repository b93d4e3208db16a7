// The camera goes around a point: drag turns, wheel or pinch goes near and far. Works on records of `Scene.view`.

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const plus = (a, b, s) => a.map((x, i) => x + s * b[i]);
const unit = (a) => a.map((x) => x / Math.sqrt(dot(a, a)));
const length = (a) => Math.sqrt(dot(a, a));

/** Largest angle above and below the horizon, radians. */
const STEEPEST = 1.5;

export class Orbit {
  /** Around the point of the viewing axis that is nearest to the middle of the scene's box, upright along +y. */
  constructor(view) {
    this.view = view;
    const c = view.camera;
    const [origin, forward] = [[...c.slice(1, 4)], unit([...c.slice(4, 7)])];
    const middle = view.low.map((x, i) => (x + view.high[i]) / 2);
    // not a ground that reaches to the horizon
    const along = dot(plus(middle, origin, -1), forward);
    this.distance = along > 0 ? along : 0.5 * length(plus(view.high, view.low, -1));
    this.pivot = plus(origin, forward, this.distance);
    this.tangents = [length([...c.slice(7, 10)]), length([...c.slice(10, 13)])];
    this.azimuth = Math.atan2(-forward[0], -forward[2]);
    this.elevation = Math.asin(Math.max(-1, Math.min(1, -forward[1])));
    this.start = { ...this };
  }

  turn(azimuth, elevation) {
    this.azimuth += azimuth;
    this.elevation = Math.max(-STEEPEST, Math.min(STEEPEST, this.elevation + elevation));
  }

  zoom(factor) {
    this.distance = Math.max(this.start.distance / 20, Math.min(this.start.distance * 4, this.distance * factor));
  }

  /** Back to the scene's own view. */
  home() {
    Object.assign(this, this.start);
  }

  /** The record of a camera for a picture of this shape; all that the scene's own picture shows stays in it. */
  camera(width, height) {
    const { azimuth, elevation, pivot, distance, tangents, view } = this;
    const [sa, ca, se, ce] = [Math.sin(azimuth), Math.cos(azimuth), Math.sin(elevation), Math.cos(elevation)];
    const forward = [-sa * ce, -se, -ca * ce];
    const right = unit(cross(forward, [0, 1, 0]));
    const down = cross(forward, right);
    const record = view.camera.slice();
    // the core keeps the vertical angle: a narrower picture needs a larger one
    const fit = Math.max(1, view.size[0] / view.size[1] / (width / height));
    record.set(plus(pivot, forward, -distance), 1);
    record.set(forward, 4);
    record.set(right.map((x) => x * tangents[0] * fit), 7);
    record.set(down.map((x) => x * tangents[1] * fit), 10);
    return record;
  }
}

/** Listens to mouse, touch and wheel on an element; calls `moved` after each change of the orbit of `current`. */
export function attach(element, current, moved) {
  const pointers = new Map();
  const spread = () => {
    const [a, b] = [...pointers.values()];
    return Math.hypot(a.x - b.x, a.y - b.y);
  };
  element.addEventListener('pointerdown', (e) => {
    element.setPointerCapture(e.pointerId);
    pointers.set(e.pointerId, { x: e.clientX, y: e.clientY });
  });
  element.addEventListener('pointermove', (e) => {
    const from = pointers.get(e.pointerId);
    if (!from || !current()) return;
    const before = pointers.size === 2 ? spread() : 0;
    pointers.set(e.pointerId, { x: e.clientX, y: e.clientY });
    if (pointers.size === 2) current().zoom(before / Math.max(spread(), 1));
    else current().turn((from.x - e.clientX) * 0.008, (e.clientY - from.y) * 0.008);
    moved();
  });
  for (const end of ['pointerup', 'pointercancel']) {
    element.addEventListener(end, (e) => pointers.delete(e.pointerId));
  }
  element.addEventListener('wheel', (e) => {
    if (!current()) return;
    e.preventDefault();
    current().zoom(Math.exp(e.deltaY * 0.0012));
    moved();
  }, { passive: false });
}
