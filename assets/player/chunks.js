// Which chunks are on the device: fetches those that a moment needs, then those that come next, and gives up those that are far.
import { FormatError } from './bytes.js';
import { GEOMETRY_FLOATS, LOOK_TEXELS } from './decode.js';
import { mayPass } from './source.js';

const MAX_FETCHES = 3;
const ROWS_PER_SLICE = 32;

/**
 * @typedef {'absent' | 'loading' | 'uploading' | 'resident' | 'missed' | 'failed'} ChunkState `missed`: the network did not bring it, and may in the next lap
 * @typedef {object} Slot what is known of a chunk
 * @property {import('./container.js').ChunkEntry} entry
 * @property {ChunkState} state
 * @property {number[]} rows rows of the device that it has
 * @property {AbortController | null} fetch
 */

/** Keeps chunks resident within a budget of rows. */
export class ChunkStore {
  /**
   * @param {import('./source.js').ByteSource} source
   * @param {import('./container.js').Scene} scene
   * @param {{ decoder: Worker, sorter: Worker, rowSlots: number, rows: number }} device
   * @param {(fault: Error) => void} onFault
   */
  constructor(source, scene, device, onFault) {
    this.source = source;
    this.device = device;
    this.onFault = onFault;
    this.duration = scene.header.duration;
    this.lookWords = 4 * LOOK_TEXELS[scene.header.shDegree];
    /** @type {Slot[]} */
    this.slots = scene.chunks.map((entry) => ({ entry, state: 'absent', rows: [], fetch: null }));
    this.free = Array.from({ length: device.rows }, (_, i) => device.rows - 1 - i);
    /** Rows given up, which drawn orders may still name, with the number of the sort that names them no more. */
    this.limbo = /** @type {{ rows: number[], sort: number }[]} */ ([]);
    this.nextSort = 0;
    /** @type {{ id: number, chunk: import('./decode.js').DecodedChunk, done: number }[]} */
    this.uploads = [];
    /** @type {number[]} */
    this.wanted = [];
    this.moments = { sum: 0, first: [0, 0, 0], second: 0, moving: 0 };
    this.uploadMs = 0;
    this.request = '';
    this.moment = 0;
    /** Counts changes of what is resident. */
    this.version = 0;
    device.decoder.onmessage = ({ data }) => this.decoded(data);
  }

  /** Numbers of the chunks that moment `t` needs. @param {number} t seconds */
  needed(t) {
    return this.slots.flatMap(({ entry }, i) => (entry.t0 <= t && t < entry.t1 && entry.count > 0 ? [i] : []));
  }

  /** Whether all that `t` needs is resident or cannot be had. @param {number} t */
  isReady(t) {
    return this.needed(t).every((i) => ['resident', 'missed', 'failed'].includes(this.slots[i].state));
  }

  /**
   * States what is to be shown: moment `t` first, then what begins within `ahead` seconds; over the end where it loops.
   * @param {number} t seconds @param {number} ahead seconds @param {boolean} loops
   */
  want(t, ahead, loops) {
    const request = `${t} ${ahead} ${loops}`;
    const now = this.needed(t);
    if (request === this.request) {
      this.pump(now.length);
      return;
    }
    this.request = request;
    // A jump back by over half the clip is a new lap: the network may have recovered by now. In a shorter one a picture waits while
    // the clip plays on.
    if (this.moment - t > this.duration / 2) this.retry(['missed']);
    this.moment = t;
    /** @param {number} t0 */
    const wait = (t0) => (t0 >= t || !loops ? t0 - t : t0 - t + this.duration);
    const later = this.slots
      .map(({ entry }, i) => ({ i, wait: wait(entry.t0) }))
      .filter(({ i, wait: seconds }) => seconds > 0 && seconds <= ahead && !now.includes(i))
      .sort((a, b) => a.wait - b.wait);
    this.wanted = [...now, ...later.map(({ i }) => i)];
    for (const [i, slot] of this.slots.entries()) {
      if (slot.state === 'loading' && !this.wanted.includes(i)) slot.fetch?.abort();
    }
    this.pump(now.length);
  }

  /** @param {number} urgent how many of `wanted` the moment itself needs */
  pump(urgent) {
    let running = this.slots.filter((slot) => slot.state === 'loading').length;
    for (const [place, i] of this.wanted.entries()) {
      if (running >= MAX_FETCHES) return;
      const slot = this.slots[i];
      if (slot.state !== 'absent') continue;
      const need = Math.ceil(slot.entry.count / this.device.rowSlots);
      const waiting = this.limbo.reduce((n, { rows }) => n + rows.length, 0);
      if (this.free.length < need && this.free.length + waiting >= need) return;
      if (!this.makeRoom(need, place)) {
        if (place >= urgent || this.mayGetRoom(place)) return;
        slot.state = 'failed';
        this.onFault(new FormatError('too-large', 'This moment has more Gaussians than the graphics memory set aside for them. A part is not shown'));
        continue;
      }
      if (this.free.length < need) return;
      slot.rows = this.free.splice(this.free.length - need).reverse();
      running += 1;
      void this.load(i);
    }
  }

  /** Whether rows are yet to come back: given up, or those of chunks on their way that can be given up once they are there. @param {number} place in `wanted` */
  mayGetRoom(place) {
    const first = this.wanted.slice(0, place);
    return this.limbo.length > 0 || this.slots.some(({ state }, i) => (state === 'loading' || state === 'uploading') && !first.includes(i));
  }

