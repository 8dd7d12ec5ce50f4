// Which chunks are fetched, kept and given up, and the clock: under node, with a device that only keeps books.
import assert from 'node:assert/strict';
import test from 'node:test';
import { ChunkStore } from '../../assets/player/chunks.js';
import { Clock } from '../../assets/player/clock.js';

const ROW_SLOTS = 16;

/** A store of `n` chunks of `seconds` each, and one that lives all the time, on a device of `rows` rows. */
function bookkeeping(n, rows, { fails = () => false } = {}) {
  const entry = (t0, t1, i) => ({ t0, t1, count: 32, chunk: { offset: 100 * i, length: 100 }, bands: [] });
  const chunks = [entry(0, n, 0), ...Array.from({ length: n }, (_, i) => entry(i, i + 1, i + 1))];
  const scene = { header: { duration: n, shDegree: 0 }, chunks };
  const reads = [];
  const source = { size: 1e6, fetched: 0, async read(offset, length, signal) {
    await new Promise((resolve) => setTimeout(resolve, 1));
    signal?.throwIfAborted();
    if (fails(offset)) throw new TypeError('network');
    reads.push(offset / 100);
    return new Uint8Array(length);
  } };
  const uploads = [];
  const sent = [];
  const moments = { sum: 1, first: [0, 0, 0], second: 1, moving: 1 };
  const decoder = { onmessage: null, postMessage({ id, count }) {
    setTimeout(() => this.onmessage({ data: { type: 'decoded', id, chunk: { count, geometry: new Float32Array(count * 16), look: new Uint32Array(count * 4), sortable: new Float32Array(count * 9), window: new Uint32Array(count), moments } } }), 1);
  } };
  const sorter = { postMessage: (message) => sent.push(message) };
  const faults = [];
  const store = new ChunkStore(source, scene, { decoder, sorter, rowSlots: ROW_SLOTS, rows }, (fault) => faults.push(fault));
  const renderer = { upload: (row, geometry) => uploads.push({ row, rows: geometry.length / 16 / ROW_SLOTS }) };
  /** Shows moment `t` until nothing changes any more. */
  const show = async (t, ahead = 0, loops = false) => {
    for (let i = 0; i < 60; i += 1) {
      store.want(t, ahead, loops);
      store.upload(renderer);
      store.nextSort += 1;
      store.sorted(store.nextSort - 1);
      await new Promise((resolve) => setTimeout(resolve, 1));
    }
  };
  const resident = () => store.slots.flatMap(({ state }, i) => (state === 'resident' ? [i] : []));
  return { store, reads, faults, sent, uploads, show, resident };
}

test('a moment fetches its own chunks, and those ahead only while it plays', async () => {
  const { store, reads, show, resident, uploads } = bookkeeping(8, 100);
  await show(0.5);
  assert.deepEqual(resident(), [0, 1]);
  await show(5.5);
  assert.deepEqual(reads, [0, 1, 6]);
  await show(5.5, 1, false);
  assert.deepEqual(resident(), [0, 1, 6, 7]);
  await show(7.5, 1.2, true);
  assert.deepEqual(resident(), [0, 1, 2, 6, 7, 8].filter((i) => i !== 2));
  assert.equal(uploads.reduce((n, { rows }) => n + rows, 0), 2 * resident().length);
  assert.ok(store.isReady(7.5) && !store.isReady(3.5));
});

test('memory stays within its rows: what is far is given up, and its rows are used again only after a new order', async () => {
  const { store, show, resident, sent, faults } = bookkeeping(8, 8);
  for (let t = 0.5; t < 8; t += 1) {
    await show(t, 1.5);
    assert.ok(resident().length <= 4 && store.isReady(t), `${resident()} at ${t}`);
  }
  const used = store.slots.flatMap(({ rows }) => rows);
  assert.equal(new Set(used).size, used.length);
  assert.equal(used.length + store.free.length, 8);
  assert.ok(sent.some(({ type }) => type === 'evict'));
  assert.deepEqual(faults, []);
  store.evict(resident()[1]);
  assert.equal(store.limbo.length, 1);
  const before = store.free.length;
  store.sorted(store.nextSort - 1);
  assert.equal(store.free.length, before, 'rows came back before an order without them');
  store.sorted(store.nextSort);
  assert.equal(store.free.length, before + 2);
});

test('a moment that does not fit is said, once, and the rest is shown', async () => {
  const { store, faults, show } = bookkeeping(4, 3);
  await show(0.5);
  assert.ok(store.isReady(0.5));
  assert.equal(faults.length, 1);
  assert.equal(faults[0].code, 'too-large');
});

test('a moment waits for the rows of one that was left while it loaded', async () => {
  const { store, faults, show, resident } = bookkeeping(8, 4);
  await show(0.5);
  store.want(1.5, 0, false); // gives up the chunk of 0.5
  store.nextSort += 1;
  store.sorted(store.nextSort - 1);
  store.want(1.5, 0, false);
  assert.equal(store.slots[2].state, 'loading');
  store.want(2.5, 0, false);
  assert.deepEqual(faults, []);
  await show(2.5);
  assert.deepEqual(resident(), [0, 3]);
});

test('chunks on the way that nobody wants any more are let go', async () => {
  const { store, reads } = bookkeeping(8, 100);
  store.want(0.5, 0, false);
  store.want(6.5, 0, false);
  await new Promise((resolve) => setTimeout(resolve, 20));
  assert.ok(!reads.includes(1) && store.slots[1].state === 'absent', `${reads}`);
});

test('the clock loops, ends, changes speed without a jump, and counts no time while it waits', () => {
  let now = 100;
  const clock = new Clock(4, () => now);
  clock.set({ playing: true });
  now += 1;
  assert.equal(clock.time(), 1);
  clock.set({ speed: 2 });
  assert.equal(clock.time(), 1);
  now += 2;
  assert.equal(clock.time(), 1);
  assert.equal(clock.elapsed(), 5);
  clock.set({ loop: false, time: 3 });
  now += 3;
  assert.ok(clock.hasEnded() && clock.time() < 4 && clock.time() > 3.999);
  clock.set({ playing: false, time: 2 });
  now += 5;
  assert.equal(clock.time(), 2);
  clock.set({ playing: true, speed: 1, lead: 0.5 });
  now += 0.25;
  assert.equal(clock.time(), 2);
  now += 0.5;
  assert.equal(clock.time(), 2.25);
});
