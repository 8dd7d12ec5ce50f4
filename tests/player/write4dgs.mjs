// Writes `.4dgs` files for the tests, with steps so fine that rounding does not matter, and reads 3DGS's PLY.
import { deflateSync } from 'node:zlib';
import { crc32 } from '../../assets/player/bytes.js';

export const MAGIC = Buffer.from([0x89, 0x34, 0x44, 0x47, 0x53, 0x31, 0x0d, 0x0a]);
const STEP = { position: 1e-5, scale: 1e-3, rotation: 1e-5, rgb: 1 / 4080, alpha: 1e-4, motion: 1e-5, time: 1e-4, sigma: 1e-3 };
const SH_0 = 0.28209479177387814;
const REST = [[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]];

const u8 = (n) => Buffer.from([n]);
const u32 = (n) => { const b = Buffer.alloc(4); b.writeUInt32LE(n); return b; };
const u64 = (n) => { const b = Buffer.alloc(8); b.writeBigUInt64LE(BigInt(n)); return b; };
const f64 = (...values) => Buffer.concat(values.map((v) => { const b = Buffer.alloc(8); b.writeDoubleLE(v); return b; }));
const string = (text) => { const b = Buffer.from(text); return Buffer.concat([u32(b.length), b]); };
const map = (object) => { const b = Buffer.concat(Object.entries(object).flatMap(([k, v]) => [string(k), string(v)])); return Buffer.concat([u32(b.length), b]); };
const blob = (b) => Buffer.concat([u64(b.length), b]);
export const record = (opcode, ...parts) => { const b = Buffer.concat(parts); return Buffer.concat([u8(opcode), u64(b.length), b]); };

/** A stream of integers, raw mode, 4 bytes a symbol. */
function stream(id, values, channels, count, level) {
  const planes = Buffer.alloc(values.length * 4);
  values.forEach((value, i) => {
    const symbol = ((value << 1) ^ (value >> 31)) >>> 0;
    for (let j = 0; j < 4; j += 1) planes[j * values.length + i] = symbol >>> (8 * j);
  });
  return Buffer.concat([Buffer.from([id, 4, 0, 0, channels]), u32(count), blob(deflateSync(planes, { level }))]);
}

/**
 * @typedef {object} Gaussians N of them; `sigma` Infinity where static; `sh` N x 3 (coefficients without the constant one), channel by channel
 * @property {number} count @property {number[][]} position @property {number[][]} scale @property {number[][]} rotation xyzw
 * @property {number[][]} color @property {number[]} opacity @property {number[][]} velocity @property {number[]} time @property {number[]} sigma
 * @property {number} shDegree @property {number[][]} sh
 */

/**
 * @param {Gaussians} g @param {{ duration: number, parts?: number, cutoff?: number, ivv?: object, metadata?: object, views?: object, ears?: Buffer, sounds?: object[], index?: boolean, level?: number,
 * packed?: boolean, end?: number, attributes?: object, records?: Buffer[] }} options `end` of the window and of the last chunks, seconds; `attributes` of the header; `records` as they are; `level` of deflate for streams, 0 stores them; `packed`: the streams of a chunk are packed once more together
 */
