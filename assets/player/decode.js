// Decodes a chunk into what the renderer uploads and what the sorter keeps. Runs in a worker, or under node.
import { Cursor, FormatError } from './bytes.js';

/** Floats of a Gaussian in `geometry`: position, opacity; velocity, time; scale, rate; rotation xyzw. */
export const GEOMETRY_FLOATS = 16;
/** Floats of a Gaussian in `sortable`: position, velocity, time, rate, and the square of its life (see `liveReach`). */
export const SORT_FLOATS = 9;
/** Coefficients of one colour channel up to a degree, without the constant one. */
export const SH_COEFFICIENTS = [0, 3, 8, 15];
/** Texels (four words each) of a Gaussian in `look`, by SH degree. */
export const LOOK_TEXELS = [1, 2, 2, 4];

const MAX_STREAM = 1 << 28;
/** Deflate makes at most 1032 bytes of one. */
const DEFLATE_RATIO = 1032;
const OMITTED_REST = [[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]];
/** Identity, channels and name of the streams that each chunk has to have. @type {[number, number, string][]} */
const STREAMS = [
  [0, 3, 'position'], [1, 3, 'scale'], [2, 1, 'rotation index'], [3, 3, 'rotation'], [4, 3, 'colour'], [5, 1, 'opacity'],
  [6, 3, 'motion'], [7, 1, 'time'], [8, 1, 'sigma'], [9, 1, 'flags'], [10, 1, 'window index'],
];

/**
 * @typedef {object} DecodeSettings what a chunk is read with
 * @property {import('./container.js').Grid} grid
 * @property {Float64Array} windows pairs lo, hi
 * @property {number} cutoff least temporal weight
 * @property {number} duration of the clip, seconds
 * @property {number} alphaMin least alpha that is drawn
 * @property {number} shDegree
 * @typedef {object} DecodedChunk
 * @property {number} count N
 * @property {Float32Array} geometry N x 16
 * @property {Uint32Array} look N x 4 LOOK_TEXELS: rgb as 16-bit fractions in two words, then SH bytes, coefficient by coefficient
 * @property {Float32Array} sortable N x 9
 * @property {Uint32Array} window N, index of its window
 * @property {{ sum: number, first: number[], second: number, moving: number }} moments opacity-weighted sums of 1, position, squared position and scale;
 *   and how many move, fade or end
 */

/**
 * @param {Uint8Array} record a whole Chunk record
 * @param {Uint8Array[]} bandRecords whole SH records of degree 1, 2, ...
 * @param {DecodeSettings} settings
 * @param {number} expectedCount Gaussians by the index
 * @returns {Promise<DecodedChunk>}
 */
export async function decodeChunk(record, bandRecords, settings, expectedCount) {
  const c = content(record, 0x05, 'Chunk');
  c.f64();
  c.f64();
  c.u32();
  const count = c.u32();
  if (count !== expectedCount) throw new FormatError('count-mismatch', `chunk: expected ${expectedCount} Gaussians as the index says, found ${count}`);
  if (count > record.length * DEFLATE_RATIO) {
    throw new FormatError('bad-count', `chunk: expected at most ${record.length * DEFLATE_RATIO} Gaussians in ${record.length} bytes, found ${count}`);
  }
  const compression = c.string();
  const size = c.u64();
  const stored = c.slice(c.u64());
  const streams = new Cursor(compression === '' ? stored : await decompress(stored, compression, size), 'Chunk');
  if (streams.left !== size) throw new FormatError('bad-length', `chunk: expected ${size} bytes of streams, found ${streams.left}`);
  /** @type {Map<number, Int32Array>} */
  const values = new Map();
  while (streams.left > 0) {
    const id = streams.u8();
    const known = STREAMS.find(([stream]) => stream === id);
    const read = readStream(streams, count, known?.[1] ?? 0, known?.[2] ?? `stream ${id}`);
    if (known) values.set(id, await read());
  }
  const missing = STREAMS.find(([id]) => !values.has(id));
  if (missing) throw new FormatError('missing-stream', `chunk: expected a stream of ${missing[2]}, found none`);
  const bands = await Promise.all(bandRecords.map((bytes, i) => decodeBand(bytes, i + 1, count)));
  return assemble(count, STREAMS.map(([id]) => /** @type {Int32Array} */ (values.get(id))), bands, settings);
}

