// The worker: one instance decodes chunks, another sorts. Messages and replies carry their buffers over.
import { FormatError } from './bytes.js';
import { buffersOf, decodeChunk } from './decode.js';
import { Sorter } from './sorter.js';

/** @type {import('./decode.js').DecodeSettings} */
let settings;
/** @type {Sorter} */
let sorter;

/** @typedef {{ postMessage: (message: any, transfer?: Transferable[]) => void, onmessage: ((event: MessageEvent) => void) | null }} WorkerScope */
const scope = /** @type {WorkerScope} */ (/** @type {unknown} */ (globalThis));

/** What each message does. @type {Record<string, (message: any) => void | Promise<void>>} */
const actions = {
  setup(message) {
    settings = message.settings;
    sorter = new Sorter(settings.windows, message.rowSlots);
  },
  async decode({ id, record, bands, count }) {
    try {
      const chunk = await decodeChunk(record, bands, settings, count);
      scope.postMessage({ type: 'decoded', id, chunk }, buffersOf(chunk));
    } catch (error) {
      const { message } = /** @type {Error} */ (error);
      scope.postMessage({ type: 'refused', id, code: error instanceof FormatError ? error.code : 'internal', message });
    }
  },
  load({ id, chunk }) {
    sorter.chunks.set(id, chunk);
  },
  evict({ id }) {
    sorter.chunks.delete(id);
  },
  sort({ id, t, axis, recycled }) {
    const start = performance.now();
    const { order, count } = sorter.sort(t, axis, recycled);
    scope.postMessage({ type: 'sorted', id, order, count, ms: performance.now() - start }, [order.buffer]);
  },
};

scope.onmessage = ({ data }) => void actions[data.type](data);
