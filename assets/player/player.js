// The player without its page: a scene, its chunks, its clock, and frames of exact or of the latest order.
import { add, depthAxis, distance, dot, lookAlong, row, scaled, unit, viewOf } from './camera.js';
import { ChunkStore } from './chunks.js';
import { Clock } from './clock.js';
import { lastMoment, openScene, triple } from './container.js';
import { LOOK_TEXELS } from './decode.js';
import { openContext, Renderer, rowSlotsOf } from './gl.js';

const DEVICE_BYTES = 768 * 2 ** 20;
const AHEAD_SECONDS = 3;
const DEFAULT_FOV = 50;
const MAX_VIEWS_BYTES = 1 << 23;

/**
 * @typedef {import('./camera.js').View} View
 * @typedef {View & { name: string }} StartView
 */

/** Starts a worker from its file, or from the text that a single-file page carries. */
function startWorker() {
  const text = document.getElementById('worker')?.textContent;
  if (!text) return new Worker(new URL('worker.js', import.meta.url), { type: 'module' });
  const url = URL.createObjectURL(new Blob([text], { type: 'text/javascript' }));
  const worker = new Worker(url);
  URL.revokeObjectURL(url);
  return worker;
}

/** A number of the metadata record `ivv`. @param {Map<string, string> | undefined} entries @param {string} key @param {number} standard */
function setting(entries, key, standard) {
  const value = Number(entries?.get(key) ?? NaN);
  return Number.isFinite(value) && value >= 0 ? value : standard;
}

/** Plays one scene into one canvas. */
export class Player {
  /**
   * @param {HTMLCanvasElement} canvas
   * @param {import('./source.js').ByteSource} source
   * @param {(fault: Error) => void} onFault faults that do not end the show
   */
  static async open(canvas, source, onFault) {
    const scene = await openScene(source);
    const views = await readViews(source, scene);
    return new Player(canvas, source, scene, views, onFault);
  }

  /**
   * @param {HTMLCanvasElement} canvas @param {import('./source.js').ByteSource} source @param {import('./container.js').Scene} scene
   * @param {{ views: StartView[], background: number[] | null }} start @param {(fault: Error) => void} onFault
   */
  constructor(canvas, source, scene, start, onFault) {
    const gl = openContext(canvas);
    if (!gl) throw new Error('This browser has no WebGL2, which the player needs.');
    this.canvas = canvas;
    this.source = source;
    this.scene = scene;
    this.gl = gl;
    this.onFault = onFault;
    const ivv = scene.metadata.get('ivv');
    this.isOwn = ivv !== undefined || /\bivv\b/.test(scene.header.library);
    this.look = {
      blur: setting(ivv, 'blur', 0.3),
      alphaMin: setting(ivv, 'alpha_min', 1 / 255),
      alphaMax: setting(ivv, 'alpha_max', 0.99),
      near: setting(ivv, 'near', 0.01),
      background: triple(ivv, 'background') ?? start.background ?? [0, 0, 0],
    };
    this.startViews = start.views;
    this.up = this.findUp(triple(ivv, 'up'));
    this.clock = new Clock(scene.header.duration, () => performance.now() / 1000);
    /** @type {View} */
    this.view = this.homeView();
    this.sort = { isBusy: false, id: 0, drawn: -1, ms: 0, recycled: /** @type {Uint32Array | undefined} */ (undefined), key: '' };
    /** @type {(() => void)[]} */
    this.waiting = [];
    this.drawnKey = '';
    this.exact = 0;
    const { decoder, sorter, renderer, store } = this.makeDevice();
    this.decoder = decoder;
    this.sorter = sorter;
    this.renderer = renderer;
    this.store = store;
  }

  /** Makes what lies on the device again, after its context was lost. */
  restart() {
    this.decoder.terminate();
    this.sorter.terminate();
    Object.assign(this.sort, { isBusy: false, drawn: -1, recycled: undefined, key: '' });
    Object.assign(this, this.makeDevice());
    // The order that somebody waits for never comes.
    for (const done of this.waiting.splice(0)) done();
  }

