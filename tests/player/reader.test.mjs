// The reader against the format's fixtures and against files that this folder writes.
import assert from 'node:assert/strict';
import { existsSync, readdirSync, readFileSync } from 'node:fs';
import { basename, join } from 'node:path';
import test from 'node:test';
import { fileURLToPath } from 'node:url';
import { crc32, FormatError } from '../../assets/player/bytes.js';
import { Clock } from '../../assets/player/clock.js';
import { lastMoment, soundPosition } from '../../assets/player/container.js';
import { SH_COEFFICIENTS } from '../../assets/player/decode.js';
import { Sorter } from '../../assets/player/sorter.js';
import { base64Bytes, memorySource, openUrl } from '../../assets/player/source.js';
import { decodeAll, randomGaussians } from './scenes.mjs';
import { MAGIC, record, write4dgs } from './write4dgs.mjs';

const FIXTURES = process.env.IVV_4DGS_FIXTURES ?? fileURLToPath(new URL('../../../shared/data/4dgs_fixtures', import.meta.url));
const SKIP = existsSync(FIXTURES) ? false : `${FIXTURES} is not there`;
const list = (folder) => (SKIP ? [] : readdirSync(join(FIXTURES, folder)).filter((name) => name.endsWith('.4dgs')).map((name) => join(FIXTURES, folder, name)));
const jsonOf = (path) => path.replace(/4dgs$/, 'json');
const near = (a, b, tolerance, what) => assert.ok(Math.abs(a - b) <= tolerance, `${what}: expected ${b}, found ${a}`);

const isTracked = (error) => error.code === 'unsupported-tracks' && /without tracks of objects/.test(error.message);

test('every gaussian-birth fixture reads as its JSON says, but for those whose objects tracks move', { skip: SKIP }, async () => {
  const paths = list('.').filter((path) => existsSync(jsonOf(path)));
  assert.ok(paths.length >= 28, `found ${paths.length} fixtures`);
  for (const path of paths) {
    const expected = JSON.parse(readFileSync(jsonOf(path)));
    if (expected.objects?.tracks.length > 0) await assert.rejects(decodeAll(readFileSync(path)), isTracked, basename(path));
    else await checkFixture(path, expected);
  }
});

async function checkFixture(path, expected) {
  const name = basename(path);
  const { scene, gaussians: g } = await decodeAll(readFileSync(path));
  assert.equal(String(scene.header.count), expected.gaussianCount, name);
  assert.equal(g.count, scene.header.count, name);
  assert.equal(scene.header.duration, expected.durationSec, name);
  assert.equal(scene.header.cutoff, expected.cutoff, name);
  assert.equal(scene.header.shDegree, expected.shDegree, name);
  assert.deepEqual(Object.fromEntries(scene.header.attributes), expected.headerAttributes, name);
  if (expected.chunkIntervals.length) assert.deepEqual(scene.chunks.map(({ t0, t1 }) => [t0, t1]), expected.chunkIntervals, name);
  const metadata = [...scene.metadata].map(([key, entries]) => ({ name: key, entries: Object.fromEntries(entries) }));
  assert.deepEqual(metadata, expected.metadataRecords.map(({ name: key, entries }) => ({ name: key, entries })), name);
  const { aggregate, sample } = expected;
  near(g.opacity.reduce((a, b) => a + b, 0), aggregate.opacitySum, 1e-3, name);
  for (let c = 0; c < 3; c += 1) near(g.position.reduce((sum, p) => sum + p[c], 0), aggregate.positionSum[c], 1e-3, name);
  assert.equal(String(g.sigma.filter((s) => s === Infinity).length), aggregate.neverFadesCount, name);
  assert.equal(String(g.velocity.filter((v) => v.every((x) => x === 0)).length), aggregate.zeroMotionCount, name);
  checkSample(g, sample, name);
  if (expected.sh) assert.equal(SH_COEFFICIENTS[scene.header.shDegree], Number(expected.sh.coefficients), name);
  assert.equal(scene.sounds.length, expected.audioSources.length, name);
  for (const [i, sound] of expected.audioSources.entries()) await checkSound(readFileSync(path), scene.sounds[i], sound, scene.header.duration, name);
  if (expected.camera) {
    assert.deepEqual(scene.camera, { fovY: expected.camera.fovYDeg, position: expected.camera.position, target: expected.camera.target }, name);
  }
  const frame = expected.provenance?.frames[0];
  if (frame) assert.deepEqual(scene.frame, { handedness: frame.handedness, upAxis: frame.upAxis, metresPerUnit: frame.metresPerUnit }, name);
}

