// Scenes of the tests, their decoding under node, and the truth: the renderer of SPEC 3 in float64.
import { openScene } from '../../assets/player/container.js';
import { decodeChunk, LOOK_TEXELS, SH_COEFFICIENTS } from '../../assets/player/decode.js';
import { memorySource } from '../../assets/player/source.js';

/** Numbers in [0, 1), the same for the same seed. */
export function random(seed) {
  let state = seed >>> 0;
  return () => {
    state = (state + 0x6d2b79f5) >>> 0;
    let x = Math.imul(state ^ (state >>> 15), state | 1);
    x ^= x + Math.imul(x ^ (x >>> 7), x | 61);
    return ((x ^ (x >>> 14)) >>> 0) / 2 ** 32;
  };
}

/** `n` Gaussians in a ball of radius 1 about (0, 0, 3); a third is static. */
export function randomGaussians(n, shDegree, seed = 1, duration = 2) {
  const next = random(seed);
  const normal = () => Math.sqrt(-2 * Math.log(1 - next())) * Math.cos(2 * Math.PI * next());
  const all = [...Array(n).keys()];
  const vector = (f) => [f(), f(), f()];
  const isStatic = all.map(() => next() < 0.33);
  return {
    count: n, shDegree,
    position: all.map(() => vector(() => 0.6 * normal()).map((v, c) => v + (c === 2 ? 3 : 0))),
    scale: all.map(() => vector(() => 0.03 * Math.exp(0.8 * normal()))),
    rotation: all.map(() => [normal(), normal(), normal(), normal()]).map((q) => q.map((v) => v / Math.hypot(...q))),
    color: all.map(() => vector(next)), opacity: all.map(() => 0.05 + 0.94 * next()),
    sh: all.map(() => Array.from({ length: 3 * SH_COEFFICIENTS[shDegree] }, () => 0.15 * normal())),
    velocity: all.map((i) => (isStatic[i] ? [0, 0, 0] : vector(() => 0.4 * normal()))),
    time: all.map((i) => (isStatic[i] ? 0 : duration * next())), sigma: all.map((i) => (isStatic[i] ? Infinity : 0.05 + 0.3 * next())),
  };
}

/** Reads a whole file. @returns {{ scene, chunks, gaussians }} values in float64 */
export async function decodeAll(bytes, { limit = Infinity } = {}) {
  const source = memorySource(new Uint8Array(bytes));
  const scene = await openScene(source);
  const settings = { grid: scene.grid, windows: scene.windows, cutoff: scene.header.cutoff, alphaMin: 1 / 255, shDegree: scene.header.shDegree };
  const chunks = [];
  const g = { count: 0, shDegree: scene.header.shDegree, position: [], scale: [], rotation: [], color: [], opacity: [], velocity: [], time: [], sigma: [], window: [], sh: [], shBytes: [] };
  for (const entry of scene.chunks) {
    const read = async ({ offset, length }) => source.read(offset, length);
    const chunk = await decodeChunk(await read(entry.chunk), await Promise.all(entry.bands.map(read)), settings, entry.count);
    chunks.push(chunk);
    if (g.count + chunk.count > limit) continue;
    for (let i = 0; i < chunk.count; i += 1) {
      const x = chunk.geometry.subarray(16 * i, 16 * i + 16);
      const words = 4 * LOOK_TEXELS[scene.header.shDegree];
      const look = new Uint8Array(chunk.look.buffer, 4 * words * i, 4 * words);
      const n = SH_COEFFICIENTS[scene.header.shDegree];
      const unit16 = (at) => (look[at] | (look[at + 1] << 8)) / 65535;
      const shBytes = [0, 1, 2].flatMap((c) => Array.from({ length: n }, (_, k) => look[8 + 3 * k + c]));
      g.position.push([...x.subarray(0, 3)]);
      g.opacity.push(x[3]);
      g.velocity.push([...x.subarray(4, 7)]);
      g.time.push(x[7]);
      g.scale.push([...x.subarray(8, 11)]);
      g.sigma.push(x[11] === 0 ? Infinity : Math.SQRT1_2 / x[11]);
      g.rotation.push([...x.subarray(12, 16)]);
      g.color.push([unit16(0), unit16(2), unit16(4)]);
      g.window.push([scene.windows[2 * chunk.window[i]], scene.windows[2 * chunk.window[i] + 1]]);
      g.shBytes.push(shBytes);
      g.sh.push(shBytes.map((b) => -4 + (b * 8) / 255));
    }
    g.count += chunk.count;
  }
  return { scene, chunks, gaussians: g };
}