  /** Workers, textures, and an empty store of chunks. */
  makeDevice() {
    const { gl, scene, look } = this;
    const decoder = startWorker();
    const sorter = startWorker();
    const rowSlots = rowSlotsOf(gl);
    const rowBytes = rowSlots * 16 * (4 + LOOK_TEXELS[scene.header.shDegree]);
    const all = scene.chunks.reduce((n, { count }) => n + Math.ceil(count / rowSlots), 0);
    const rows = Math.max(1, Math.min(all, Math.floor(DEVICE_BYTES / rowBytes), gl.getParameter(gl.MAX_TEXTURE_SIZE)));
    const settings = { grid: scene.grid, windows: scene.windows, cutoff: scene.header.cutoff, duration: scene.header.duration, alphaMin: look.alphaMin, shDegree: scene.header.shDegree };
    for (const worker of [decoder, sorter]) {
      worker.onerror = (event) => this.onFault(new Error(`worker: ${event.message}`));
      worker.postMessage({ type: 'setup', settings, rowSlots });
    }
    sorter.onmessage = ({ data }) => this.sorted(data);
    const renderer = new Renderer(gl, scene.header.shDegree, look, rows);
    const store = new ChunkStore(this.source, scene, { decoder, sorter, rowSlots, rows }, this.onFault);
    return { decoder, sorter, renderer, store };
  }

  /** The world's up: of the metadata, of the file's frame, of the start views, or by convention. @param {number[] | null} stated */
  findUp(stated) {
    if (stated) return unit(stated);
    const { frame, header } = this.scene;
    if (frame) return [0, 1, 2].map((axis) => (axis === frame.upAxis % 3 ? (frame.upAxis < 3 ? 1 : -1) : 0));
    const named = /^(-?)([xyz])-up/.exec(header.attributes.get('coordinate_system') ?? '');
    if (named) return ['x', 'y', 'z'].map((axis) => (axis === named[2] ? (named[1] ? -1 : 1) : 0));
    const mean = this.startViews.reduce((sum, view) => add(sum, row(view.rotation, 1), -1), [0, 0, 0]);
    if (Math.hypot(...mean) > 1e-3) return unit(mean);
    return this.isOwn ? [0, -1, 0] : [0, 1, 0];
  }

  /** Where the show begins: the first start view, the file's camera, or before the middle of what has been read. @returns {View} */
  homeView() {
    if (this.startViews.length > 0) return this.startViews[0];
    const { camera, header: { aabb } } = this.scene;
    if (camera && distance(camera.position, camera.target) > 0) {
      return this.pinhole(camera.position, add(camera.target, camera.position, -1), camera.fovY);
    }
    if (this.store && this.store.moments.sum > 0) {
      const { middle, radius } = this.store.extent();
      return this.viewOfBall(middle, radius);
    }
    // Nothing has been read yet. A few Gaussians that are far off make the box far larger than the scene.
    const middle = [0, 1, 2].map((c) => (aabb[c] + aabb[c + 3]) / 2);
    return this.viewOfBall(middle, distance(middle, aabb.slice(3)) || 1);
  }

  /** A view that holds a ball, however small, and keeps it beyond the near plane. @param {number[]} middle @param {number} radius */
  viewOfBall(middle, radius) {
    const back = lookAlong(Math.abs(this.up[2]) < 0.9 ? [0, 0, 1] : [0, 1, 0], this.up);
    const level = unit(add(row(back, 2), this.up, -dot(row(back, 2), this.up)));
    return this.pinhole(add(middle, scaled(level, -Math.max(2.2 * radius, 2 * this.look.near))), level, DEFAULT_FOV);
  }

  /** @param {number[]} center @param {number[]} forward @param {number} fovY degrees @returns {View} */
  pinhole(center, forward, fovY) {
    const f = 240 / Math.tan((Math.min(Math.max(fovY, 5), 150) * Math.PI) / 360);
    return { rotation: lookAlong(forward, this.up), center, fx: f, fy: f, cx: 320, cy: 240, width: 640, height: 480 };
  }

  /** What the views look at: the nearest point on the view's axis to the middle of the Gaussians. */
  pivotDistance() {
    const { middle, radius } = this.store.extent();
    const depth = dot(row(this.view.rotation, 2), add(middle, this.view.center, -1));
    return depth > 0.05 * radius ? depth : Math.max(radius, 1e-3);
  }

  /** Whether nothing changes with time, as far as is known: all chunks have been read, and nothing in them moves, fades or ends. */
  isStill() {
    return this.store.moments.moving === 0 && this.scene.sounds.length === 0 && this.store.slots.every(({ state }) => state === 'resident');
  }

  /** Gives chunks, orders and uploads something to do. Call once a frame. @returns {boolean} whether the moment is complete */
  advance() {
    const { clock, store } = this;
    if (clock.hasEnded() && clock.isPlaying) clock.set({ time: lastMoment(this.scene), playing: false });
    const t = clock.time();
    this.want(t);
    store.upload(this.renderer);
    if (this.exact === 0) this.requestSort(t, this.view);
    return store.isReady(t);
  }

