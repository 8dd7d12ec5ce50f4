// The container `.4dgs`: records, the index of chunks, sound sources, metadata. Gaussians themselves are read in decode.js.
import { crc32, Cursor, FormatError } from './bytes.js';

const MAGIC = [0x89, 0x34, 0x44, 0x47, 0x53, 0x31, 0x0d, 0x0a];
const FRAME = 9; // opcode and length
const TAIL = 37; // Footer record and magic
const READ_AHEAD = 32768;
const MAX_RECORD = 1 << 24;
const MAX_SUMMARY = 1 << 26;
const MAX_RECORDS = 1 << 20;
/** More Gaussians than this in one chunk are refused. */
const MAX_CHUNK_GAUSSIANS = 1 << 22;
/** More Gaussians than this in one file are refused. */
const MAX_GAUSSIANS = 2 ** 31;
const LEFT_HANDED = 2;
/** Metres of the format's units of length, by number; 0 where the file names none. */
const UNIT_METRES = [0, 1, 0.01, 0.001, 1000, 0.3048, 0.0254];

/**
 * @typedef {{ offset: number, length: number }} Span bytes of the file
 * @typedef {object} ChunkEntry what lives in `[t0, t1)`, seconds
 * @property {number} t0
 * @property {number} t1
 * @property {number} count Gaussians
 * @property {Span} chunk the whole Chunk record
 * @property {Span[]} bands whole SH records of degree 1, 2, ... in order
 * @typedef {object} Grid steps of the stored integers
 * @property {number[]} origin
 * @property {{ position: number, scale: number, rotation: number, rgb: number, alpha: number, motion: number, time: number, sigma: number }} step
 * @typedef {{ time: number, position: number[] }} Key
 * @typedef {object} SoundSource
 * @property {number} id
 * @property {string} name
 * @property {string} codec `wav` or `opus`
 * @property {number} start seconds of the scene
 * @property {number} duration seconds
 * @property {number} gain
 * @property {boolean} spatial
 * @property {boolean} loop
 * @property {number[]} position world
 * @property {Key[]} keys
 * @property {boolean} step holds each key until the next
 * @property {Span} data
 * @typedef {object} Scene
 * @property {{ duration: number, count: number, cutoff: number, aabb: number[], shDegree: number, library: string, attributes: Map<string, string> }} header
 * @property {Grid} grid
 * @property {Float64Array} windows pairs lo, hi in seconds
 * @property {ChunkEntry[]} chunks
 * @property {Map<string, Map<string, string>>} metadata by record name
 * @property {{ name: string, mediaType: string, data: Span }[]} attachments
 * @property {SoundSource[]} sounds
 * @property {{ fovY: number, position: number[], target: number[] } | null} camera
 * @property {{ handedness: number, upAxis: number, metresPerUnit: number } | null} frame
 */

/**
 * Reads everything but chunks and payloads.
 * @param {import('./source.js').ByteSource} source
 * @returns {Promise<Scene>}
 */
export async function openScene(source) {
  const file = new Blocks(source);
  checkMagic(await file.read(0, Math.min(MAGIC.length, source.size)), 'start');
  if (source.size < MAGIC.length + TAIL) {
    throw new FormatError('truncated', `expected at least ${MAGIC.length + TAIL} bytes, found a file of ${source.size}`);
  }
  // One read for the footer and, mostly, the whole index.
  const block = Math.min(source.size, READ_AHEAD);
  const tail = (await file.read(source.size - block, block)).subarray(block - TAIL);
  checkMagic(tail.subarray(TAIL - MAGIC.length), 'end');
  const footer = new Cursor(tail, 'Footer');
  const isPlain = footer.u8() === 0x02 && footer.u64() === 20;
  const indexed = isPlain ? await readSummary(file, footer, source.size - TAIL) : null;
  const scene = await walk(file, indexed?.start ?? source.size - MAGIC.length, indexed?.chunks ?? null);
  checkScene(scene, indexed !== null);
  return scene;
}

/** Reads with some read-ahead, since records are small and lie one behind the other. */
class Blocks {
  /** @param {import('./source.js').ByteSource} source */
  constructor(source) {
    this.source = source;
    this.start = 0;
    /** @type {Uint8Array} */
    this.block = new Uint8Array(0);
  }

