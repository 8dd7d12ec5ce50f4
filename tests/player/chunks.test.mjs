// Which chunks are fetched, kept and given up, the clock, and the player's views: under node, with a device that only keeps books.
import assert from 'node:assert/strict';
import test from 'node:test';
import { FormatError } from '../../assets/player/bytes.js';
import { ChunkStore } from '../../assets/player/chunks.js';
import { Clock } from '../../assets/player/clock.js';
import { Player } from '../../assets/player/player.js';
import { decodeAll, randomGaussians } from './scenes.mjs';
import { write4dgs } from './write4dgs.mjs';

const ROW_SLOTS = 16;

/** A store of `n` chunks of `seconds` each, and one that lives all the time, on a device of `rows` rows. */
function bookkeeping(n, rows, { fails = () => null } = {}) {
  const entry = (t0, t1, i) => ({ t0, t1, count: 32, chunk: { offset: 100 * i, length: 100 }, bands: [] });
  const chunks = [entry(0, n, 0), ...Array.from({ length: n }, (_, i) => entry(i, i + 1, i + 1))];
  const scene = { header: { duration: n, shDegree: 0 }, chunks };
  const reads = [];
  const source = { size: 1e6, fetched: 0, async read(offset, length, signal) {
    await new Promise((resolve) => setTimeout(resolve, 1));
    signal?.throwIfAborted();
    const fault = fails(offset / 100);
    if (fault) throw fault;
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

test('what the network did not bring leaves a hole until the next lap; what the file has not stays away', async () => {
  let isDown = true;
  let refusals = 0;
  const { store, faults, show, resident } = bookkeeping(4, 100, { fails(i) {
    refusals += i === 3 ? 1 : 0;
    if (i === 3) return new FormatError('changed', 'another file');
    return i === 2 && isDown ? new TypeError('network') : null;
  } });
  // With all of the clip ahead, so that no chunk is ever unwanted.
  const lap = async () => { for (const t of [0.5, 1.5, 2.5, 3.5]) await show(t, 4, true); };
  await lap();
  assert.ok(store.isReady(1.5), 'the clip plays on');
  assert.deepEqual(resident(), [0, 1, 4]);
  isDown = false;
  await show(3.6, 4, true);
  await show(3.4, 4, true);
  assert.deepEqual(resident(), [0, 1, 4], 'a little back is no lap');
  await lap();
  assert.deepEqual(resident(), [0, 1, 2, 4]);
  assert.deepEqual(faults.map(({ message }) => message), ['network', 'another file']);
  assert.equal(refusals, 1);
});

test('a Gaussian alone has its size as extent, and is in view however small', async () => {
  const near = 0.01;
  const player = Object.assign(Object.create(Player.prototype), { up: [0, -1, 0], look: { near } });
  for (const scale of [0.1, 1e-4]) {
    const g = { ...randomGaussians(1, 0), scale: [[scale, scale, scale]] };
    const { chunks } = await decodeAll(write4dgs(g, { duration: 2 }));
    const { store } = bookkeeping(1, 100);
    store.decoded({ type: 'decoded', id: 0, chunk: chunks[0] });
    const { middle, radius } = store.extent();
    assert.ok(radius >= 0.99 * scale && radius < 2 * scale, `${scale}: ${radius}`);
    const { rotation, center } = player.viewOfBall(middle, radius);
    const depth = middle.reduce((sum, x, c) => sum + rotation[6 + c] * (x - center[c]), 0);
    assert.ok(depth - radius > near, `${scale}: ${depth}`);
  }
});

test('a view that differs in one number is drawn', () => {
  const player = Object.assign(Object.create(Player.prototype), { sort: { drawn: 0 }, drawnKey: '', renderer: { draw() {} } });
  const view = { rotation: [1, 0, 0, 0, 1, 0, 0, 0, 1], center: [0, 0, 0], fx: 140, fy: 140, cx: 80, cy: 60, width: 160, height: 120 };
  for (const key of ['fx', 'fy', 'cx', 'cy', 'width', 'height']) {
    player.draw(view, false, 0);
    assert.ok(!player.draw(view, false, 0) && player.draw({ ...view, [key]: 100 }, false, 0), key);
  }
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
