// Bytes of a file, read with bounds: every length is checked against what is there before it is used.

/** A file that cannot be played, and why. `code` is for programs, `message` says what was expected and what was found. */
export class FormatError extends Error {
  /** @param {string} code @param {string} message */
  constructor(code, message) {
    super(message);
    this.name = 'FormatError';
    this.code = code;
  }
}

const utf8 = new TextDecoder('utf-8', { fatal: true });

/** Reads little-endian fields of one record, front to back. */
export class Cursor {
  /** @param {Uint8Array} bytes @param {string} what name of the record, for messages */
  constructor(bytes, what) {
    this.bytes = bytes;
    this.what = what;
    this.at = 0;
    this.view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  }

  /** Bytes that are left. */
  get left() {
    return this.bytes.length - this.at;
  }

  /** Takes `n` bytes and returns where they begin. @param {number} n */
  take(n) {
    if (n > this.left) {
      throw new FormatError('truncated', `${this.what}: expected ${n} more bytes at byte ${this.at}, found ${this.left}`);
    }
    const at = this.at;
    this.at += n;
    return at;
  }

  u8() {
    return this.view.getUint8(this.take(1));
  }

  u32() {
    return this.view.getUint32(this.take(4), true);
  }

  /** A length or an offset. */
  u64() {
    const value = this.view.getBigUint64(this.take(8), true);
    if (value > 0x1f_ffff_ffff_ffffn) {
      throw new FormatError('bad-length', `${this.what}: expected a length below 2^53, found ${value}`);
    }
    return Number(value);
  }

  f64() {
    return this.view.getFloat64(this.take(8), true);
  }

  /** A number that has to be finite. @param {string} name */
  finite(name) {
    const value = this.f64();
    if (!Number.isFinite(value)) throw new FormatError('not-finite', `${this.what}: expected a finite ${name}, found ${value}`);
    return value;
  }

  /** Finite numbers. @param {number} n @param {string} name */
  finites(n, name) {
    return Array.from({ length: n }, () => this.finite(name));
  }

  /** How many items of `size` bytes follow; refused where they cannot fit. @param {number} size @param {string} name */
  count(size, name) {
    const n = this.u32();
    if (n * size > this.left) {
      throw new FormatError('bad-count', `${this.what}: expected at most ${Math.floor(this.left / size)} ${name}, found ${n}`);
    }
    return n;
  }

  /** @param {number} n */
  slice(n) {
    const at = this.take(n);
    return this.bytes.subarray(at, at + n);
  }

  string() {
    const bytes = this.slice(this.u32());
    try {
      return utf8.decode(bytes);
    } catch {
      throw new FormatError('bad-text', `${this.what}: expected text in UTF-8`);
    }
  }

  /** Pairs of strings. @returns {Map<string, string>} */
  map() {
    const block = new Cursor(this.slice(this.u32()), this.what);
    const entries = new Map();
    while (block.left > 0) entries.set(block.string(), block.string());
    return entries;
  }
}

const crcTable = Uint32Array.from({ length: 256 }, (_, n) => {
  for (let k = 0; k < 8; k += 1) n = n & 1 ? 0xedb88320 ^ (n >>> 1) : n >>> 1;
  return n;
});

/** CRC-32 (IEEE). @param {Uint8Array} bytes */
export function crc32(bytes) {
  let crc = 0xffffffff;
  for (let i = 0; i < bytes.length; i += 1) crc = crcTable[(crc ^ bytes[i]) & 255] ^ (crc >>> 8);
  return (crc ^ 0xffffffff) >>> 0;
}
