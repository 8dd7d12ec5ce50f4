// Damaged files: every mutant is read or refused by a message, and none makes the reader do more than its bytes are worth.
import assert from 'node:assert/strict';
import test from 'node:test';
import { crc32, FormatError } from '../../assets/player/bytes.js';
import { openScene, soundPosition } from '../../assets/player/container.js';
import { decodeChunk } from '../../assets/player/decode.js';
import { earsOf, nearestDirection } from '../../assets/player/ears.js';
import { piece, soundLaw } from '../../assets/player/sound.js';
import { Sorter } from '../../assets/player/sorter.js';
import { memorySource } from '../../assets/player/source.js';
import { fewEars, random, randomGaussians, tone } from './scenes.mjs';
import { write4dgs } from './write4dgs.mjs';

const ROUNDS = Number(process.env.IVV_PLAYER_MUTATIONS ?? 2000);
const SEED = Number(process.env.IVV_PLAYER_SEED ?? 7);
const ROW_SLOTS = 64;
/** Deflate makes at most so many bytes of one, of each of which comes one Gaussian at most, and so many bytes of that one. */
const DEFLATE_RATIO = 1032;
const BYTES_A_GAUSSIAN = 640;
const SLACK_BYTES = 1 << 20;
const LONGEST_MESSAGE = 400;
/** The shortest record, and reads that come on top of one for each: the ends of the file, chunks, the index. */
const SHORTEST_RECORD = 9;
const MORE_READS = 64;

/** Files of few Gaussians whose streams are stored as they are, so that what they hold can be changed and their checksums mended. */
function seeds() {
  const keys = [{ time: 0, position: [1, 0, 0] }, { time: 1, position: [0, 1, 0] }];
  const sounds = [{ id: 1, name: 'voice', duration: 0.1, data: tone(0.005), keys }, { id: 2, duration: 1, loop: true, spatial: false, data: tone(0.001) }];
  const rich = { duration: 2, parts: 2, level: 0, ears: fewEars(), ivv: { up: '0 -1 0', blur: '0.3' }, metadata: { 'ivv.sound': { mic: '0 0 0', r_min: '0.2' } }, views: { views: [] }, sounds };
  return [
    write4dgs(randomGaussians(14, 1), rich),
    write4dgs(randomGaussians(9, 3), { duration: 2, parts: 1, level: 0 }),
    write4dgs(randomGaussians(12, 2), { duration: 2, parts: 2, level: 0, index: false }),
    write4dgs(randomGaussians(14, 0), { duration: 2, parts: 2, level: 6 }),
    write4dgs(randomGaussians(10, 1), { duration: 1, parts: 1, level: 0, packed: true, sounds }),
  ];
}

const WILD = [0n, 1n, 2n, 7n, 8n, 9n, 0x7fn, 0x80n, 0xffn, 0x100n, 0xffffn, 0x1_0000n, 0x10_0000n, 0x40_0000n, 0x7fff_ffffn, 0x8000_0000n, 0xffff_ffffn,
  0x1_0000_0000n, 0x1f_ffff_ffff_ffffn, 0x20_0000_0000_0000n, 0x7ff0_0000_0000_0000n, 0x7ff8_0000_0000_0000n, 0xffff_ffff_ffff_ffffn];

/** Where records begin, and the end of the last. @param {Buffer} bytes */
function recordsOf(bytes) {
  const starts = [8];
  for (let at = 8; at + SHORTEST_RECORD <= bytes.length; starts.push(at)) at += SHORTEST_RECORD + Math.min(bytes.length, Number(bytes.readBigUInt64LE(at + 1)));
  return starts;
}

/** Changes that move nothing come first. */
const IN_PLACE = 8;

/** One to four changes of bytes, numbers, stretches or whole records; mostly such as leave all else in its place. */
function mutated(seed, next) {
  let bytes = Buffer.from(seed);
  const below = (n) => Math.floor(next() * n);
  for (let n = 1 + below(4); n > 0 && bytes.length > 16; n -= 1) {
    const at = below(bytes.length - 8);
    const records = recordsOf(bytes);
    const k = below(records.length - 1);
    const record = () => bytes.subarray(records[k], records[k + 1]);
    const join = (...parts) => { bytes = Buffer.concat(parts); };
    [
      () => { bytes[at] = below(256); },
      () => { bytes[at] ^= 1 << below(8); },
      () => { bytes.writeUIntLE(Number(WILD[below(WILD.length)] & 0xffff_ffffn), at, 4); },
      () => { bytes.writeBigUInt64LE(WILD[below(WILD.length)], at); },
      () => { bytes.writeUInt32LE((bytes.readUInt32LE(at) + [1, -1, 2, 256][below(4)]) >>> 0, at); },
      () => { bytes.writeUInt32LE([bytes.length, bytes.length - at, at][below(3)], at); },
      () => { if (records[k] < bytes.length) bytes[records[k]] = below(0x24); },
      () => { bytes.writeDoubleLE([NaN, Infinity, -1, -0, 1e300, 1e-300, 1e9][below(7)], at); },
      () => { join(bytes.subarray(0, at), bytes.subarray(at + 1 + below(40))); },
      () => { join(bytes.subarray(0, at), bytes.subarray(Math.max(0, at - 30), at), bytes.subarray(at)); },
      () => { join(bytes.subarray(0, at)); },
      () => { join(bytes.subarray(0, records[k]), record(), bytes.subarray(records[k])); },
      () => { join(bytes.subarray(0, 8), bytes.subarray(records[k])); },
      () => { join(bytes.subarray(0, records[k]), bytes.subarray(records[k + 1])); },
      () => { const kept = Buffer.from(record()); join(bytes.subarray(0, records[k]), bytes.subarray(records[k + 1]), kept); },
    ][next() < 0.85 ? below(IN_PLACE) : IN_PLACE + below(7)]();
  }
  return next() < 0.75 ? mended(bytes) : bytes;
}

