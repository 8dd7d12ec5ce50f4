// Where a file's bytes come from: HTTP ranges, or memory.
import { FormatError } from './bytes.js';

const FIRST_READ = 65536;
const MAX_IN_MEMORY = 2 ** 31 - 1;
const MAX_TRIES = 3;
const RETRY_MS = 700;

/**
 * @typedef {object} ByteSource
 * @property {number} size bytes of the file
 * @property {number} fetched bytes that have been transferred so far
 * @property {(offset: number, length: number, signal?: AbortSignal) => Promise<Uint8Array>} read
 */

/** A file that lies in memory. @param {Uint8Array} bytes @returns {ByteSource} */
export function memorySource(bytes) {
  return {
    size: bytes.length,
    fetched: bytes.length,
    async read(offset, length) {
      if (offset + length > bytes.length) throw outside(offset, length, bytes.length);
      return bytes.subarray(offset, offset + length);
    },
  };
}

/** Decodes the base64 text of a page's element, a part at a time. @param {string} text @returns {Uint8Array} */
export function base64Bytes(text) {
  const clean = text.replace(/\s+/g, '');
  const padding = clean.endsWith('==') ? 2 : clean.endsWith('=') ? 1 : 0;
  const bytes = new Uint8Array((clean.length / 4) * 3 - padding);
  const part = 4 * 65536;
  for (let i = 0, at = 0; i < clean.length; i += part) {
    const binary = atob(clean.slice(i, i + part));
    for (let k = 0; k < binary.length; k += 1) bytes[at + k] = binary.charCodeAt(k);
    at += binary.length;
  }
  return bytes;
}

/**
 * Opens a file by HTTP. A server that ignores ranges sends it whole, which is then kept in memory.
 * @param {string} url
 * @param {(share: number) => void} [onProgress] share of a whole file that has arrived, 0 to 1
 * @returns {Promise<ByteSource>}
 */
export async function openUrl(url, onProgress) {
  const first = await fetch(url, { headers: { Range: `bytes=0-${FIRST_READ - 1}` } });
  if (first.status === 200) return memorySource(await wholeBody(first, onProgress));
  if (first.status === 416) return memorySource(new Uint8Array(0)); // No range lies in an empty file.
  if (first.status !== 206) {
    throw new FormatError('http', `${url}: expected the server to answer 200 or 206, found ${first.status} ${first.statusText}`);
  }
  const head = new Uint8Array(await first.arrayBuffer());
  const size = Number(/^bytes 0-\d+\/(\d+)$/.exec(first.headers.get('Content-Range') ?? '')?.[1] ?? NaN);
  if (!Number.isSafeInteger(size) || head.length !== Math.min(FIRST_READ, size)) {
    throw new FormatError('http', `${url}: expected a Content-Range that states the file's size, found "${first.headers.get('Content-Range')}"`);
  }
  const tag = first.headers.get('ETag') ?? first.headers.get('Last-Modified');
  /** @type {ByteSource} */
  const source = {
    size,
    fetched: head.length,
    async read(offset, length, signal) {
      if (offset + length > size) throw outside(offset, length, size);
      if (length === 0) return new Uint8Array(0);
      if (offset + length <= head.length) return head.subarray(offset, offset + length);
      return insist(async () => {
        const response = await fetch(url, { signal, headers: { Range: `bytes=${offset}-${offset + length - 1}` } });
        const bytes = response.status === 206 ? new Uint8Array(await response.arrayBuffer()) : null;
        if (!bytes || bytes.length !== length) {
          const code = response.status === 429 || response.status >= 500 ? 'busy' : 'http';
          throw new FormatError(code, `${url}: expected ${length} bytes from byte ${offset}, found ${bytes?.length ?? 'none'} (status ${response.status})`);
        }
        if (tag !== (response.headers.get('ETag') ?? response.headers.get('Last-Modified'))) {
          throw new FormatError('changed', `${url}: the file has changed on the server. Reload the page`);
        }
        source.fetched += length;
        return bytes;
      }, signal);
    },
  };
  return source;
}

/** Whether a fault may be over later: of the network, or of a server that is busy. @param {unknown} error */
export const mayPass = (error) => !(error instanceof FormatError) || error.code === 'busy';

/** Reads, and again where that may help. @template T @param {() => Promise<T>} read @param {AbortSignal} [signal] @returns {Promise<T>} */
async function insist(read, signal) {
  for (let tries = 1; ; tries += 1) {
    try {
      return await read();
    } catch (error) {
      if (signal?.aborted || !mayPass(error) || tries === MAX_TRIES) throw error;
      await new Promise((resolve) => setTimeout(resolve, RETRY_MS * tries));
    }
  }
}

/** @param {Response} response @param {((share: number) => void) | undefined} onProgress */
async function wholeBody(response, onProgress) {
  const stated = Number(response.headers.get('Content-Length') ?? NaN);
  /** @type {Uint8Array[]} */
  const parts = [];
  let n = 0;
  const reader = response.body?.getReader();
  for (let next = await reader?.read(); next?.value; next = await reader?.read()) {
    parts.push(next.value);
    n += next.value.length;
    if (n > MAX_IN_MEMORY) {
      await reader?.cancel();
      throw new FormatError('http', 'this server sends no byte ranges, and without them a file may have 2 GB at most');
    }
    if (stated > 0) onProgress?.(Math.min(1, n / stated));
  }
  const bytes = new Uint8Array(n);
  let at = 0;
  for (const part of parts) {
    bytes.set(part, at);
    at += part.length;
  }
  return bytes;
}

/** @param {number} offset @param {number} length @param {number} size */
function outside(offset, length, size) {
  return new FormatError('truncated', `expected bytes ${offset} to ${offset + length}, found a file of ${size} bytes`);
}
