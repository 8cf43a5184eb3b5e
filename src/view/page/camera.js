// An eye on a sphere around what it looks at; z is up.

/** Tangent of half the vertical angle of view. */
const HALF = Math.tan((17 * Math.PI) / 180);
const STEEPEST = (89 * Math.PI) / 180;

class Camera {
  constructor() {
    this.target = [0, 0, 0];
    this.distance = 1;
    /** Where the eye is, seen from the target: turned from x towards y, and above the horizon [rad]. */
    this.azimuth = -Math.PI / 3;
    this.elevation = 0.35;
    this.aspect = 1;
  }

  back() {
    const [c, s] = [Math.cos(this.elevation), Math.sin(this.elevation)];
    return [c * Math.cos(this.azimuth), c * Math.sin(this.azimuth), s];
  }

  right() {
    return [-Math.sin(this.azimuth), Math.cos(this.azimuth), 0];
  }

  up() {
    return cross(this.back(), this.right());
  }

  eye() {
    return add(this.target, times(this.back(), this.distance));
  }

  /** World to screen, for a scene that reaches `reach` from the target. */
  matrix(reach) {
    const near = Math.max(this.distance - reach, 0.02 * this.distance);
    const far = this.distance + reach;
    const view = viewMatrix(this.eye(), this.right(), this.up(), this.back());
    return product(perspective(HALF, this.aspect, near, far), view);
  }

  /** Size of a pixel where the camera looks [m], on a screen `height` pixels high. */
  pixel(height) {
    return (2 * HALF * this.distance) / height;
  }

  turn(dx, dy) {
    this.azimuth -= dx;
    this.elevation = clamp(this.elevation + dy, -STEEPEST, STEEPEST);
  }

  /** Moves what is seen by a part of the screen's height. */
  pan(dx, dy) {
    const scale = 2 * HALF * this.distance;
    this.target = add(this.target, add(times(this.right(), -dx * scale), times(this.up(), dy * scale)));
  }

  zoom(factor, smallest, largest) {
    this.distance = clamp(this.distance * factor, smallest, largest);
  }

  /** Goes as near as all points, with a ball of `radius` about each, still are on the screen. */
  fit(points, radius) {
    const [right, up, back] = [this.right(), this.up(), this.back()];
    const [wide, high] = [HALF * this.aspect, HALF];
    const seen = (p) => {
      const d = minus(p, this.target);
      return [dot(d, right), dot(d, up), dot(d, back)];
    };
    const needed = ([x, y, depth]) => depth + Math.max((Math.abs(x) + radius) / wide, (Math.abs(y) + radius) / high);
    const nearest = () => points.reduce((most, p) => Math.max(most, needed(seen(p))), Math.max(radius, 1e-6));
    this.target = [0, 0, 0];
    this.distance = nearest();
    for (let round = 0; round < 5 && points.length > 0; round++) {
      // to the middle of what is seen, as perspective has it
      const places = points.map(seen).map(([x, y, depth]) => [x, y].map((s) => s / Math.max(this.distance - depth, 1e-9)));
      const middle = (k) => {
        const [low, most] = range(places.map((place) => place[k]));
        return 0.5 * (low + most) * this.distance;
      };
      this.target = add(this.target, add(times(right, middle(0)), times(up, middle(1))));
      this.distance = nearest();
    }
    this.distance *= 1.1;
  }
}

/** Turns, moves and zooms with mouse, pen and fingers. `size` is { smallest, largest } of the distance, `changed` is told. */
function steer(canvas, camera, size, changed) {
  const fingers = new Map();
  const spread = () => {
    const [a, b] = [...fingers.values()];
    return { x: (a.x + b.x) / 2, y: (a.y + b.y) / 2, apart: Math.max(Math.hypot(a.x - b.x, a.y - b.y), 1) };
  };
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
  });
  for (const kind of ["pointerup", "pointercancel"]) {
    canvas.addEventListener(kind, (event) => fingers.delete(event.pointerId));
  }
  canvas.addEventListener("pointermove", (event) => {
    const before = fingers.get(event.pointerId);
    if (!before) return;
    const now = { x: event.clientX, y: event.clientY };
    const height = canvas.clientHeight || 1;
    if (fingers.size === 2) {
      const old = spread();
      fingers.set(event.pointerId, now);
      const fresh = spread();
      camera.pan((fresh.x - old.x) / height, (fresh.y - old.y) / height);
      camera.zoom(old.apart / fresh.apart, size.smallest, size.largest);
    } else {
      fingers.set(event.pointerId, now);
      const [dx, dy] = [(now.x - before.x) / height, (now.y - before.y) / height];
      if (event.buttons & 6 || event.shiftKey) camera.pan(dx, dy);
      else camera.turn(3.5 * dx, 3.5 * dy);
    }
    changed();
  });
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    const notch = event.deltaMode === 1 ? 33 * event.deltaY : event.deltaY;
    camera.zoom(Math.exp(clamp(notch, -200, 200) * 0.0015), size.smallest, size.largest);
    changed();
  }, { passive: false });
}