  /** @param {number} offset @param {number} length */
  async read(offset, length) {
    const at = offset - this.start;
    if (at >= 0 && at + length <= this.block.length) return this.block.subarray(at, at + length);
    if (offset + length > this.source.size) {
      throw new FormatError('truncated', `expected bytes up to ${offset + length}, found a file of ${this.source.size}`);
    }
    this.block = await this.source.read(offset, Math.min(this.source.size - offset, Math.max(length, READ_AHEAD)));
    this.start = offset;
    return this.block.subarray(0, length);
  }
}

/** @param {Uint8Array} found @param {string} where */
function checkMagic(found, where) {
  const same = MAGIC.map((byte, i) => found[i] === byte);
  if (same.every(Boolean)) return;
  const isOtherVersion = same.every((ok, i) => ok || i === 5) && found.length === MAGIC.length;
  if (isOtherVersion) {
    throw new FormatError('unsupported-major-version', `expected version 1 of .4dgs, found version "${String.fromCharCode(found[5])}"`);
  }
  const hex = Array.from(found, (byte) => byte.toString(16).padStart(2, '0')).join(' ') || 'nothing';
  const hint = where === 'end' ? '. The file is cut short' : '. This is no .4dgs file';
  throw new FormatError('magic-mismatch', `expected 89 34 44 47 53 31 0d 0a at the ${where}, found ${hex}${hint}`);
}

/**
 * The index at the end. @param {Blocks} file @param {Cursor} footer @param {number} footerStart
 * @returns {Promise<{ chunks: ChunkEntry[], start: number } | null>} null where the file has none
 */
async function readSummary(file, footer, footerStart) {
  const start = footer.u64();
  footer.u64();
  const crc = footer.u32();
  if (start === 0) return null;
  if (start < MAGIC.length || start > footerStart || footerStart - start > MAX_SUMMARY) {
    throw new FormatError('bad-index', `expected the index between byte 8 and ${footerStart}, found it at ${start}`);
  }
  const bytes = await file.read(start, footerStart - start);
  const found = crc32(bytes);
  if (crc !== 0 && crc !== found) {
    throw new FormatError('crc-mismatch', `index: expected CRC ${crc.toString(16)}, found ${found.toString(16)}. The file is damaged`);
  }
  const records = new Cursor(bytes, 'index');
  /** @type {ChunkEntry[]} */
  const chunks = [];
  while (records.left > 0) {
    const opcode = records.u8();
    const content = records.slice(records.u64());
    if (opcode === 0x08) chunks.push(readIndexEntry(new Cursor(content, 'Chunk Index'), start));
  }
  return { chunks, start };
}

/** @param {Cursor} c @param {number} limit chunks end before this byte @returns {ChunkEntry} */
function readIndexEntry(c, limit) {
  const t0 = c.finite('t0');
  const t1 = c.finite('t1');
  const chunk = readSpan(c, limit);
  const count = c.u32();
  const bands = new Map();
  for (let n = c.count(17, 'bands'); n > 0; n -= 1) bands.set(c.u8(), readSpan(c, limit));
  return { t0, t1, count, chunk, bands: inOrder(bands) };
}

/** @param {Cursor} c @param {number} limit @returns {Span} */
function readSpan(c, limit) {
  const offset = c.u64();
  const length = c.u64();
  if (offset < MAGIC.length || length < FRAME || offset + length > limit) {
    throw new FormatError('bad-index', `${c.what}: expected a record before byte ${limit}, found ${length} bytes at ${offset}`);
  }
  return { offset, length };
}

/** Bands 1, 2, ... up to the first that is missing. @param {Map<number, Span>} bands */
function inOrder(bands) {
  /** @type {Span[]} */
  const spans = [];
  for (let band = bands.get(1); band; band = bands.get(spans.length + 1)) spans.push(band);
  return spans;
}

/**
 * Walks all records but those that the index already describes. @param {Blocks} file @param {number} end
 * @param {ChunkEntry[] | null} indexed @returns {Promise<Scene>}
 */