  /** Gives up chunks that nobody wants, then those wanted later than this one. @param {number} need rows @param {number} place in `wanted` */
  makeRoom(need, place) {
    const rank = new Map(this.wanted.map((i, at) => [i, at]));
    const candidates = this.slots
      .map(({ state, rows }, i) => ({ i, state, n: rows.length, rank: rank.get(i) ?? this.slots.length }))
      .filter((chunk) => chunk.state === 'resident' && chunk.rank > place)
      .sort((a, b) => b.rank - a.rank);
    let room = this.free.length;
    const given = candidates.filter(({ n }) => {
      const isNeeded = room < need;
      if (isNeeded) room += n;
      return isNeeded;
    });
    if (room < need) return false;
    for (const { i } of given) this.evict(i);
    return true;
  }

  /** @param {number} i */
  evict(i) {
    const slot = this.slots[i];
    this.device.sorter.postMessage({ type: 'evict', id: i });
    this.limbo.push({ rows: slot.rows, sort: this.nextSort });
    slot.rows = [];
    slot.state = 'absent';
    this.version += 1;
  }

  /** An order of this number is drawn from now on. @param {number} id */
  sorted(id) {
    for (const given of this.limbo.filter(({ sort }) => sort <= id)) this.free.push(...given.rows);
    this.limbo = this.limbo.filter(({ sort }) => sort > id);
  }

  /** @param {number} i */
  async load(i) {
    const slot = this.slots[i];
    slot.state = 'loading';
    slot.fetch = new AbortController();
    const { signal } = slot.fetch;
    try {
      const [record, ...bands] = await this.fetch(slot.entry, signal);
      const transfer = [record, ...bands].map(({ buffer }) => buffer);
      this.device.decoder.postMessage({ type: 'decode', id: i, record, bands, count: slot.entry.count }, transfer);
    } catch (error) {
      this.drop(i, signal.aborted ? 'absent' : mayPass(error) ? 'missed' : 'failed');
      if (!signal.aborted) this.onFault(/** @type {Error} */ (error));
    }
  }

  /** A chunk's record and its bands, each in a buffer of its own. @param {Slot['entry']} entry @param {AbortSignal} signal */
  async fetch(entry, signal) {
    const spans = [entry.chunk, ...entry.bands];
    const start = Math.min(...spans.map(({ offset }) => offset));
    const end = Math.max(...spans.map(({ offset, length }) => offset + length));
    const isOneRun = end - start === spans.reduce((n, { length }) => n + length, 0);
    if (!isOneRun) return Promise.all(spans.map(async ({ offset, length }) => (await this.source.read(offset, length, signal)).slice()));
    const bytes = await this.source.read(start, end - start, signal);
    return spans.map(({ offset, length }) => bytes.slice(offset - start, offset - start + length));
  }

  /** @param {any} reply of the decoder */
  decoded(reply) {
    if (reply.type === 'refused') {
      this.drop(reply.id, 'failed');
      this.onFault(new FormatError(reply.code, reply.message));
      return;
    }
    this.slots[reply.id].state = 'uploading';
    this.uploads.push({ id: reply.id, chunk: reply.chunk, done: 0 });
    const { moments } = reply.chunk;
    this.moments.sum += moments.sum;
    this.moments.second += moments.second;
    this.moments.moving += moments.moving;
    this.moments.first = this.moments.first.map((sum, c) => sum + moments.first[c]);
  }

  /** @param {number} i @param {ChunkState} state */
  drop(i, state) {
    this.free.push(...this.slots[i].rows);
    this.slots[i].rows = [];
    this.slots[i].state = state;
  }

  /** Uploads a slice of what waits, or all of it. @param {import('./gl.js').Renderer} renderer @param {boolean} [all] */
  upload(renderer, all = false) {
    const { rowSlots } = this.device;
    const start = performance.now();
    const limit = all ? 2 ** 30 : ROWS_PER_SLICE;
    let budget = limit;
    while (budget > 0 && this.uploads.length > 0) {
      const next = this.uploads[0];
      const slot = this.slots[next.id];
      const { rows, entry: { t0, t1 } } = slot;
      const { geometry, look, sortable, window } = next.chunk;
      // As many rows at once as lie one behind the other.
      let n = 1;
      while (n < budget && next.done + n < rows.length && rows[next.done + n] === rows[next.done] + n) n += 1;
      const [from, to] = [next.done * rowSlots, (next.done + n) * rowSlots];
      renderer.upload(rows[next.done], geometry.subarray(from * GEOMETRY_FLOATS, to * GEOMETRY_FLOATS), look.subarray(from * this.lookWords, to * this.lookWords));
      next.done += n;
      budget -= n;
      if (next.done < rows.length) continue;
      this.uploads.shift();
      const chunk = { t0, t1, sortable, window, rows: Uint32Array.from(rows, (row) => row * rowSlots) };
      this.device.sorter.postMessage({ type: 'load', id: next.id, chunk }, [sortable.buffer, window.buffer]);
      slot.state = 'resident';
      this.version += 1;
    }
    if (budget < limit) this.uploadMs = performance.now() - start;
  }

  /** Tries chunks again that could not be had. @param {ChunkState[]} states */
  retry(states = ['missed', 'failed']) {
    for (const slot of this.slots) if (states.includes(slot.state)) slot.state = 'absent';
  }

  /** Middle and spread of the Gaussians that have been read so far, weighted by opacity. */
  extent() {
    const { sum, first, second } = this.moments;
    const middle = first.map((s) => s / (sum || 1));
    const variance = second / (sum || 1) - middle.reduce((s, m) => s + m * m, 0);
    return { middle, radius: Math.sqrt(Math.max(variance, 1e-12)) };
  }

  /** Spans of time that could play at once, for the time bar: pairs of seconds. */
  buffered() {
    return this.slots.filter((slot) => slot.state === 'resident').map(({ entry }) => [entry.t0, entry.t1]);
  }
}