/** @param {Uint8Array} record @param {number} opcode @param {string} name */
function content(record, opcode, name) {
  const c = new Cursor(record, name);
  const found = c.u8();
  if (found !== opcode) throw new FormatError('bad-index', `${name}: expected a record 0x${opcode.toString(16)}, found 0x${found.toString(16)}`);
  return new Cursor(c.slice(c.u64()), name);
}

/** @param {Uint8Array} record @param {number} band @param {number} count */
async function decodeBand(record, band, count) {
  const c = content(record, 0x07, 'SH Band');
  const found = c.u8();
  if (found !== band) throw new FormatError('bad-index', `SH Band: expected band ${band}, found ${found}`);
  c.u8(); // This byte repeats the opcode and means nothing.
  return readStream(c, count, 3 * (2 * band + 1), `SH band ${band}`)();
}

/**
 * Reads the header of a stream behind its identity, steps over its payload, and returns what decodes it: N x channels integers.
 * @param {Cursor} c @param {number} count @param {number} channels 0: not known, and not decoded @param {string} name
 */
function readStream(c, count, channels, name) {
  const [width, mode, codec, found] = [c.u8(), c.u8(), c.u8(), c.u8()];
  const elements = c.u32();
  const bytes = c.slice(c.u64());
  return async () => {
    if (found !== channels || elements !== count) {
      throw new FormatError('bad-stream', `${name}: expected ${count} x ${channels} values, found ${elements} x ${found}`);
    }
    if (![1, 2, 4].includes(width) || mode > 2) {
      throw new FormatError('bad-stream', `${name}: expected 1, 2 or 4 bytes a value and a mode of 0 to 2, found ${width} and ${mode}`);
    }
    const n = (mode === 2 ? Math.min(1, count) : count) * channels;
    const raw = await decompress(bytes, ['deflate', 'zstd'][codec] ?? `codec ${codec}`, n * width);
    return integers(raw, n, width, mode, count, channels);
  };
}

/** @param {Uint8Array} raw @param {number} n @param {number} width @param {number} mode @param {number} count @param {number} channels */
function integers(raw, n, width, mode, count, channels) {
  const out = new Int32Array(count * channels);
  for (let i = 0; i < n; i += 1) {
    let symbol = raw[i];
    if (width > 1) symbol |= raw[n + i] << 8;
    if (width > 2) symbol |= (raw[2 * n + i] << 16) | (raw[3 * n + i] << 24);
    out[i] = (symbol >>> 1) ^ -(symbol & 1);
  }
  if (mode === 1) for (let i = channels; i < out.length; i += 1) out[i] += out[i - channels];
  if (mode === 2) for (let i = channels; i < out.length; i += 1) out[i] = out[i - channels];
  return out;
}