async function walk(file, end, indexed) {
  const known = new Map((indexed ?? []).flatMap((entry) => [entry.chunk, ...entry.bands]).map((s) => [s.offset, s.length]));
  const scene = /** @type {Scene} */ (/** @type {unknown} */ ({ chunks: indexed ?? [], metadata: new Map(), attachments: [], sounds: [], camera: null, frame: null }));
  /** @type {WalkState} */
  const state = { scene, seen: new Set(), sources: new Map(), data: new Map(), bands: new Map(), hasIndex: indexed !== null };
  let n = 0;
  for (let at = MAGIC.length; at < end; n += 1) {
    if (n > MAX_RECORDS) throw new FormatError('too-many-records', `expected at most ${MAX_RECORDS} records, found more`);
    const jump = known.get(at);
    if (jump) {
      at += jump;
      continue;
    }
    const frame = new Cursor(await file.read(at, Math.min(FRAME, end - at)), `record at byte ${at}`);
    const opcode = frame.u8();
    const span = { offset: at + FRAME, length: frame.u64() };
    if (span.offset + span.length > end) {
      throw new FormatError('truncated', `record 0x${opcode.toString(16)} at byte ${at}: expected ${span.length} bytes, found ${end - span.offset}`);
    }
    if (n === 0 && opcode !== 0x01) {
      throw new FormatError('bad-order', `expected the Header (0x1) as the first record, found 0x${opcode.toString(16)}`);
    }
    await readRecord(file, opcode, span, state);
    at = span.offset + span.length;
    if (opcode === 0x02) break;
  }
  for (const [id, source] of state.sources) {
    const data = state.data.get(id);
    if (data?.length !== source.data.length) {
      throw new FormatError('bad-sound', `sound source ${id}: expected ${source.data.length} bytes of sound, found ${data?.length ?? 'none'}`);
    }
    scene.sounds.push({ ...source, data });
  }
  for (const id of state.data.keys()) {
    if (!state.sources.has(id)) throw new FormatError('bad-sound', `sound data ${id}: expected a source of that number, found none`);
  }
  return scene;
}

/**
 * @typedef {object} WalkState what a walk has found
 * @property {Scene} scene
 * @property {Set<number>} seen opcodes of records of which there may be one only
 * @property {Map<number, SoundSource>} sources
 * @property {Map<number, Span>} data of sources
 * @property {Map<number, Span>} bands of the last chunk
 * @property {boolean} hasIndex
 * @typedef {(name: string, length?: number) => Promise<Cursor>} Open reads a record, or only so much of its beginning
 */

/** Reads a record into what has been found. @param {Blocks} file @param {number} opcode @param {Span} span its content @param {WalkState} state */
async function readRecord(file, opcode, span, state) {
  if (opcode === 0x01 || opcode === 0x03 || opcode === 0x04) {
    if (state.seen.has(opcode)) {
      throw new FormatError('duplicate-record', `expected one record 0x${opcode.toString(16)}, found a second at byte ${span.offset - FRAME}`);
    }
    state.seen.add(opcode);
  }
  // Records that this reader does not know are stepped over, as the format asks.
  await READERS[opcode]?.(state, span, async (name, length = span.length) => {
    if (length > MAX_RECORD) throw new FormatError('too-long', `${name}: expected at most ${MAX_RECORD} bytes, found ${length}`);
    return new Cursor(await file.read(span.offset, Math.min(length, span.length)), name);
  });
}