/** The same with the checksums right of streams that are stored as they are, and of the index. */
function mended(bytes) {
  const starts = recordsOf(bytes);
  starts.slice(0, -1).forEach((at, i) => {
    const end = Math.min(starts[i + 1], bytes.length);
    const [opcode, content] = [bytes[at], at + SHORTEST_RECORD];
    if (opcode === 0x05 && content + 44 < end) mendStreams(bytes, content + 28 + Math.min(bytes.length, bytes.readUInt32LE(content + 24)) + 16, end);
    if (opcode === 0x07) mendStreams(bytes, content + 1, end);
    if (opcode === 0x02 && content + 20 <= bytes.length) {
      const index = starts.slice(0, i).find((start) => bytes[start] === 0x08) ?? at;
      if (bytes.readBigUInt64LE(content) > 0n) bytes.writeBigUInt64LE(BigInt(index), content);
      bytes.writeUInt32LE(crc32(bytes.subarray(index, at)), content + 16);
    }
  });
  return bytes;
}

/** Streams that lie end to end: a header of 17 bytes, then zlib of one stored block. */
function mendStreams(bytes, from, end) {
  for (let at = from; at + 17 <= end;) {
    const length = bytes.readBigUInt64LE(at + 9);
    if (length < 12n || length > BigInt(end - at - 17)) return;
    const [body, sum] = [at + 17 + 7, at + 17 + Number(length) - 4];
    let [a, b] = [1, 0];
    for (let i = body; i < sum; i += 1) {
      a = (a + bytes[i]) % 65521;
      b = (b + a) % 65521;
    }
    bytes.writeUInt32BE(((b << 16) | a) >>> 0, sum);
    at = sum + 4;
  }
}

/** Counts the bytes that arrays of numbers and `Array.from` ask for until `stop`. */
function watchAllocations() {
  const watch = { bytes: 0, stop() {} };
  const names = ['Uint8Array', 'Int16Array', 'Int32Array', 'Uint32Array', 'Float32Array', 'Float64Array'];
  const originals = names.map((name) => globalThis[name]);
  const { from } = Array;
  names.forEach((name, i) => {
    globalThis[name] = new Proxy(originals[i], {
      construct(target, args, newTarget) {
        const length = typeof args[0] === 'number' ? args[0] : ArrayBuffer.isView(args[0]) ? args[0].length : 0;
        watch.bytes += length * target.BYTES_PER_ELEMENT;
        return Reflect.construct(target, args, newTarget === globalThis[name] ? target : newTarget);
      },
    });
  });
  Array.from = (source, ...more) => {
    watch.bytes += 8 * (source?.length ?? 0);
    return from.call(Array, source, ...more);
  };
  watch.stop = () => {
    names.forEach((name, i) => { globalThis[name] = originals[i]; });
    Array.from = from;
  };
  return watch;
}

/** All that the player does with a file but drawing it. @returns reads of the file */
async function playThrough(bytes) {
  const memory = memorySource(bytes);
  let reads = 0;
  const source = { ...memory, read: (offset, length) => { reads += 1; return memory.read(offset, length); } };
  const scene = await openScene(source);
  const duration = scene.header.duration;
  const settings = { grid: scene.grid, windows: scene.windows, cutoff: scene.header.cutoff, duration, alphaMin: 1 / 255, shDegree: scene.header.shDegree };
  const opened = reads;
  const sorter = new Sorter(scene.windows, ROW_SLOTS);
  let rows = 0;
  for (const [id, entry] of scene.chunks.slice(0, MORE_READS).entries()) {
    const read = ({ offset, length }) => source.read(offset, length);
    const chunk = await decodeChunk(await read(entry.chunk), await Promise.all(entry.bands.map(read)), settings, entry.count);
    const slots = Uint32Array.from({ length: Math.ceil(chunk.count / ROW_SLOTS) }, (_, k) => (rows + k) * ROW_SLOTS);
    rows += slots.length;
    if (rows * ROW_SLOTS < 4096) sorter.chunks.set(id, { t0: entry.t0, t1: entry.t1, sortable: chunk.sortable, window: chunk.window, rows: slots });
  }
  for (const t of [0, duration / 2, duration]) sorter.sort(t, [0.6, 0, 0.8, -1]);
  soundLaw(scene);
  for (const sound of scene.sounds) for (const t of [0, duration / 2, duration]) [soundPosition(sound, t), piece(sound, t, duration)].forEach((found) => assert.ok(found !== undefined));
  const ears = await earsOf(source, scene);
  if (ears) for (const to of [[0, 1, 0], [0, -1, 0], [0, 0, 1], [-1, 0, 0]]) assert.ok(2 * nearestDirection(ears, to) * ears.taps < ears.samples.length);
  return opened;
}