export function write4dgs(g, { duration, end = duration, parts = 4, attributes = {}, records = [], cutoff = 1 / 255, ivv, metadata = {}, views, ears, sounds = [], index = true, level = 6, packed = false }) {
  const k = Math.sqrt(-2 * Math.log(cutoff));
  const bound = (pick, c) => g.position.reduce((best, p) => pick(best, p[c]), g.position[0]?.[c] ?? 0);
  const origin = [0, 1, 2].map((c) => bound(Math.min, c));
  const all = [...Array(g.count).keys()];
  const bins = (values, step) => values.map((v) => Math.round(v / step));
  const q = all.map((i) => {
    const isStatic = g.sigma[i] === Infinity;
    const sigmaBin = isStatic ? 0 : Math.round(Math.log(g.sigma[i]) / STEP.sigma);
    const sd = Math.exp(sigmaBin * STEP.sigma);
    const half = Math.min(2, Math.max(0.02, isStatic ? duration : k * sd));
    const motionStep = STEP.motion * 2 ** -Math.min(2, Math.max(-4, Math.ceil(Math.log2(half / 0.5))));
    const fine = isStatic ? STEP.time : Math.min(STEP.time, 0.05 * sd);
    const timeStep = STEP.time * 2 ** Math.min(0, Math.max(-10, Math.floor(Math.log2(fine / STEP.time))));
    const norm = Math.hypot(...g.rotation[i]);
    const largest = g.rotation[i].reduce((best, v, c) => (Math.abs(v) > Math.abs(g.rotation[i][best]) ? c : best), 0);
    const sign = Math.sign(g.rotation[i][largest]) / norm;
    const rgb = bins(g.color[i].map((v) => Math.min(1, Math.max(0, v))), STEP.rgb);
    return {
      position: bins(g.position[i].map((v, c) => v - origin[c]), STEP.position), scale: bins(g.scale[i].map(Math.log), STEP.scale),
      largest: [largest], rest: bins(REST[largest].map((c) => g.rotation[i][c] * sign), STEP.rotation),
      rgb: [rgb[1], rgb[0] - rgb[1], rgb[2] - rgb[1]], alpha: bins([g.opacity[i]], STEP.alpha), motion: bins(g.velocity[i], motionStep),
      time: bins([g.time[i]], timeStep), sigma: [sigmaBin], flags: [isStatic ? 1 : 0], window: [0],
    };
  });
  const life = all.map((i) => (g.sigma[i] === Infinity ? [-Infinity, Infinity] : [g.time[i] - k * 1.01 * g.sigma[i], g.time[i] + k * 1.01 * g.sigma[i]]));
  const part = (i) => {
    const [lo, hi] = life[i].map((t) => Math.floor((Math.min(duration - 1e-9, Math.max(0, t)) / duration) * parts));
    return lo === hi ? lo : -1;
  };
  const members = new Map();
  for (const i of all) {
    if (!members.has(part(i))) members.set(part(i), []);
    members.get(part(i)).push(i);
  }
  const out = [MAGIC];
  let at = MAGIC.length;
  const emit = (bytes) => { out.push(bytes); at += bytes.length; return { offset: at - bytes.length, length: bytes.length }; };
  const box = [Math.min, Math.max].flatMap((pick) => [0, 1, 2].map((c) => bound(pick, c)));
  emit(record(0x01, string(''), string('ivv test'), f64(duration), u64(g.count), f64(cutoff), string('gaussian-birth'), f64(...box), u8(g.shDegree), u8(sounds.length ? 1 : 0), map(attributes)));
  const steps = f64(...origin, STEP.position, STEP.scale, STEP.rotation, STEP.rgb, STEP.alpha, STEP.motion, STEP.time, STEP.sigma);
  emit(record(0x03, string('uniform-v1'), steps, u8(1), map({})));
  emit(record(0x04, u32(1), f64(0, end)));
  records.forEach(emit);
  for (const s of sounds) {
    const keys = (s.keys ?? []).map((key) => f64(key.time, ...key.position, 0, 0, 0, 1));
    const flags = (s.spatial === false ? 0 : 1) | (s.loop ? 2 : 0);
    emit(record(0x11, u32(s.id), string(s.name ?? ''), string('wav'), string('mono'), u64(s.data.length), f64(s.start ?? 0, s.duration, s.gain ?? 1),
      u8(flags), f64(...(s.position ?? [0, 0, 0]), 0, 0, 0, 1), u32(keys.length), ...keys, string('linear')));
    emit(record(0x12, u32(s.id), blob(s.data)));
  }
  if (ivv) emit(record(0x0b, string('ivv'), map(ivv)));
  for (const [name, entries] of Object.entries(metadata)) emit(record(0x0b, string(name), map(entries)));
  if (views) emit(record(0x0d, string('views.json'), string('application/json'), blob(Buffer.from(JSON.stringify(views)))));
  if (ears) emit(record(0x0d, string('ears.bin'), string('application/octet-stream'), blob(ears)));
  const entries = [];
  for (const [p, ids] of [...members].sort((a, b) => a[0] - b[0])) {
    const [t0, t1] = p < 0 ? [0, end] : [(p / parts) * duration, p + 1 === parts ? end : ((p + 1) / parts) * duration];
    const names = [['position', 3], ['scale', 3], ['largest', 1], ['rest', 3], ['rgb', 3], ['alpha', 1], ['motion', 3], ['time', 1], ['sigma', 1], ['flags', 1], ['window', 1]];
    const streams = Buffer.concat(names.map(([name, channels], id) => stream(id, ids.flatMap((i) => q[i][name]), channels, ids.length, level)));
    const stored = packed ? deflateSync(streams, { level }) : streams;
    const chunk = emit(record(0x05, f64(t0, t1), u32(0), u32(ids.length), string(packed ? 'deflate' : ''), u64(streams.length), blob(stored)));
    const bands = [1, 2, 3].slice(0, g.shDegree).map((band) => {
      const [from, to] = [[0, 3], [3, 8], [8, 15]][band - 1];
      const n = g.sh[ids[0]].length / 3;
      const bytes = ids.flatMap((i) => [0, 1, 2].flatMap((c) => g.sh[i].slice(c * n + from, c * n + to).map((v) => Math.round(Math.min(255, Math.max(0, ((v + 4) * 255) / 8))))));
      return { band, ...emit(record(0x07, u8(band), stream(7, bytes, 3 * (to - from), ids.length, level))) };
    });
    entries.push({ t0, t1, chunk, count: ids.length, bands });
  }
  const summary = Buffer.concat(index ? entries.map(({ t0, t1, chunk, count, bands }) => record(0x08, f64(t0, t1), u64(chunk.offset), u64(chunk.length),
    u32(count), u32(bands.length), ...bands.flatMap((b) => [u8(b.band), u64(b.offset), u64(b.length)]))) : []);
  const start = emit(summary).offset;
  emit(record(0x02, u64(summary.length ? start : 0), u64(0), u32(summary.length ? crc32(summary) : 0)));
  return Buffer.concat([...out, MAGIC]);
}

