// The ears that a file may bring: responses to directions on a grid, in place of those that the browser has.
import { Cursor, FormatError } from './bytes.js';

/** Name of their attachment, and samples per second of all responses. */
export const EARS = 'ears.bin';
export const EARS_RATE = 48000;
const FADE_SECONDS = 0.02;
const MAX_EARS = 1 << 26;

/**
 * @typedef {object} Ears
 * @property {number} taps of a response
 * @property {number[]} rows directions of each row of the grid: elevations from below to above, azimuths from the front to the left and round
 * @property {number} step value of a step of `samples`
 * @property {Int16Array} samples by direction: the taps of the left ear, then those of the right
 */

/** Reads ears; refuses those that are damaged. @param {Uint8Array} bytes @returns {Ears} */
export function readEars(bytes) {
  const c = new Cursor(bytes, 'ears');
  const magic = String.fromCharCode(...c.slice(8));
  const [rate, taps] = [c.u32(), c.u32()];
  if (magic !== 'IVVEARS1' || rate !== EARS_RATE || taps === 0) {
    throw new FormatError('bad-ears', `ears: expected IVVEARS1 with responses of ${EARS_RATE} samples a second, found "${magic}" with ${taps} taps of ${rate}`);
  }
  const rows = Array.from({ length: c.count(4, 'rows') }, () => c.u32());
  const step = c.view.getFloat32(c.take(4), true);
  c.string();
  const size = 4 * taps * rows.reduce((sum, n) => sum + n, 0);
  if (rows.length === 0 || rows.includes(0) || !(step > 0 && step < 1e3) || c.left !== size) {
    throw new FormatError('bad-ears', `ears: expected ${rows.length} rows of directions, ${size} bytes of responses and a positive step, found ${c.left} bytes and ${step}`);
  }
  return { taps, rows, step, samples: new Int16Array(new Uint8Array(bytes.subarray(c.at)).buffer) };
}

/** Number of the direction of a grid that is nearest. @param {Pick<Ears, 'rows'>} ears @param {number[]} direction in Web Audio's axes */
export function nearestDirection({ rows }, [x, y, z]) {
  const row = Math.round((Math.atan2(y, Math.hypot(x, z)) / Math.PI + 0.5) * (rows.length - 1));
  const turn = Math.round((Math.atan2(-x, -z) / (2 * Math.PI)) * rows[row]);
  return rows.slice(0, row).reduce((sum, n) => sum + n, (turn + rows[row]) % rows[row]);
}

/** Both ears' hearing of one source: two convolvers, of which one takes over from the other when the direction changes. */
export class EarPair {
  /** @param {BaseAudioContext} context @param {Ears} ears @param {AudioNode} input @param {AudioNode} output */
  constructor(context, ears, input, output) {
    this.context = context;
    this.ears = ears;
    this.sides = [0, 1].map(() => {
      const convolver = new ConvolverNode(context, { disableNormalization: true });
      const gain = new GainNode(context, { gain: 0 });
      input.connect(convolver).connect(gain).connect(output);
      return { convolver, gain };
    });
    this.direction = -1;
    this.fadedAt = 0;
  }

  /** Turns to where the source is; while one turn fades, the next waits. @param {number[]} to in Web Audio's axes */
  point(to) {
    const { context, ears: { taps, samples, step }, sides } = this;
    const now = context.currentTime;
    const direction = nearestDirection(this.ears, to);
    if (direction === this.direction || now < this.fadedAt) return;
    const buffer = context.createBuffer(2, taps, EARS_RATE);
    for (const ear of [0, 1]) buffer.copyToChannel(Float32Array.from(samples.subarray((2 * direction + ear) * taps, (2 * direction + ear + 1) * taps), (x) => x * step), ear);
    this.fadedAt = this.direction < 0 ? now : now + FADE_SECONDS;
    this.direction = direction;
    sides.reverse();
    sides[0].convolver.buffer = buffer;
    sides.forEach(({ gain }, i) => gain.gain.setValueAtTime(i, now).linearRampToValueAtTime(1 - i, this.fadedAt));
  }
}

/** The ears of a scene's file, or null where it has none. @param {import('./source.js').ByteSource} file @param {import('./container.js').Scene} scene */
export async function earsOf(file, scene) {
  const data = scene.attachments.find(({ name }) => name === EARS)?.data;
  if (!data) return null;
  if (data.length > MAX_EARS) throw new FormatError('bad-ears', `ears: expected at most ${MAX_EARS} bytes, found ${data.length}`);
  return readEars(await file.read(data.offset, data.length));
}