/** @param {Uint8Array} bytes @param {string} codec @param {number} size bytes that have to come out @returns {Promise<Uint8Array>} */
async function decompress(bytes, codec, size) {
  if (codec !== 'deflate') {
    throw new FormatError('unsupported-codec', `expected data packed with deflate, found ${codec}, which browsers cannot unpack. Export the scene with deflate`);
  }
  if (size > MAX_STREAM || size > bytes.length * DEFLATE_RATIO) {
    throw new FormatError('bad-length', `expected at most ${Math.min(MAX_STREAM, bytes.length * DEFLATE_RATIO)} bytes of ${bytes.length} packed ones, found ${size}`);
  }
  const out = new Uint8Array(size);
  let at = 0;
  const stream = new DecompressionStream('deflate');
  const writer = stream.writable.getWriter();
  const reader = stream.readable.getReader();
  // Faults show on the reading side too, where they are reported.
  const ignore = () => {};
  writer.write(/** @type {Uint8Array<ArrayBuffer>} */ (bytes)).catch(ignore);
  writer.close().catch(ignore);
  try {
    for (let next = await reader.read(); !next.done; next = await reader.read()) {
      if (at + next.value.length > size) throw new RangeError(`more than ${size} bytes`);
      out.set(next.value, at);
      at += next.value.length;
    }
  } catch (error) {
    reader.cancel().catch(ignore);
    throw new FormatError('bad-data', `expected ${size} bytes packed with deflate, found damaged data (${/** @type {Error} */ (error).message})`);
  }
  if (at !== size) throw new FormatError('bad-data', `expected ${size} bytes packed with deflate, found ${at}`);
  return out;
}

/** 1 / (sigma sqrt 2) of a sigma; the temporal weight is `exp(-(rate (t - time))^2)`. */
const RATE = Math.SQRT1_2;

/** @param {number} count @param {Int32Array[]} streams as STREAMS @param {Int32Array[]} bands @param {DecodeSettings} settings @returns {DecodedChunk} */
function assemble(count, streams, bands, settings) {
  const [position, scale, rotationIndex, rotation, color, opacity, motion, time, sigma, flags, window] = streams;
  const { origin, step } = settings.grid;
  const words = 4 * LOOK_TEXELS[settings.shDegree];
  const geometry = new Float32Array(count * GEOMETRY_FLOATS);
  const sortable = new Float32Array(count * SORT_FLOATS);
  const look = new Uint32Array(count * words);
  const k = Math.sqrt(-2 * Math.log(settings.cutoff));
  const moments = { sum: 0, first: [0, 0, 0], second: 0, moving: 0 };
  const q = [0, 0, 0, 0];
  for (let i = 0; i < count; i += 1) {
    const w = window[i];
    if (w < 0 || 2 * w >= settings.windows.length) {
      throw new FormatError('window-index-out-of-range', `expected a window below ${settings.windows.length / 2}, found ${w}`);
    }
    const isStatic = (flags[i] & 1) !== 0;
    const sd = Math.exp(sigma[i] * step.sigma);
    const half = isStatic ? settings.windows[2 * w + 1] - settings.windows[2 * w] : k * sd;
    const lifeClass = Math.min(2, Math.max(-4, Math.ceil(Math.log2(Math.min(2, Math.max(0.02, half)) / 0.5))));
    const motionStep = step.motion * 2 ** -lifeClass;
    const finest = isStatic ? step.time : Math.min(step.time, 0.05 * sd);
    const timeStep = step.time * 2 ** Math.min(0, Math.max(-10, Math.floor(Math.log2(finest / step.time))));
    const at = i * GEOMETRY_FLOATS;
    for (let c = 0; c < 3; c += 1) {
      geometry[at + c] = origin[c] + position[3 * i + c] * step.position;
      geometry[at + 4 + c] = motion[3 * i + c] * motionStep;
      geometry[at + 8 + c] = Math.exp(scale[3 * i + c] * step.scale);
    }
    geometry[at + 3] = opacity[i] * step.alpha;
    geometry[at + 7] = time[i] * timeStep;
    geometry[at + 11] = isStatic ? 0 : RATE / sd;
    unpackRotation(q, rotationIndex[i], rotation, 3 * i, step.rotation);
    geometry.set(q, at + 12);
    packLook(look, i * words, color, 3 * i, step.rgb);
    sortable.set(geometry.subarray(at, at + 3), i * SORT_FLOATS);
    sortable.set(geometry.subarray(at + 4, at + 8), i * SORT_FLOATS + 3);
    sortable[i * SORT_FLOATS + 7] = geometry[at + 11];
    sortable[i * SORT_FLOATS + 8] = liveReach(geometry[at + 3], settings);
    addMoment(moments, geometry, at);
    const [lo, hi] = settings.windows.subarray(2 * w, 2 * w + 2);
    if (geometry[at + 11] > 0 || geometry[at + 4] || geometry[at + 5] || geometry[at + 6] || lo > 0 || hi < settings.duration) moments.moving += 1;
  }
  bands.forEach((values, b) => packBand(new Uint8Array(look.buffer), words * 4, values, b + 1));
  return { count, geometry, look, sortable, window: new Uint32Array(window.buffer), moments };
}

