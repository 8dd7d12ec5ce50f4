// Chromium's own head, measured through its PannerNode and written as `ivv sound --hrtf` reads it.
import { writeFileSync } from 'node:fs';
import { join } from 'node:path';
import { RATE } from './hearing.mjs';

/** Chromium's responses are this many degrees apart, seen from above, and change in steps. */
const CELL = 1.875;
/** Two directions a cell, none on its edge, so that what lies between two of them is of one cell or the next. */
const AROUND = Array.from({ length: 720 / CELL }, (_, i) => (i / 2 + 0.25) * CELL);
/**
 * Elevations, degrees. Chromium hears a source with the responses of -45, -30, ... 90 degrees, whichever is the next below. Those that
 * the tests need are measured at both ends of their band: -30, 0 (which only level sources hear) and 15.
 */
const ELEVATIONS = [-29, -16, 0, 16, 29];
const DIRECTIONS = [[0, 0], ...ELEVATIONS.flatMap((elevation) => AROUND.map((azimuth) => [azimuth, elevation])), [0, 90], [0, -90]];
/** Directions that are measured at a time. */
const PART = 400;
/** Samples of a direction; those until its impulse, in which Chromium's fade of 2048 samples ends; those that are kept, all others being silent. */
const STEP = 3072;
const SETTLED = 2304;
const HEARD = { from: 240, taps: 384 };

/** Plays an impulse from each direction, [azimuth to the left, elevation] in degrees; stereo responses, one after the other, as base64. Runs in the page. */
async function impulses({ directions, rate, step, settled, from, taps }) {
  const context = new OfflineAudioContext(2, directions.length * step, rate);
  const buffer = context.createBuffer(1, directions.length * step, rate);
  directions.forEach((_, i) => { buffer.getChannelData(0)[i * step + settled] = 1; });
  const panner = new PannerNode(context, { panningModel: 'HRTF', rolloffFactor: 0 });
  const node = new AudioBufferSourceNode(context, { buffer });
  node.connect(panner).connect(context.destination);
  node.start();
  const point = (direction) => {
    const [azimuth, elevation] = direction.map((degrees) => (degrees * Math.PI) / 180);
    panner.positionX.value = -Math.sin(azimuth) * Math.cos(elevation);
    panner.positionY.value = Math.sin(elevation);
    panner.positionZ.value = -Math.cos(azimuth) * Math.cos(elevation);
  };
  point(directions[0]);
  directions.slice(1).forEach((direction, i) => void context.suspend(((i + 1) * step) / rate).then(() => {
    point(direction);
    return context.resume();
  }));
  const heard = await context.startRendering();
  const found = new Float32Array(directions.length * taps * 2);
  for (const ear of [0, 1]) {
    heard.getChannelData(ear).forEach((value, at) => {
      const k = (at % step) - settled - from;
      if (k >= 0 && k < taps) found[2 * (Math.floor(at / step) * taps + k) + ear] = value;
      else if (Math.abs(value) > 1e-5) throw new Error(`a response sounds ${k} samples after the first that is kept`);
    });
  }
  const url = await new Promise((resolve) => {
    const reader = new FileReader();
    reader.onload = () => resolve(reader.result);
    reader.readAsDataURL(new Blob([found]));
  });
  return url.slice(url.indexOf(',') + 1);
}

/**
 * Writes a WAV file for each direction into `folder`. All responses keep the delay that they have in common.
 * @param {(work: Function, options: object) => Promise<string>} evaluate runs a function in a page of Chromium
 * @returns {Promise<number>} level of white noise that comes from straight ahead, dB; a set that the engine has read has 0 there
 */
export async function writeChromiumHead(folder, evaluate) {
  const parts = [];
  for (let i = 0; i < DIRECTIONS.length; i += PART) {
    const directions = DIRECTIONS.slice(i, i + PART);
    parts.push(Buffer.from(await evaluate(impulses, { directions, rate: RATE, step: STEP, settled: SETTLED, ...HEARD }), 'base64'));
  }
  const bytes = Buffer.concat(parts);
  const size = 8 * HEARD.taps;
  const header = Buffer.alloc(44);
  header.write('RIFF', 0); header.writeUInt32LE(36 + size, 4); header.write('WAVEfmt ', 8); header.writeUInt32LE(16, 16); header.writeUInt16LE(3, 20); header.writeUInt16LE(2, 22);
  header.writeUInt32LE(RATE, 24); header.writeUInt32LE(8 * RATE, 28); header.writeUInt16LE(8, 32); header.writeUInt16LE(32, 34); header.write('data', 36); header.writeUInt32LE(size, 40);
  DIRECTIONS.forEach(([azimuth, elevation], i) => {
    writeFileSync(join(folder, `azi_${azimuth}_ele_${elevation}.wav`), Buffer.concat([header, bytes.subarray(i * size, (i + 1) * size)]));
  });
  const ahead = Array.from({ length: 2 * HEARD.taps }, (_, k) => bytes.readFloatLE(4 * k) ** 2);
  return 10 * Math.log10(ahead.reduce((sum, v) => sum + v, 0) / 2);
}