/** By opcode. @type {Record<number, (state: WalkState, span: Span, open: Open) => Promise<void>>} */
const READERS = {
  async 0x01({ scene }, _, open) {
    scene.header = readHeader(await open('Header'));
  },
  async 0x03({ scene }, _, open) {
    scene.grid = readGrid(await open('Quantization'));
  },
  async 0x04({ scene }, _, open) {
    const c = await open('Window Table');
    scene.windows = Float64Array.from({ length: 2 * c.count(16, 'windows') }, () => c.f64());
  },
  async 0x05(state, span, open) {
    if (state.hasIndex) return;
    const c = await open('Chunk', 24);
    const [t0, t1] = c.finites(2, 'interval');
    c.u32();
    state.scene.chunks.push({ t0, t1, count: c.u32(), chunk: whole(span), bands: [] });
    state.bands = new Map();
  },
  async 0x07({ scene, bands, hasIndex }, span, open) {
    if (hasIndex || scene.chunks.length === 0) return;
    bands.set((await open('SH Band', 1)).u8(), whole(span));
    scene.chunks[scene.chunks.length - 1].bands = inOrder(bands);
  },
  async 0x09({ scene, sources, data }, span, open) {
    const c = await open('Audio', 4096);
    const sound = { id: 0, name: '', codec: c.string(), start: c.finite('start'), gain: 1, spatial: false, loop: false, position: [0, 0, 0], keys: [], step: false };
    const bytes = payload(c, span);
    data.set(0, bytes);
    sources.set(0, { ...sound, duration: Math.max(0, (scene.header?.duration ?? 0) - sound.start), data: bytes });
  },
  async 0x0a({ scene }, _, open) {
    const c = await open('Camera', 56);
    scene.camera = { fovY: c.finite('field of view'), position: c.finites(3, 'position'), target: c.finites(3, 'target') };
  },
  async 0x0b({ scene }, _, open) {
    const c = await open('Metadata');
    scene.metadata.set(c.string(), c.map());
  },
  async 0x0d({ scene }, span, open) {
    const c = await open('Attachment', 4096);
    scene.attachments.push({ name: c.string(), mediaType: c.string(), data: payload(c, span) });
  },
  async 0x11({ sources }, _, open) {
    const source = readSoundSource(await open('Audio Source'));
    if (sources.has(source.id)) throw new FormatError('bad-sound', `expected one sound source ${source.id}, found two`);
    sources.set(source.id, source);
  },
  async 0x12({ data }, span, open) {
    const c = await open('Audio Data', 12);
    const id = c.u32();
    if (data.has(id)) throw new FormatError('bad-sound', `expected one record of sound data ${id}, found two`);
    data.set(id, payload(c, span));
  },
  async 0x20({ scene }, _, open) {
    const c = await open('Coordinate Frame');
    if (c.string() !== '') return;
    const [handedness, upAxis, , unit] = [c.u8(), c.u8(), c.u8(), c.u8()];
    scene.frame ??= { handedness, upAxis, metresPerUnit: c.finite('metres per unit') || (UNIT_METRES[unit] ?? 0) };
  },
  async 0x25(_state, _span, open) {
    const c = await open('Object Track', 9);
    const id = c.u32();
    c.u8();
    // One without samples moves nothing.
    if (c.u32() > 0) throw new FormatError('unsupported-tracks', `expected Gaussians that move along lines, found a track that moves object ${id}, which this player cannot show. Save the scene without tracks of objects`);
  },
};

/** The record of a content. @param {Span} span @returns {Span} */
const whole = ({ offset, length }) => ({ offset: offset - FRAME, length: length + FRAME });

/** Where the bytes of a record lie that end it. @param {Cursor} c its beginning @param {Span} span @returns {Span} */
function payload(c, span) {
  const length = c.u64();
  const offset = span.offset + c.at;
  if (offset + length > span.offset + span.length) {
    throw new FormatError('bad-length', `${c.what}: expected at most ${span.length - c.at} bytes of data, found ${length}`);
  }
  return { offset, length };
}

/** @param {Cursor} c @returns {Scene['header']} */
function readHeader(c) {
  c.string();
  const library = c.string();
  const duration = c.finite('duration');
  const count = c.u64();
  const cutoff = c.finite('cutoff');
  const model = c.string();
  if (model !== 'gaussian-birth') {
    throw new FormatError('unknown-temporal-model', `expected the temporal model "gaussian-birth", found "${model}", which this player cannot show`);
  }
  const aabb = c.finites(6, 'bounding box');
  const shDegree = c.u8();
  c.u8();
  if (duration < 0) throw new FormatError('bad-header', `Header: expected a duration of 0 or more, found ${duration}`);
  if (!(cutoff > 0 && cutoff <= 1)) throw new FormatError('bad-header', `Header: expected a cutoff in (0, 1], found ${cutoff}`);
  if (shDegree > 3) throw new FormatError('bad-header', `Header: expected an SH degree of 0 to 3, found ${shDegree}`);
  if (count > MAX_GAUSSIANS) throw new FormatError('bad-header', `Header: expected at most ${MAX_GAUSSIANS} Gaussians, found ${count}`);
  return { duration, count, cutoff, aabb, shDegree, library, attributes: c.map() };
}

/** @param {Cursor} c @returns {Grid} */
function readGrid(c) {
  const scheme = c.string();
  if (scheme !== 'uniform-v1') throw new FormatError('unknown-scheme', `expected the quantization "uniform-v1", found "${scheme}"`);
  const origin = c.finites(3, 'origin');
  const [position, scale, rotation, rgb, alpha, motion, time, sigma] = c.finites(8, 'step');
  return { origin, step: { position, scale, rotation, rgb, alpha, motion, time, sigma } };
}