  /** States what is to be shown. @param {number} t */
  want(t) {
    const { clock } = this;
    this.store.want(t, clock.isPlaying ? AHEAD_SECONDS * clock.speed : 0, clock.loop);
  }

  /** Asks for an order where time, view or residents have changed and no other sort runs. @param {number} t @param {Pick<View, 'rotation' | 'center'>} view */
  requestSort(t, view) {
    const { sort } = this;
    const axis = depthAxis(view);
    const key = `${t} ${axis} ${this.store.version}`;
    if (sort.isBusy || key === sort.key) return;
    sort.isBusy = true;
    sort.key = key;
    sort.id = this.store.nextSort;
    this.store.nextSort += 1;
    const recycled = sort.recycled;
    sort.recycled = undefined;
    this.sorter.postMessage({ type: 'sort', id: sort.id, t, axis, recycled }, recycled ? [recycled.buffer] : []);
  }

  /** @param {{ id: number, order: Uint32Array, count: number, ms: number }} reply */
  sorted({ id, order, count, ms }) {
    this.renderer.setOrder(order, count);
    Object.assign(this.sort, { isBusy: false, recycled: order, ms, drawn: id });
    this.store.sorted(id);
    for (const done of this.waiting.splice(0)) done();
  }

  /** Draws with the latest order. Returns whether anything had changed since the last call. @param {View} view @param {boolean} [force] @param {number} [t] */
  draw(view, force = false, t = this.clock.time()) {
    const key = `${t} ${this.sort.drawn} ${view.rotation} ${view.center} ${view.fx} ${view.fy} ${view.cx} ${view.cy} ${view.width} ${view.height}`;
    if (key === this.drawnKey && !force) return false;
    this.drawnKey = key;
    this.renderer.draw(view, t, { framebuffer: null, x: 0, y: 0 });
    return true;
  }

  /** Draws exactly this view at exactly this time, with its own order, once all its Gaussians are there. @param {View} view */
  async render(view) {
    this.exact += 1;
    try {
      const t = await this.order(view);
      this.draw(view, true, t);
    } finally {
      this.exact -= 1;
    }
  }

  /** Waits for the Gaussians of the moment and for an order of exactly this view. Returns the moment, which a clock that runs has left. @param {View} view */
  async order(view) {
    for (let t = this.clock.time(); ; ) {
      this.want(t);
      this.store.upload(this.renderer, true);
      // While chunks are missing too: the rows of those given up come back with an order that does not name them.
      this.requestSort(t, view);
      if (!this.store.isReady(t)) {
        await nextTask();
        t = this.clock.time();
      } else if (this.sort.isBusy) {
        await this.nextOrder();
      } else if (this.clock.isPlaying || this.clock.time() === t) {
        return t;
      } else {
        t = this.clock.time();
      }
    }
  }

  /** The next order, or none where the device was lost. @returns {Promise<void>} */
  nextOrder() {
    return new Promise((resolve) => this.waiting.push(resolve));
  }

  stats() {
    const { store, sort, renderer, clock, scene } = this;
    const resident = store.slots.filter(({ state }) => state === 'resident');
    return {
      time: clock.time(), duration: clock.duration, playing: clock.isPlaying,
      gaussians: scene.header.count, live: renderer.count, resident: resident.reduce((n, { entry }) => n + entry.count, 0),
      chunks: store.slots.length, chunks_resident: resident.length, bytes: this.source.fetched, file_bytes: this.source.size,
      sort_ms: sort.ms, upload_ms: store.uploadMs, draw_ms: renderer.drawMs,
    };
  }
}

/** Lets a worker's reply or a download come in; a timer of 4 ms also runs in a tab that is not drawn. @returns {Promise<void>} */
function nextTask() {
  return new Promise((resolve) => setTimeout(resolve, 4));
}

/** Start views of the attachment `views.json`; a fault in it costs the views only. @param {import('./source.js').ByteSource} source @param {import('./container.js').Scene} scene */
async function readViews(source, scene) {
  const data = scene.attachments.find(({ name }) => name === 'views.json')?.data;
  /** @type {{ views: StartView[], background: number[] | null }} */
  const start = { views: [], background: null };
  if (!data || data.length > MAX_VIEWS_BYTES) return start;
  try {
    const { views } = JSON.parse(new TextDecoder().decode(await source.read(data.offset, data.length)));
    start.views = views.map((/** @type {any} */ view) => ({ ...viewOf(view), name: String(view.name ?? '') }));
    const background = views[0]?.background;
    if (Array.isArray(background) && background.length === 3 && background.every(Number.isFinite)) start.background = background;
  } catch (error) {
    console.warn('views.json:', error);
  }
  return start;
}
