// What a head hears: poses around a source, the same by `ivv sound render`, and the differences between two ears.
import { execFileSync } from 'node:child_process';
import { mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { openScene } from '../../assets/player/container.js';
import { EARS } from '../../assets/player/ears.js';
import { memorySource } from '../../assets/player/source.js';
import { random, wav } from './scenes.mjs';

export const RATE = 48000;
/** Seconds that a pose lasts, and those of them that are looked at: what is before has faded by then. */
export const POSE_SECONDS = 0.5;
const HEARD = [0.15, 0.48];
/** Time between the ears is told by what lies below this, hertz, as people do. */
const CUT = 1500;
const CUT_TAPS = 257;
const MOST_LAG = 60;

/** A listener at `center` that is turned by degrees to the right; x is right, y down, z ahead. */
export function listener(center, yaw) {
  const [s, c] = [Math.sin((yaw * Math.PI) / 180), Math.cos((yaw * Math.PI) / 180)];
  return { rotation: [c, 0, -s, 0, 1, 0, s, 0, c], center, yaw };
}

/** Degrees from where a listener looks to `source`, seen from above, left positive. */
export function azimuth(source, { rotation, center }) {
  const [x, , z] = [0, 1, 2].map((row) => source.reduce((sum, p, c) => sum + (p - center[c]) * rotation[3 * row + c], 0));
  return (Math.atan2(-x, z) * 180) / Math.PI;
}

/** `n` samples of white noise. */
export function noise(n, seed = 11, level = 0.1) {
  const next = random(seed);
  return Array.from({ length: n }, () => level * (2 * next() - 1));
}

/**
 * What `ivv sound render` makes of noise at `source`, recorded at the origin, for one listener after the other.
 * @returns {{ left: Float64Array, right: Float64Array }}
 */
export function engineHears(samples, source, listeners, hrtf) {
  const folder = mkdtempSync(join(tmpdir(), 'ivv-hearing-'));
  try {
    const at = (name) => join(folder, name);
    writeScene(folder, samples, source);
    const line = ({ center, yaw }, i) => [0.001, POSE_SECONDS].map((t) => [i * POSE_SECONDS + t, ...center, 0, Math.sin((yaw * Math.PI) / 360), 0, Math.cos((yaw * Math.PI) / 360)].join(' '));
    writeFileSync(at('path.txt'), `${listeners.flatMap(line).join('\n')}\n`);
    execFileSync(process.env.IVV, ['sound', 'render', at('scene.json'), '--path', at('path.txt'), '--mode', 'paper3d', '--hrtf', hrtf, '--float', '-o', at('heard.wav')]);
    return readStereo(readFileSync(at('heard.wav')));
  } finally {
    rmSync(folder, { recursive: true });
  }
}

/** The attachment of ears that `ivv export --hrtf` puts into a file. */
export async function exportedEars(hrtf) {
  const folder = mkdtempSync(join(tmpdir(), 'ivv-ears-'));
  try {
    writeScene(folder, noise(RATE / 10), [0, 0, 2]);
    const ply = fileURLToPath(new URL('../../assets/demo/scene.ply', import.meta.url));
    const to = join(folder, 'scene.4dgs');
    execFileSync(process.env.IVV, ['export', ply, '-o', to, '--seconds', '1', '--sound', join(folder, 'scene.json'), '--hrtf', hrtf, '--clamp-colors'], { stdio: 'pipe' });
    const bytes = readFileSync(to);
    const { data } = (await openScene(memorySource(bytes))).attachments.find(({ name }) => name === EARS);
    return bytes.subarray(data.offset, data.offset + data.length);
  } finally {
    rmSync(folder, { recursive: true });
  }
}

/** Writes scene.json with a source that stays, its way and its recording. */
export function writeScene(folder, samples, source) {
  writeFileSync(join(folder, 'mic.wav'), wav(samples));
  const row = (t) => [t, ...source, 0, 0, 0, 0, 0, 0, 4, 0, 'seen'].join(',');
  writeFileSync(join(folder, 'p0.csv'), `t,x,y,z,cxx,cxy,cxz,cyy,cyz,czz,views,reproj_px,flag\n${row(0)}\n${row(samples.length / RATE)}\n`);
  writeFileSync(join(folder, 'scene.json'), JSON.stringify({
    version: 1, metres_per_unit: 1, up: [0, -1, 0], sources: [{ id: 'p0', track: 'p0.csv' }],
    mic: { camera: 'a', wav: 'mic.wav', poses: [{ t: 0, p: [0, 0, 0], forward: [0, 0, 1] }] },
  }));
}

/** Both channels of a WAV file of 32 bit floats. @param {Buffer} bytes */
function readStereo(bytes) {
  let at = 12;
  while (bytes.toString('latin1', at, at + 4) !== 'data') at += 8 + bytes.readUInt32LE(at + 4);
  const n = bytes.readUInt32LE(at + 4) / 8;
  const channel = (c) => Float64Array.from({ length: n }, (_, i) => bytes.readFloatLE(at + 8 + 8 * i + 4 * c));
  return { left: channel(0), right: channel(1) };
}

/** By pose: by how many decibels the left ear hears it louder, by how many microseconds earlier, and how loud both are, dB. */
export function cues({ left, right }, n) {
  return Array.from({ length: n }, (_, i) => {
    const [from, to] = HEARD.map((t) => Math.round((i * POSE_SECONDS + t) * RATE));
    const ears = [left, right].map((x) => x.slice(from, to));
    const energy = ears.map((x) => x.reduce((sum, v) => sum + v * v, 0));
    return { ild: 10 * Math.log10(energy[0] / energy[1]), itd: lead(ears[0], ears[1]), level: 10 * Math.log10((energy[0] + energy[1]) / (to - from)) };
  });
}

const LOW_PASS = Float64Array.from({ length: CUT_TAPS }, (_, k) => {
  const x = k - (CUT_TAPS - 1) / 2;
  const turn = (2 * Math.PI * CUT * x) / RATE;
  return ((x === 0 ? 1 : Math.sin(turn) / turn) * (1 + Math.cos((2 * Math.PI * x) / CUT_TAPS)) * CUT) / RATE;
});

/** Microseconds by which `a` comes before `b`, by the highest correlation of what lies below 1.5 kHz. */
function lead(a, b) {
  const [low, other] = [a, b].map((x) => Float64Array.from({ length: x.length - CUT_TAPS }, (_, i) => LOW_PASS.reduce((sum, h, k) => sum + h * x[i + k], 0)));
  const correlation = (lag) => {
    let sum = 0;
    for (let i = MOST_LAG; i < low.length - MOST_LAG; i += 1) sum += low[i] * other[i + lag];
    return sum;
  };
  const all = Array.from({ length: 2 * MOST_LAG + 1 }, (_, k) => correlation(k - MOST_LAG));
  const best = all.reduce((at, v, k) => (v > all[at] ? k : at), 1);
  const [before, here, after] = [-1, 0, 1].map((d) => all[Math.min(2 * MOST_LAG, Math.max(0, best + d))]);
  return ((best - MOST_LAG + (0.5 * (before - after)) / (before - 2 * here + after)) / RATE) * 1e6;
}

const TURN = 15;
/** Listeners that look round a circle, so that what lies ahead of a head that is not turned comes from -180 to 180 degrees. */
export const CIRCLE = Array.from({ length: 360 / TURN + 1 }, (_, k) => listener([0, 0, 0], TURN * k - 180));

/**
 * The azimuth, degrees, that ears mean by a time between them, by cues of `CIRCLE` with a source ahead of the head that is not turned.
 * It is ahead or behind as `near` is, which a time alone does not tell.
 */
export function azimuthOf(itd, circle, near) {
  const points = CIRCLE.map(({ yaw }, i) => ({ angle: yaw, itd: circle[i].itd }));
  const half = points.filter(({ angle }) => (Math.abs(near) <= 90 ? Math.abs(angle) <= 90 : near * angle >= 0 && Math.abs(angle) >= 90));
  const found = half.slice(1).map((b, i) => [half[i], b]).filter(([a, b]) => (itd - a.itd) * (itd - b.itd) <= 0);
  const angles = found.map(([a, b]) => a.angle + ((itd - a.itd) / (b.itd - a.itd)) * (b.angle - a.angle));
  const widest = half.reduce((best, p) => (p.itd * Math.sign(itd) > best.itd * Math.sign(itd) ? p : best));
  return angles.reduce((best, angle) => (Math.abs(angle - near) < Math.abs(best - near) ? angle : best), angles[0] ?? widest.angle);
}