/** Finds each Gaussian of the sample by its values: files keep no order. */
function checkSample(g, sample, name) {
  const rows = (sample.positions ?? []).map((_, k) => [
    ...sample.positions[k], ...sample.scales[k], ...sample.colors[k], ...sample.motions[k], sample.muT[k], sample.sigmaT[k] ?? Infinity, sample.winLo[k], sample.winHi[k],
  ]);
  const mine = [...Array(g.count).keys()].map((i) => [
    ...g.position[i], ...g.scale[i], ...g.color[i], g.opacity[i], ...g.velocity[i], g.time[i], g.sigma[i], ...g.window[i],
  ]);
  const close = (a, b) => a === b || Math.abs(a - b) <= 2e-5 + 2e-5 * Math.abs(b);
  for (const [k, row] of rows.entries()) {
    const found = mine.findIndex((values, i) => values.every((v, c) => close(v, row[c])) && sample.rotations[k].every((v, c) => close(g.rotation[i][c], v)));
    assert.notEqual(found, -1, `${name}: Gaussian ${k} of the sample is not among those read`);
  }
}

async function checkSound(bytes, sound, expected, duration, name) {
  const data = bytes.subarray(sound.data.offset, sound.data.offset + sound.data.length);
  assert.equal(String(sound.id), expected.sourceId, name);
  assert.equal(String(data.length), expected.byteLength, name);
  assert.equal(String(crc32(data)), expected.crc, name);
  for (const key of ['name', 'codec', 'gain', 'spatial', 'loop', 'position']) assert.deepEqual(sound[key], expected[key], `${name}: ${key}`);
  assert.equal(sound.start, expected.startSec, name);
  assert.equal(sound.duration, expected.durationSec, name);
  soundPosition(sound, duration / 2).forEach((p, c) => near(p, expected.stateAtHalf.position[c], 1e-6, `${name}: position at half time`));
}

test('the bytes of spherical harmonics are those of the fixture', { skip: SKIP }, async () => {
  let n = 0;
  for (const path of list('.').filter((p) => existsSync(jsonOf(p)))) {
    const { sh } = JSON.parse(readFileSync(jsonOf(path)));
    if (!sh) continue;
    const { gaussians: g } = await decodeAll(readFileSync(path));
    // The sum goes over Gaussians in the order of their positions, channel by channel.
    const order = [...Array(g.count).keys()].sort((a, b) => compare(keyOf(g, a), keyOf(g, b)));
    const bytes = Buffer.concat(order.map((i) => Buffer.from(g.shBytes[i])));
    assert.equal(String(crc32(bytes)), sh.crc, basename(path));
    n += 1;
  }
  assert.ok(n >= 6);
});

const keyOf = (g, i) => [...g.position[i], g.time[i]];
const compare = (a, b) => { const c = a.findIndex((v, i) => v !== b[i]); return c < 0 ? 0 : a[c] - b[c]; };

test('fixtures that have to be refused are refused by name', { skip: SKIP }, async () => {
  const paths = list('invalid');
  assert.ok(paths.length >= 4);
  for (const path of paths) {
    await assert.rejects(decodeAll(readFileSync(path)), (error) => error instanceof FormatError && error.code === JSON.parse(readFileSync(jsonOf(path))).refused, basename(path));
  }
  for (const path of list('.').filter((p) => /Keyframe/.test(p))) {
    await assert.rejects(decodeAll(readFileSync(path)), (error) => error.code === 'unknown-temporal-model' && /keyframe-delta/.test(error.message), basename(path));
  }
  await assert.rejects(decodeAll(readFileSync(join(FIXTURES, 'ObjectTrackComposed-UseChunkIndex-UseCrc.4dgs'))), isTracked);
});

test('an object that a track moves is refused, a track without samples is none', async () => {
  for (const samples of [0, 1]) {
    const content = Buffer.alloc(9 + 64 * samples);
    content.writeUInt32LE(7, 0);
    content.writeUInt32LE(samples, 5);
    const read = decodeAll(write4dgs(randomGaussians(5, 0), { duration: 2, records: [record(0x25, content)] }));
    if (samples === 0) assert.equal((await read).gaussians.count, 5);
    else await assert.rejects(read, (error) => error.code === 'unsupported-tracks' && /object 7/.test(error.message));
  }
});