const BASIS = (d) => {
  const [x, y, z] = d;
  return [-0.4886025119029199 * y, 0.4886025119029199 * z, -0.4886025119029199 * x,
    1.0925484305920792 * x * y, -1.0925484305920792 * y * z, 0.31539156525252005 * (2 * z * z - x * x - y * y), -1.0925484305920792 * x * z, 0.5462742152960396 * (x * x - y * y),
    -0.5900435899266435 * y * (3 * x * x - y * y), 2.890611442640554 * x * y * z, -0.4570457994644658 * y * (4 * z * z - x * x - y * y),
    0.3731763325901154 * z * (2 * z * z - 3 * x * x - 3 * y * y), -0.4570457994644658 * x * (4 * z * z - x * x - y * y),
    1.445305721320277 * z * (x * x - y * y), -0.5900435899266435 * x * (x * x - 3 * y * y)];
};

/** Colour of each pixel, W x H x 3, as SPEC 3 says. @param {any} view as of a cameras file */
export function renderTruth(g, view, t, { blur = 0.3, alphaMin = 1 / 255, alphaMax = 0.99, tMin = 1e-4, near = 0.01, background = [0, 0, 0] } = {}) {
  const { fx, fy, cx, cy, width, height } = view;
  const r = view.world_to_camera.slice(0, 3).map((row) => row.slice(0, 3));
  const shift = view.world_to_camera.slice(0, 3).map((row) => row[3]);
  const mul = (v) => r.map((row) => row[0] * v[0] + row[1] * v[1] + row[2] * v[2]);
  const center = [0, 1, 2].map((c) => -(r[0][c] * shift[0] + r[1][c] * shift[1] + r[2][c] * shift[2]));
  const splats = [];
  for (let i = 0; i < g.count; i += 1) {
    const dt = t - g.time[i];
    const opacity = g.opacity[i] * (g.sigma[i] === Infinity ? 1 : Math.exp(-0.5 * (dt / g.sigma[i]) ** 2));
    const world = g.position[i].map((p, c) => p + dt * g.velocity[i][c]);
    const p = mul(world).map((v, c) => v + shift[c]);
    if (opacity < alphaMin || p[2] <= near) continue;
    const [x, y, z, w] = g.rotation[i];
    const q = [[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)], [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)], [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]];
    const m = r.map((row) => [0, 1, 2].map((k) => (row[0] * q[0][k] + row[1] * q[1][k] + row[2] * q[2][k]) * g.scale[i][k]));
    const clamp = (v, lo, hi) => Math.min(hi, Math.max(lo, v));
    const u = clamp(p[0] / p[2], -cx / fx - (0.15 * width) / fx, (width - cx) / fx + (0.15 * width) / fx);
    const v = clamp(p[1] / p[2], -cy / fy - (0.15 * height) / fy, (height - cy) / fy + (0.15 * height) / fy);
    const j0 = [0, 1, 2].map((k) => (fx / p[2]) * (m[0][k] - u * m[2][k]));
    const j1 = [0, 1, 2].map((k) => (fy / p[2]) * (m[1][k] - v * m[2][k]));
    const [a, b, c] = [blur, 0, blur].map((s, k) => s + [0, 1, 2].reduce((sum, e) => sum + (k < 2 ? j0 : j1)[e] * (k > 0 ? j1 : j0)[e], 0));
    const det = a * c - b * b;
    const d = world.map((s, k) => s - center[k]);
    const basis = BASIS(d.map((s) => s / Math.hypot(...d)));
    const n = g.sh[i].length / 3;
    const color = g.color[i].map((base, k) => Math.max(0, base + g.sh[i].slice(k * n, k * n + n).reduce((s, f, e) => s + f * basis[e], 0)));
    splats.push({ z: p[2], x: (fx * p[0]) / p[2] + cx, y: (fy * p[1]) / p[2] + cy, conic: [c / det, -b / det, a / det], reach: Math.sqrt(2 * Math.log(opacity / alphaMin)), sd: [Math.sqrt(a), Math.sqrt(c)], opacity, color });
  }
  splats.sort((s, o) => s.z - o.z);
  const color = new Float64Array(width * height * 3);
  const left = new Float64Array(width * height).fill(1);
  const done = new Uint8Array(width * height);
  for (const s of splats) {
    const box = (at, sd, size) => [Math.max(0, Math.ceil(at - 0.5 - s.reach * sd)), Math.min(size - 1, Math.floor(at - 0.5 + s.reach * sd))];
    const [x0, x1] = box(s.x, s.sd[0], width);
    const [y0, y1] = box(s.y, s.sd[1], height);
    for (let py = y0; py <= y1; py += 1) {
      for (let px = x0; px <= x1; px += 1) {
        const [dx, dy] = [px + 0.5 - s.x, py + 0.5 - s.y];
        const alpha = Math.min(alphaMax, s.opacity * Math.exp(-0.5 * (s.conic[0] * dx * dx + s.conic[2] * dy * dy) - s.conic[1] * dx * dy));
        const at = py * width + px;
        if (alpha < alphaMin || done[at]) continue;
        if (left[at] * (1 - alpha) < tMin) { done[at] = 1; continue; }
        for (let k = 0; k < 3; k += 1) color[3 * at + k] += alpha * left[at] * s.color[k];
        left[at] *= 1 - alpha;
      }
    }
  }
  return color.map((v, i) => Math.min(1, Math.max(0, v + left[Math.floor(i / 3)] * background[i % 3])));
}

