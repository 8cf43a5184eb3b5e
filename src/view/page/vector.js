// Vectors of three numbers, quaternions (w, x, y, z), and 4 × 4 matrices by columns.

const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const times = (a, s) => [a[0] * s, a[1] * s, a[2] * s];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const norm = (a) => Math.hypot(a[0], a[1], a[2]);
const clamp = (x, low, high) => Math.min(Math.max(x, low), high);
const mix = (a, b, s) => a.map((x, k) => x + (b[k] - x) * s);

/** The unit vector along `a`, or `otherwise` if it has no direction. */
function unit(a, otherwise = [0, 0, 1]) {
  const length = norm(a);
  return length > 0 ? times(a, 1 / length) : otherwise;
}

/** Some unit vector across a unit vector. */
function across(a) {
  const smallest = [0, 1, 2].reduce((k, j) => (Math.abs(a[j]) < Math.abs(a[k]) ? j : k), 0);
  const e = [0, 0, 0];
  e[smallest] = 1;
  return unit(cross(a, e));
}

/** `x` turned by a unit quaternion. */
function turned([w, ...v], x) {
  const c = times(cross(v, x), 2);
  return add(add(x, times(c, w)), cross(v, c));
}

/** Columns of the rotation of a unit quaternion. */
const axes = (q) => [turned(q, [1, 0, 0]), turned(q, [0, 1, 0]), turned(q, [0, 0, 1])];

/** The pose that is `inner` in the frame `outer`; a pose is { position, quaternion }. */
function composed(outer, inner) {
  const [aw, ...a] = outer.quaternion;
  const [bw, ...b] = inner.quaternion;
  const v = add(add(times(b, aw), times(a, bw)), cross(a, b));
  return { position: add(outer.position, turned(outer.quaternion, inner.position)), quaternion: [aw * bw - dot(a, b), ...v] };
}

/** The matrix of a pose. */
function poseMatrix({ position, quaternion }) {
  const [x, y, z] = axes(quaternion);
  return new Float32Array([...x, 0, ...y, 0, ...z, 0, ...position, 1]);
}

const IDENTITY = poseMatrix({ position: [0, 0, 0], quaternion: [1, 0, 0, 0] });

/** The product a b. */
function product(a, b) {
  const out = new Float32Array(16);
  for (let column = 0; column < 4; column++) {
    for (let row = 0; row < 4; row++) {
      for (let k = 0; k < 4; k++) out[4 * column + row] += a[4 * k + row] * b[4 * column + k];
    }
  }
  return out;
}

/** World to eye, for an eye with axes right, up, back. */
function viewMatrix(eye, right, up, back) {
  const row = (k) => [right[k], up[k], back[k], 0];
  return new Float32Array([...row(0), ...row(1), ...row(2), -dot(right, eye), -dot(up, eye), -dot(back, eye), 1]);
}

/** Perspective; `half` is the tangent of half the vertical angle of view. */
function perspective(half, aspect, near, far) {
  const out = new Float32Array(16);
  out[0] = 1 / (half * aspect);
  out[5] = 1 / half;
  out[10] = (near + far) / (near - far);
  out[11] = -1;
  out[14] = (2 * near * far) / (near - far);
  return out;
}