/** A file of a scene with a Coordinate Frame, or with none, and with attributes of the header. */
function framed({ handedness = 1, unit = 0, metres = 0 } = {}, attributes = {}, hasFrame = true) {
  const content = Buffer.alloc(16);
  content.set([handedness, 1, 2, unit], 4);
  content.writeDoubleLE(metres, 8);
  return write4dgs(randomGaussians(5, 0), { duration: 2, attributes, records: hasFrame ? [record(0x20, content)] : [] });
}

test('a unit of a scene is as long as its number says, or else its name', async () => {
  for (const [unit, metres, expected] of [[1, 0, 1], [2, 0, 0.01], [5, 0, 0.3048], [6, 0, 0.0254], [2, 0.5, 0.5], [0, 0, 0], [200, 0, 0]]) {
    const { scene } = await decodeAll(framed({ unit, metres }));
    assert.deepEqual(scene.frame, { handedness: 1, upAxis: 1, metresPerUnit: expected }, `unit ${unit}, ${metres} m`);
  }
});

test('left-handed axes are refused: by the record, or by the text where there is none', async () => {
  const text = { coordinate_system: 'y-up-left-handed' };
  for (const bytes of [framed({ handedness: 2 }), framed({ handedness: 2 }, { coordinate_system: 'y-up-right-handed' }), framed({}, text, false)]) {
    await assert.rejects(decodeAll(bytes), (error) => error.code === 'unsupported-axes' && /left-handed/.test(error.message));
  }
  for (const bytes of [framed({ handedness: 1 }, text), framed({ handedness: 0 }, text), framed({}, { coordinate_system: 'y-up-right-handed' }, false)]) {
    assert.equal((await decodeAll(bytes)).gaussians.count, 5);
  }
});

test('the last moment has Gaussians where windows and chunks end at the nearest single below the duration', async () => {
  const duration = 3.3;
  const end = Math.fround(duration);
  assert.ok(end < duration);
  const { scene, chunks } = await decodeAll(write4dgs(randomGaussians(300, 0, 1, duration), { duration, end }));
  const sorter = new Sorter(scene.windows, 64);
  chunks.forEach((chunk, id) => {
    const rows = Uint32Array.from({ length: Math.ceil(chunk.count / 64) }, (_, r) => r * 64);
    sorter.chunks.set(id, { ...scene.chunks[id], sortable: chunk.sortable, window: chunk.window, rows });
  });
  const clock = new Clock(duration, () => 0);
  clock.set({ time: duration, loop: false });
  for (const t of [lastMoment(scene), clock.time()]) {
    assert.ok(t > duration - 1e-5 && t < end, `${t}`);
    assert.ok(sorter.sort(t, [0, 0, 1, 0]).count > 50, `live at ${t}`);
  }
});

test('what the tests write is read back', async () => {
  const g = randomGaussians(200, 3);
  const { scene, gaussians } = await decodeAll(write4dgs(g, { duration: 3, parts: 3, ivv: { blur: '0.4' }, views: { views: [] } }));
  assert.equal(scene.metadata.get('ivv').get('blur'), '0.4');
  assert.equal(scene.attachments[0].mediaType, 'application/json');
  assert.ok(scene.chunks.length >= 3);
  const byPlace = new Map(gaussians.position.map((p, i) => [p.map((v) => v.toFixed(3)).join(), i]));
  let found = 0;
  g.position.forEach((p, i) => {
    const k = byPlace.get(p.map((v) => v.toFixed(3)).join());
    if (k === undefined) return;
    found += 1;
    near(gaussians.time[k], g.time[i], 1e-3, 'time');
    near(gaussians.sh[k][20], g.sh[i][20], 0.02, 'sh');
    near(Math.abs(gaussians.rotation[k].reduce((s, v, c) => s + v * g.rotation[i][c], 0)), 1, 1e-6, 'rotation');
  });
  assert.ok(found > 150, `found ${found} of 200`);
});

test('a file without an index is walked, and a second Header is refused', async () => {
  const bytes = write4dgs(randomGaussians(60, 1), { duration: 2, index: false });
  const { scene, gaussians } = await decodeAll(bytes);
  assert.equal(gaussians.count, 60);
  assert.ok(scene.chunks.every(({ bands }) => bands.length === 1));
  const length = 9 + Number(bytes.readBigUInt64LE(9));
  const twice = Buffer.concat([bytes.subarray(0, 8 + length), bytes.subarray(8, 8 + length), bytes.subarray(8 + length)]);
  await assert.rejects(decodeAll(twice), { code: 'duplicate-record' });
});