/** @param {Cursor} c @returns {SoundSource} */
function readSoundSource(c) {
  const id = c.u32();
  const name = c.string();
  const codec = c.string();
  c.string();
  const length = c.u64();
  const start = c.finite('start');
  const duration = c.finite('duration');
  const gain = c.finite('gain');
  const flags = c.u8();
  const position = c.finites(3, 'position');
  c.finites(4, 'rotation');
  const keys = Array.from({ length: c.count(64, 'keyframes') }, () => {
    const key = { time: c.finite('key time'), position: c.finites(3, 'position') };
    c.finites(4, 'rotation');
    return key;
  });
  if (keys.some((key, i) => i > 0 && key.time <= keys[i - 1].time)) {
    throw new FormatError('bad-sound', `sound source ${id}: expected key times that increase`);
  }
  if (!(duration > 0) || gain < 0) {
    throw new FormatError('bad-sound', `sound source ${id}: expected a positive duration and a gain of 0 or more, found ${duration} and ${gain}`);
  }
  const data = { offset: 0, length };
  return { id, name, codec, start, duration, gain, spatial: (flags & 1) !== 0, loop: (flags & 2) !== 0, position, keys, step: c.string() === 'step', data };
}

/** @param {Scene} scene @param {boolean} hasIndex */
function checkScene(scene, hasIndex) {
  if (!scene.header || !scene.grid) {
    throw new FormatError('missing-record', `expected a Header and a Quantization record, found ${scene.header ? 'no Quantization' : 'no Header'}`);
  }
  const { frame, header } = scene;
  // What the record says goes before the text, also where it leaves this open.
  const isLeft = frame ? frame.handedness === LEFT_HANDED : /left-handed/.test(header.attributes.get('coordinate_system') ?? '');
  if (isLeft) throw new FormatError('unsupported-axes', 'expected right-handed axes, found left-handed ones, with which this player would show the mirror image. Save the scene with right-handed axes');
  if (!scene.windows?.length) scene.windows = new Float64Array(2);
  let total = 0;
  // A file can hold fewer bands than its header says, of all its Gaussians.
  if (scene.chunks.length > 0) scene.header.shDegree = Math.min(scene.header.shDegree, scene.chunks.reduce((n, { bands }) => Math.max(n, bands.length), 0));
  for (const { t0, t1, count, chunk, bands } of scene.chunks) {
    if (!(t0 <= t1)) throw new FormatError('bad-index', `chunk at byte ${chunk.offset}: expected t0 <= t1, found ${t0} and ${t1}`);
    if (count > MAX_CHUNK_GAUSSIANS) {
      throw new FormatError('bad-index', `chunk at byte ${chunk.offset}: expected at most ${MAX_CHUNK_GAUSSIANS} Gaussians, found ${count}`);
    }
    if (bands.length < scene.header.shDegree) {
      throw new FormatError('missing-band', `chunk at byte ${chunk.offset}: expected ${scene.header.shDegree} SH bands, found ${bands.length}`);
    }
    bands.length = scene.header.shDegree;
    total += count;
  }
  if (total !== scene.header.count) {
    const where = hasIndex ? 'the index' : 'its chunks';
    throw new FormatError('count-mismatch', `expected ${scene.header.count} Gaussians, found ${total} in ${where}`);
  }
}

/** Seconds at which nothing that is stored has ended yet, ends being rounded to singles: the last moment that a player shows. @param {Scene} scene */
export function lastMoment(scene) {
  return scene.header.duration * (1 - 2 ** -23);
}

/** Position of a sound source at a time of the scene, world. @param {SoundSource} source @param {number} t seconds */
export function soundPosition(source, t) {
  const { keys } = source;
  if (keys.length === 0) return source.position;
  let i = keys.findIndex((key) => key.time > t);
  if (i === 0) return keys[0].position;
  if (i < 0) return keys[keys.length - 1].position;
  i -= 1;
  if (source.step) return keys[i].position;
  const u = (t - keys[i].time) / (keys[i + 1].time - keys[i].time);
  return keys[i].position.map((p, k) => p + u * (keys[i + 1].position[k] - p));
}

/** Three numbers of metadata, as "x y z". @param {Map<string, string> | undefined} entries @param {string} key */
export function triple(entries, key) {
  const values = (entries?.get(key) ?? '').trim().split(/\s+/).map(Number);
  return values.length === 3 && values.every(Number.isFinite) ? values : null;
}