/** Reads 3DGS's PLY, with this engine's properties of time, into Gaussians with seconds. @param {Buffer} bytes @param {number} duration seconds */
export function readPly(bytes, duration) {
  const end = bytes.indexOf('end_header\n') + 'end_header\n'.length;
  const header = bytes.subarray(0, end).toString();
  const count = Number(/element vertex (\d+)/.exec(header)[1]);
  const names = [...header.matchAll(/property float (\w+)/g)].map((m) => m[1]);
  const column = new Map(names.map((name, i) => [name, i]));
  const get = (i, name) => bytes.readFloatLE(end + 4 * (i * names.length + column.get(name)));
  const rest = names.filter((name) => name.startsWith('f_rest_')).length;
  const all = [...Array(count).keys()];
  const isDynamic = column.has('t_scale');
  const three = (i, prefix) => [0, 1, 2].map((c) => get(i, `${prefix}${c}`));
  return {
    count, shDegree: Math.sqrt(rest / 3 + 1) - 1,
    position: all.map((i) => ['x', 'y', 'z'].map((c) => get(i, c))), scale: all.map((i) => three(i, 'scale_').map(Math.exp)),
    rotation: all.map((i) => [1, 2, 3, 0].map((c) => get(i, `rot_${c}`))), color: all.map((i) => three(i, 'f_dc_').map((v) => SH_0 * v + 0.5)),
    opacity: all.map((i) => 1 / (1 + Math.exp(-get(i, 'opacity')))), sh: all.map((i) => Array.from({ length: rest }, (_, c) => get(i, `f_rest_${c}`))),
    velocity: all.map((i) => (isDynamic ? three(i, 'velocity_').map((v) => v / duration) : [0, 0, 0])),
    time: all.map((i) => (isDynamic ? get(i, 't_center') * duration : 0)),
    sigma: all.map((i) => (isDynamic && Number.isFinite(get(i, 't_scale')) ? (Math.exp(get(i, 't_scale')) * duration) / Math.SQRT2 : Infinity)),
  };
}

/** Writes Gaussians as 3DGS's PLY with this engine's properties of time. @param {Gaussians} g @param {number} duration seconds; 0: a static scene */
export function writePly(g, duration) {
  const rest = g.sh[0]?.length ?? 0;
  const names = ['x', 'y', 'z', 'nx', 'ny', 'nz', 'f_dc_0', 'f_dc_1', 'f_dc_2', ...Array.from({ length: rest }, (_, i) => `f_rest_${i}`), 'opacity',
    'scale_0', 'scale_1', 'scale_2', 'rot_0', 'rot_1', 'rot_2', 'rot_3', ...(duration ? ['velocity_0', 'velocity_1', 'velocity_2', 't_center', 't_scale'] : [])];
  const rows = [...Array(g.count).keys()].map((i) => [
    ...g.position[i], 0, 0, 0, ...g.color[i].map((v) => (v - 0.5) / SH_0), ...g.sh[i], Math.log(g.opacity[i] / (1 - g.opacity[i])), ...g.scale[i].map(Math.log),
    g.rotation[i][3], ...g.rotation[i].slice(0, 3),
    ...(duration ? [...g.velocity[i].map((v) => v * duration), g.time[i] / duration, g.sigma[i] === Infinity ? 40 : Math.log((g.sigma[i] * Math.SQRT2) / duration)] : []),
  ]);
  const header = ['ply', 'format binary_little_endian 1.0', `element vertex ${g.count}`, ...names.map((name) => `property float ${name}`), 'end_header', ''].join('\n');
  return Buffer.concat([Buffer.from(header), Buffer.from(Float32Array.from(rows.flat()).buffer)]);
}