test('mutated files are read or refused, with work that their bytes bound', { timeout: 3_600_000 }, async (t) => {
  const from = seeds();
  for (const bytes of from) await playThrough(bytes);
  const next = random(SEED);
  const outcome = { read: 0, refused: 0 };
  const worst = { bytes: 0, round: 0, reads: 0 };
  const codes = new Map();
  for (let round = 0; round < ROUNDS; round += 1) {
    const bytes = mutated(from[round % from.length], next);
    const watch = watchAllocations();
    let reads = 0;
    try {
      reads = await playThrough(new Uint8Array(bytes));
      outcome.read += 1;
    } catch (error) {
      watch.stop();
      assert.ok(error instanceof FormatError, `round ${round} of seed ${SEED}: ${error.stack}`);
      assert.ok(error.message.length > 10 && error.message.length < LONGEST_MESSAGE, `round ${round} of seed ${SEED}: ${error.message}`);
      codes.set(error.code, (codes.get(error.code) ?? 0) + 1);
      outcome.refused += 1;
    } finally {
      watch.stop();
    }
    if (watch.bytes > worst.bytes) Object.assign(worst, { bytes: watch.bytes, round });
    worst.reads = Math.max(worst.reads, reads);
    assert.ok(watch.bytes <= SLACK_BYTES + bytes.length * DEFLATE_RATIO * BYTES_A_GAUSSIAN, `round ${round} of seed ${SEED}: ${watch.bytes} bytes asked for, of a file of ${bytes.length}`);
    assert.ok(reads <= bytes.length / SHORTEST_RECORD + MORE_READS, `round ${round} of seed ${SEED}: ${reads} reads`);
  }
  t.diagnostic(`${ROUNDS} files: ${JSON.stringify(outcome)}; most memory asked for: ${(worst.bytes / 1e6).toFixed(2)} MB (round ${worst.round}); refused: ${JSON.stringify(Object.fromEntries(codes))}`);
  assert.ok(outcome.refused > ROUNDS / 10 && outcome.read > ROUNDS / 10, JSON.stringify(outcome));
  assert.ok(codes.size >= 8, `${codes.size} reasons`);
  assert.ok(process.memoryUsage().rss < 2 ** 30, `${process.memoryUsage().rss} bytes of memory`);
});

/** A file of `n` equal Gaussians, each stream of which holds one and says that it is all of them. */
function repeated(n) {
  const bytes = Buffer.from(write4dgs(randomGaussians(1, 0), { duration: 2, parts: 1, level: 0 }));
  recordsOf(bytes).slice(0, -1).forEach((at) => {
    const content = at + SHORTEST_RECORD;
    if (bytes[at] === 0x01) bytes.writeBigUInt64LE(BigInt(n), content + 4 + 4 + bytes.readUInt32LE(content + 4) + 8);
    if (bytes[at] === 0x08) bytes.writeUInt32LE(n, content + 32);
    if (bytes[at] !== 0x05) return;
    bytes.writeUInt32LE(n, content + 20);
    for (let stream = content + 44; stream < content + Number(bytes.readBigUInt64LE(at + 1)); stream += 17 + Number(bytes.readBigUInt64LE(stream + 9))) {
      bytes[stream + 2] = 2;
      bytes.writeUInt32LE(n, stream + 5);
    }
  });
  return mended(bytes);
}

test('what a small file makes of a count that all its records agree on', async (t) => {
  const outcomes = [];
  for (const n of [1, 1000, 100_000, 300_000, 1_000_000, 1 << 22, 2 ** 31 - 1, 2 ** 32 - 1]) {
    const bytes = new Uint8Array(repeated(n));
    const watch = watchAllocations();
    const refused = await playThrough(bytes).then(() => null, (error) => error).finally(watch.stop);
    assert.ok(refused === null || refused instanceof FormatError, refused?.stack);
    assert.ok(watch.bytes <= SLACK_BYTES + Math.min(n, bytes.length * DEFLATE_RATIO) * BYTES_A_GAUSSIAN, `${n}: ${watch.bytes} bytes asked for`);
    outcomes.push(`${n}: ${refused?.code ?? 'read'}, ${(watch.bytes / 1e6).toFixed(1)} MB`);
  }
  t.diagnostic(outcomes.join('; '));
  assert.ok(outcomes[1].includes('read') && outcomes.at(-1).includes('bad-'), outcomes.join());
});
