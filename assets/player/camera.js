// Poses and pinhole cameras. World to camera is `x_c = R x + t`; camera axes: x right, y down, z forward.
// A vector is a number[3], a rotation a number[9] of rows. Pixel (i, j) has its centre at (i + 0.5, j + 0.5).

/**
 * @typedef {object} View
 * @property {number[]} rotation R, rows
 * @property {number[]} center of the camera, world
 * @property {number} fx pixels
 * @property {number} fy pixels
 * @property {number} cx pixels
 * @property {number} cy pixels
 * @property {number} width pixels
 * @property {number} height pixels
 */

/** @param {number[]} a @param {number[]} b */
export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
/** @param {number[]} a @param {number[]} b */
export const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
/** `a + s b`. @param {number[]} a @param {number[]} b @param {number} [s] */
export const add = (a, b, s = 1) => [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]];
/** @param {number[]} a @param {number} s */
export const scaled = (a, s) => [a[0] * s, a[1] * s, a[2] * s];
/** @param {number[]} a */
export const unit = (a) => scaled(a, 1 / (Math.hypot(...a) || 1));
/** @param {number[]} a @param {number[]} b */
export const distance = (a, b) => Math.hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
/** Row `i`. @param {number[]} m @param {number} i */
export const row = (m, i) => m.slice(3 * i, 3 * i + 3);
/** @param {number[]} m @param {number[]} v */
export const apply = (m, v) => [dot(row(m, 0), v), dot(row(m, 1), v), dot(row(m, 2), v)];
/** @param {number[]} m */
export const transposed = (m) => [m[0], m[3], m[6], m[1], m[4], m[7], m[2], m[5], m[8]];
/** @param {number[]} a @param {number[]} b */
export function product(a, b) {
  const columns = transposed(b);
  return [0, 1, 2].flatMap((i) => [0, 1, 2].map((j) => dot(row(a, i), row(columns, j))));
}

/** Rotation by an angle about a unit axis. @param {number[]} axis @param {number} angle radians */
export function turn([x, y, z], angle) {
  const c = Math.cos(angle);
  const s = Math.sin(angle);
  const k = 1 - c;
  return [k * x * x + c, k * x * y - s * z, k * x * z + s * y, k * x * y + s * z, k * y * y + c, k * y * z - s * x, k * x * z - s * y, k * y * z + s * x, k * z * z + c];
}

/** Rotation of a unit quaternion. @param {{ x: number, y: number, z: number, w: number }} q */
export function rotationOf({ x, y, z, w }) {
  return [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y), 2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x), 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)];
}

/** World-to-camera rotation that looks along `forward`, as upright as `up` allows. @param {number[]} forward @param {number[]} up */
export function lookAlong(forward, up) {
  const z = unit(forward);
  let right = cross(z, up);
  if (Math.hypot(...right) < 1e-4) right = cross(z, Math.abs(z[0]) < 0.9 ? [1, 0, 0] : [0, 1, 0]);
  const x = unit(right);
  return [...x, ...cross(z, x), ...z];
}

/**
 * A view from a row of a cameras file.
 * @param {any} source `world_to_camera` (3 x 4 or 4 x 4 rows), `fx`, `fy`, `cx`, `cy`, `width`, `height`
 * @returns {View}
 */
export function viewOf(source) {
  const rows = source?.world_to_camera;
  const numbers = [source?.fx, source?.fy, source?.cx, source?.cy, source?.width, source?.height];
  const isPose = Array.isArray(rows) && rows.length >= 3 && rows.slice(0, 3).every((r) => Array.isArray(r) && r.length === 4 && r.every(Number.isFinite));
  if (!isPose || !numbers.every(Number.isFinite) || !(source.width >= 1 && source.height >= 1)) {
    throw new TypeError('view: expected world_to_camera (3 x 4 or 4 x 4 rows) and finite fx, fy, cx, cy, width, height');
  }
  const rotation = rows.slice(0, 3).flatMap((r) => r.slice(0, 3));
  const center = scaled(apply(transposed(rotation), rows.slice(0, 3).map((r) => r[3])), -1);
  const [fx, fy, cx, cy, width, height] = numbers;
  return { rotation, center, fx, fy, cx, cy, width, height };
}

const MOST_CROPPED = 1.35;

/**
 * The same view for a picture of another size. It shows all of it, or, where the shapes differ much, crops it a little.
 * @param {View} view @param {number} width @param {number} height
 */
export function fitted(view, width, height) {
  const [a, b] = [width / view.width, height / view.height];
  const zoom = Math.min(Math.max(a, b), MOST_CROPPED * Math.min(a, b)) || 1;
  const cx = width / 2 + (view.cx - view.width / 2) * zoom;
  const cy = height / 2 + (view.cy - view.height / 2) * zoom;
  return { ...view, fx: view.fx * zoom, fy: view.fy * zoom, cx, cy, width, height };
}

/** Forward axis and offset, such that depth = axis . x + offset. @param {Pick<View, 'rotation' | 'center'>} view */
export function depthAxis(view) {
  const forward = row(view.rotation, 2);
  return [...forward, -dot(forward, view.center)];
}