/**
 * A Gaussian lives while `(rate (t - time))^2` is at most this: its weight is at least the cutoff, and its opacity at least alpha_min.
 * @param {number} opacity @param {DecodeSettings} settings
 */
function liveReach(opacity, settings) {
  return opacity > 0 ? Math.min(-Math.log(settings.cutoff), Math.log(opacity / settings.alphaMin)) : -1;
}

/** Smallest three. @param {number[]} q out, xyzw @param {number} omitted @param {Int32Array} bins @param {number} at @param {number} step */
function unpackRotation(q, omitted, bins, at, step) {
  const rest = OMITTED_REST[omitted];
  if (!rest) throw new FormatError('bad-stream', `rotation index: expected 0 to 3, found ${omitted}`);
  let sum = 0;
  for (let c = 0; c < 3; c += 1) {
    const value = Math.min(1, Math.max(-1, bins[at + c] * step));
    q[rest[c]] = value;
    sum += value * value;
  }
  q[omitted] = Math.sqrt(Math.max(0, 1 - sum));
  const norm = Math.hypot(q[0], q[1], q[2], q[3]) || 1;
  for (let c = 0; c < 4; c += 1) q[c] /= norm;
}

/** @param {Uint32Array} look @param {number} at @param {Int32Array} bins green, red - green, blue - green @param {number} from @param {number} step */
function packLook(look, at, bins, from, step) {
  const green = bins[from];
  /** @param {number} bin */
  const fraction = (bin) => Math.round(Math.min(1, Math.max(0, bin * step)) * 65535);
  look[at] = fraction(bins[from + 1] + green) | (fraction(green) << 16);
  look[at + 1] = fraction(bins[from + 2] + green);
}

/** Stores a band's bytes by coefficient, then channel. @param {Uint8Array} bytes @param {number} stride @param {Int32Array} values @param {number} band */
function packBand(bytes, stride, values, band) {
  const n = 2 * band + 1;
  const start = 8 + 3 * SH_COEFFICIENTS[band - 1];
  for (let i = 0, from = 0, at = start; from < values.length; i += 1, from += 3 * n, at = i * stride + start) {
    for (let c = 0; c < 3; c += 1) {
      for (let k = 0; k < n; k += 1) {
        const value = values[from + c * n + k];
        if (value < 0 || value > 255) throw new FormatError('bad-stream', `SH band ${band}: expected bytes, found ${value}`);
        bytes[at + 3 * k + c] = value;
      }
    }
  }
}

/** Position and size count, so that a Gaussian alone has an extent. @param {DecodedChunk['moments']} moments @param {Float32Array} geometry @param {number} at */
function addMoment(moments, geometry, at) {
  const weight = geometry[at + 3];
  moments.sum += weight;
  for (let c = 0; c < 3; c += 1) {
    moments.first[c] += weight * geometry[at + c];
    moments.second += weight * (geometry[at + c] ** 2 + geometry[at + 8 + c] ** 2);
  }
}

/** The buffers of a decoded chunk, to be transferred. @param {DecodedChunk} chunk @returns {Transferable[]} */
export function buffersOf(chunk) {
  return [chunk.geometry.buffer, chunk.look.buffer, chunk.sortable.buffer, chunk.window.buffer];
}
