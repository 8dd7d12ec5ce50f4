// The live Gaussians of a moment in the order in which they are drawn. Runs in a worker, or under node.
import { SORT_FLOATS } from './decode.js';
import { ORDER_WIDTH } from './shaders.js';

const DIGIT = 11;
const BINS = 1 << DIGIT;

/**
 * @typedef {object} Resident a chunk whose Gaussians lie on the device
 * @property {number} t0
 * @property {number} t1
 * @property {Float32Array} sortable N x 9, see decode.js
 * @property {Uint32Array} window N
 * @property {Uint32Array} rows first slot of each run of `rowSlots` Gaussians
 */

/** Keeps the centres of resident chunks and sorts those that live. */
export class Sorter {
  /** @param {Float64Array} windows pairs lo, hi @param {number} rowSlots slots of a row of the device's textures */
  constructor(windows, rowSlots) {
    this.windows = windows;
    this.rowSlots = rowSlots;
    /** @type {Map<number, Resident>} */
    this.chunks = new Map();
    this.keys = new Uint32Array(0);
    this.spare = [new Uint32Array(0), new Uint32Array(0)];
    this.float = new Float32Array(1);
    this.bits = new Uint32Array(this.float.buffer);
  }

  /**
   * Slots of the Gaussians that live at `t`, the farthest along `axis` first.
   * @param {number} t seconds @param {number[]} axis forward axis of the view, world, and its offset: depth = axis . centre + offset
   * @param {Uint32Array} [out] is reused where it is large enough
   * @returns {{ order: Uint32Array, count: number }} the order fills whole rows of its texture
   */
  sort(t, axis, out = new Uint32Array(0)) {
    const alive = [...this.chunks.values()].filter((chunk) => chunk.t0 <= t && t < chunk.t1);
    this.reserve(alive.reduce((n, chunk) => n + chunk.window.length, 0));
    let count = 0;
    for (const chunk of alive) count = this.gather(chunk, t, axis, count);
    const order = out.length >= count ? out : new Uint32Array(Math.ceil((count * 1.25) / ORDER_WIDTH) * ORDER_WIDTH);
    return { order: this.radix(count, order), count };
  }

  /** @param {number} n */
  reserve(n) {
    if (this.keys.length >= n) return;
    this.keys = new Uint32Array(n);
    this.slots = new Uint32Array(n);
    this.spare = [new Uint32Array(n), new Uint32Array(n)];
  }

  /** Adds the live Gaussians of a chunk. @param {Resident} chunk @param {number} t @param {number[]} axis @param {number} count so far */
  gather(chunk, t, axis, count) {
    const { sortable, window, rows } = chunk;
    const slots = /** @type {Uint32Array} */ (this.slots);
    const [ax, ay, az, offset] = axis;
    for (let i = 0, at = 0; i < window.length; i += 1, at += SORT_FLOATS) {
      const dt = t - sortable[at + 6];
      const u = dt * sortable[at + 7];
      if (!(u * u <= sortable[at + 8])) continue;
      const w = 2 * window[i];
      if (t < this.windows[w] || t >= this.windows[w + 1]) continue;
      const x = sortable[at] + dt * sortable[at + 3];
      const y = sortable[at + 1] + dt * sortable[at + 4];
      const z = sortable[at + 2] + dt * sortable[at + 5];
      this.float[0] = ax * x + ay * y + az * z + offset;
      const bits = this.bits[0];
      // Order of floats as integers, reversed: the farthest gets the smallest key.
      this.keys[count] = bits & 0x80000000 ? bits : ~bits & 0x7fffffff;
      slots[count] = rows[Math.floor(i / this.rowSlots)] + (i % this.rowSlots);
      count += 1;
    }
    return count;
  }

  /** Sorts by all 32 bits of the keys, three digits of eleven. @param {number} count @param {Uint32Array} order out */
  radix(count, order) {
    const [spareKeys, spareSlots] = this.spare;
    const slots = /** @type {Uint32Array} */ (this.slots);
    scatter(this.keys, slots, spareKeys, spareSlots, count, 0);
    scatter(spareKeys, spareSlots, this.keys, slots, count, DIGIT);
    scatter(this.keys, slots, spareKeys, order, count, 2 * DIGIT);
    return order;
  }
}

/**
 * One stable pass. @param {Uint32Array} keys @param {Uint32Array} values @param {Uint32Array} outKeys @param {Uint32Array} outValues
 * @param {number} count @param {number} shift
 */
function scatter(keys, values, outKeys, outValues, count, shift) {
  const place = new Uint32Array(BINS);
  for (let i = 0; i < count; i += 1) place[(keys[i] >>> shift) & (BINS - 1)] += 1;
  for (let bin = 0, sum = 0; bin < BINS; bin += 1) {
    const n = place[bin];
    place[bin] = sum;
    sum += n;
  }
  for (let i = 0; i < count; i += 1) {
    const bin = (keys[i] >>> shift) & (BINS - 1);
    const to = place[bin];
    place[bin] += 1;
    outKeys[to] = keys[i];
    outValues[to] = values[i];
  }
}