test('a damaged index, a cut file, zstd and wild counts are refused by name', async () => {
  const bytes = write4dgs(randomGaussians(60, 0), { duration: 2 });
  const damaged = Buffer.from(bytes);
  damaged[bytes.length - 80] ^= 1;
  await assert.rejects(decodeAll(damaged), { code: 'crc-mismatch' });
  await assert.rejects(decodeAll(bytes.subarray(0, bytes.length - 100)), { code: 'magic-mismatch' });
  await assert.rejects(decodeAll(Buffer.concat([MAGIC, MAGIC])), { code: 'truncated' });
  const zstd = Buffer.from(bytes);
  const { scene } = await decodeAll(bytes);
  const streams = scene.chunks[0].chunk.offset + 9 + 24 + 4 + 8 + 8;
  zstd[streams + 3] = 1;
  await assert.rejects(decodeAll(zstd), (error) => error.code === 'unsupported-codec' && /zstd/.test(error.message));
  const wild = write4dgs(randomGaussians(60, 0), { duration: 2, index: false });
  wild.writeUInt32LE(0xffffffff, scene.chunks[0].chunk.offset + 9 + 20);
  await assert.rejects(decodeAll(wild), { code: 'bad-index' });
});

test('live Gaussians are those of the moment, farthest first', async () => {
  const g = randomGaussians(3000, 0);
  const { scene, chunks } = await decodeAll(write4dgs(g, { duration: 4, parts: 4 }));
  const sorter = new Sorter(scene.windows, 64);
  let rowsUsed = 0;
  const places = new Map();
  chunks.forEach((chunk, id) => {
    const rows = Uint32Array.from({ length: Math.ceil(chunk.count / 64) }, (_, r) => (rowsUsed + r) * 64);
    rowsUsed += rows.length;
    sorter.chunks.set(id, { ...scene.chunks[id], sortable: chunk.sortable, window: chunk.window, rows });
    for (let i = 0; i < chunk.count; i += 1) places.set(rows[Math.floor(i / 64)] + (i % 64), chunk.geometry.subarray(16 * i, 16 * i + 16));
  });
  const axis = [0.36, -0.48, 0.8, -1.5];
  for (const t of [0, 0.7, 1.999, 2, 3.5]) {
    const depth = (x) => axis[3] + [0, 1, 2].reduce((s, c) => s + axis[c] * (x[c] + (t - x[7]) * x[4 + c]), 0);
    const weight = (x) => Math.exp(-(((t - x[7]) * x[11]) ** 2));
    const { order, count } = sorter.sort(t, axis);
    const live = [...places.values()].filter((x) => weight(x) >= scene.header.cutoff && x[3] * weight(x) >= 1 / 255);
    near(count, live.length, 2, `live at ${t}`);
    const depths = Array.from(order.subarray(0, count), (slot) => depth(places.get(slot)));
    depths.forEach((z, i) => assert.ok(i === 0 || z <= depths[i - 1] + 1e-5, `depth ${z} behind ${depths[i - 1]}`));
  }
});

test('base64 of a page is decoded', () => {
  for (const n of [0, 1, 2, 3, 70_000, 400_001]) {
    const bytes = Buffer.from(Array.from({ length: n }, (_, i) => (i * 31) & 255));
    assert.deepEqual(Buffer.from(base64Bytes(`\n ${bytes.toString('base64')}\n`)), bytes);
  }
});

test('a server that is busy or does not answer is asked again, one without the file is not', async (t) => {
  const file = Uint8Array.from({ length: 70_000 }, (_, i) => i);
  let answers = [];
  t.mock.method(globalThis, 'fetch', async (_url, { headers }) => {
    const status = answers.shift() ?? 206;
    if (status === 'none') throw new TypeError('network');
    const [, from, to] = /bytes=(\d+)-(\d+)/.exec(headers.Range).map(Number);
    const range = { 'Content-Range': `bytes ${from}-${to}/${file.length}` };
    return status === 206 ? new Response(file.slice(from, to + 1), { status, headers: range }) : new Response('', { status });
  });
  const source = await openUrl('scene.4dgs');
  for (const status of [503, 429, 'none']) {
    answers = [status];
    assert.deepEqual(await source.read(69_000, 10), file.slice(69_000, 69_010), `${status}`);
    assert.equal(answers.length, 0);
  }
  answers = [404, 404];
  await assert.rejects(source.read(69_000, 10), { code: 'http' });
  assert.equal(answers.length, 1);
});

test('a memory source refuses reads outside', async () => {
  await assert.rejects(memorySource(new Uint8Array(10)).read(8, 3), { code: 'truncated' });
  assert.equal((await memorySource(new Uint8Array(10)).read(8, 2)).length, 2);
});