/** A WAV file of one channel, 16 bits: a tone. */
export function tone(seconds, frequency = 1000, rate = 48000, level = 0.5) {
  return wav(Float64Array.from({ length: Math.round(seconds * rate) }, (_, i) => level * Math.sin((2 * Math.PI * frequency * i) / rate)), rate);
}

/** @param {ArrayLike<number>} samples -1 to 1 */
export function wav(samples, rate = 48000) {
  const b = Buffer.alloc(44 + 2 * samples.length);
  b.write('RIFF', 0); b.writeUInt32LE(36 + 2 * samples.length, 4); b.write('WAVEfmt ', 8); b.writeUInt32LE(16, 16); b.writeUInt16LE(1, 20); b.writeUInt16LE(1, 22);
  b.writeUInt32LE(rate, 24); b.writeUInt32LE(2 * rate, 28); b.writeUInt16LE(2, 32); b.writeUInt16LE(16, 34); b.write('data', 36); b.writeUInt32LE(2 * samples.length, 40);
  for (let i = 0; i < samples.length; i += 1) b.writeInt16LE(Math.round(32767 * samples[i]), 44 + 2 * i);
  return b;
}

/** Ears of a few directions: below, ahead, left, behind, right, above; responses of four taps. */
export function fewEars() {
  const bytes = Buffer.alloc(8 + 4 * 3 + 4 * 3 + 4 + 4 + 5 + 6 * 2 * 4 * 2);
  bytes.write('IVVEARS1');
  [48000, 4, 3, 1, 4, 1].forEach((n, i) => bytes.writeUInt32LE(n, 8 + 4 * i));
  bytes.writeFloatLE(0.25, 32);
  bytes.writeUInt32LE(5, 36);
  bytes.write('a few', 40);
  for (let k = 0; k < 48; k += 1) bytes.writeInt16LE(k - 8, 45 + 2 * k);
  return bytes;
}
