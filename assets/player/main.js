// The page: opens the scene, runs the frames, and offers `window.ivv` to those who embed or test the player.
import { runBench } from './bench.js';
import { FormatError } from './bytes.js';
import { fitted, viewOf } from './camera.js';
import { lastMoment } from './container.js';
import { Controls, Rig } from './controls.js';
import { Player } from './player.js';
import { Sound } from './sound.js';
import { base64Bytes, memorySource, openUrl } from './source.js';
import { element, notify, showFault, showLoading, Ui } from './ui.js';
import { XrShow } from './xr.js';

const MAX_PIXEL_RATIO = 2;
const STATS_MS = 500;

/** The scene: inside this page, or beside it. */
function openSource() {
  const inside = document.getElementById('scene');
  if (inside) return memorySource(base64Bytes(inside.textContent ?? ''));
  return openUrl('scene.4dgs', (share) => showLoading('Fetching the scene', share));
}

/** The running player and what a person does with it. */
export class App {
  /** @param {Player} player @param {HTMLCanvasElement} canvas */
  constructor(player, canvas) {
    this.player = player;
    this.canvas = canvas;
    const { scene, startViews, clock } = player;
    this.isStill = scene.header.duration === 0;
    this.rig = new Rig(player.view, player.up, player.pivotDistance());
    this.controls = new Controls(canvas, this.rig, () => this.currentView());
    this.ui = new Ui(this.actions(), { duration: clock.duration, views: startViews.map(({ name }) => name), hasSound: scene.sounds.length > 0 });
    this.sound = scene.sounds.length > 0 ? new Sound(player.source, scene, clock, notify) : null;
    /** Pixels of the picture, where a program has set them. @type {{ width: number, height: number } | null} */
    this.fixedSize = null;
    this.quality = 1;
    this.isWaiting = false;
    this.hasStarted = false;
    this.times = /** @type {number[]} */ ([]);
    this.lastFrame = performance.now();
    this.lastStats = 0;
    this.xr = new XrShow(this);
    this.frame = this.frame.bind(this);
  }

  /** @returns {import('./ui.js').Actions} */
  actions() {
    const { player } = this;
    const { clock } = player;
    return {
      toggle: () => (clock.isPlaying || this.isWaiting ? this.pause() : this.play()),
      seek: (t) => this.seek(t),
      step: (seconds) => this.seek(clock.time() + seconds),
      speed: (speed) => clock.set({ speed }),
      loop: (loop) => clock.set({ loop }),
      mute: () => this.sound?.mute(!this.sound.isMuted),
      view: (index) => this.show(player.startViews[index]),
      reset: () => this.show(player.homeView()),
      mode: (mode) => { this.rig.mode = mode; },
      quality: (share) => { this.quality = share; },
      enterXr: () => void this.xr.enter().catch((error) => notify(`The headset cannot be entered: ${error.message}`)),
    };
  }

  play() {
    if (this.isStill) return;
    const { clock } = this.player;
    const time = clock.hasEnded() || (!clock.loop && clock.time() >= lastMoment(this.player.scene)) ? 0 : clock.time();
    this.player.store.retry();
    this.sound?.start();
    clock.set({ time, playing: true });
  }

  pause() {
    this.isWaiting = false;
    this.player.clock.set({ playing: false });
    // A tab that is hidden has no next frame, in which the sound would follow.
    this.sound?.advance(this.player.view);
  }

  /** @param {number} t seconds */
  seek(t) {
    this.player.store.retry();
    this.player.clock.set({ time: Math.min(lastMoment(this.player.scene), Math.max(0, t)) });
  }

  /** Goes to a view. @param {import('./camera.js').View} view */
  show(view) {
    this.fixedSize = null;
    this.player.view = view;
    this.rig.set(view, this.player.pivotDistance());
  }

  /** The view for the canvas as it is now. */
  currentView() {
    const { canvas, rig } = this;
    if (this.fixedSize) {
      setSize(canvas, this.fixedSize.width, this.fixedSize.height);
      return { ...rig.view, ...this.fixedSize };
    }
    const ratio = Math.min(devicePixelRatio || 1, MAX_PIXEL_RATIO) * this.quality;
    setSize(canvas, Math.max(1, Math.round(canvas.clientWidth * ratio)), Math.max(1, Math.round(canvas.clientHeight * ratio)));
    return fitted(rig.view, canvas.width, canvas.height);
  }

  /** One frame of the page. @param {number} now ms */
  frame(now) {
    requestAnimationFrame(this.frame);
    if (this.xr.session || this.player.gl.isContextLost()) return;
    const seconds = Math.min(0.1, (now - this.lastFrame) / 1000);
    this.lastFrame = now;
    this.controls.advance(seconds);
    this.step(this.rig.view, now);
    if (this.player.exact > 0 || !this.hasStarted) return;
    if (this.player.draw(this.currentView())) this.times.push(now);
  }

  /** Time, chunks, order and sound for a pose. @param {Pick<import('./camera.js').View, 'rotation' | 'center'>} pose @param {number} now ms */
  step(pose, now) {
    const { player, sound } = this;
    const { clock } = player;
    player.view = { ...player.view, ...pose };
    const isComplete = player.advance();
    if (clock.isPlaying && !isComplete) {
      clock.set({ playing: false });
      this.isWaiting = true;
    } else if (this.isWaiting && isComplete) {
      clock.set({ playing: true });
      this.isWaiting = false;
    }
    sound?.advance(pose);
    if (!this.hasStarted) this.begin(isComplete);
    this.times = this.times.filter((at) => now - at < 1000);
    this.ui.update({ time: clock.time(), isPlaying: clock.isPlaying || this.isWaiting, isWaiting: this.isWaiting, isMuted: sound?.isMuted ?? false, buffered: player.store.buffered() });
    if (now - this.lastStats >= STATS_MS) {
      this.lastStats = now;
      this.ui.showStats({ ...player.stats(), fps: this.times.length });
    }
  }

  /** Opens the curtain when the first moment is there. @param {boolean} isComplete */
  begin(isComplete) {
    const { player } = this;
    const needed = player.store.needed(player.clock.time()).map((i) => player.store.slots[i].entry);
    const total = needed.reduce((n, { chunk, bands }) => n + [chunk, ...bands].reduce((m, { length }) => m + length, 0), 0);
    showLoading('Fetching the scene', total ? Math.min(1, player.source.fetched / total) : null);
    if (!isComplete || player.sort.drawn < 0) return;
    this.hasStarted = true;
    this.isStill ||= player.isStill();
    this.ui.showTime(!this.isStill);
    if (player.startViews.length === 0) player.view = player.homeView();
    this.rig.set(player.view, player.pivotDistance());
    document.body.dataset.state = 'ready';
  }
}

/** @param {HTMLCanvasElement} canvas @param {number} width @param {number} height */
function setSize(canvas, width, height) {
  if (canvas.width !== width) canvas.width = width;
  if (canvas.height !== height) canvas.height = height;
}

/** Makes everything again after the graphics context was lost. @param {App} app */
function surviveContextLoss({ canvas, player }) {
  canvas.addEventListener('webglcontextlost', (event) => {
    event.preventDefault();
    notify('The graphics device was reset. The scene comes back in a moment.');
  });
  canvas.addEventListener('webglcontextrestored', () => player.restart());
}

/** Opens the page. @returns {Promise<App>} */
async function open() {
  const canvas = /** @type {HTMLCanvasElement} */ (element('canvas'));
  showLoading('Opening the scene', null);
  /** @type {Error | undefined} */
  let firstFault;
  const player = await Player.open(canvas, await openSource(), (fault) => {
    // A part that does not fit ends no show in which others are there.
    const isOfPart = fault instanceof FormatError && fault.code === 'too-large' && player.store.slots.some(({ rows }) => rows.length > 0);
    if (!isOfPart) firstFault ??= fault;
    notify(fault.message);
  });
  const app = new App(player, canvas);
  surviveContextLoss(app);
  document.title = player.scene.header.attributes.get('title') ?? document.title;
  document.addEventListener('visibilitychange', () => { if (document.hidden && !app.xr.session) app.pause(); });
  requestAnimationFrame(app.frame);
  while (!app.hasStarted && !firstFault) await new Promise((resolve) => setTimeout(resolve, 10));
  if (firstFault) throw firstFault;
  const rounds = Number(new URLSearchParams(location.search).get('bench'));
  if (rounds > 0) void runBench(app, rounds).then((bench) => { ivv.bench = bench; });
  return app;
}

const app = open();

/**
 * What a program can do with the page.
 * - `ready`: settles when the first picture is there; rejects with what is wrong.
 * - `seek(t)`: goes to `t` seconds of the clip.
 * - `setView(view)`: `{ world_to_camera (3 x 4 or 4 x 4 rows), fx, fy, cx, cy, width, height }` in pixels, as a row of a cameras file.
 *   The picture then has exactly this size.
 * - `render()`: settles when exactly this time and view are drawn, with an order of their own.
 * - `pixels()`: what was drawn last, RGBA bytes, rows from the top.
 * - `play()`, `pause()`; `stats()`: numbers of the moment; `bench`: the result of `?bench=N`, null before it is there.
 */
const ivv = {
  ready: app.then((opened) => { ivv.app = opened; }),
  /** @param {number} t seconds */
  seek(t) {
    if (!Number.isFinite(t)) throw new TypeError(`seek: expected seconds, found ${t}`);
    current().seek(t);
  },
  /** @param {any} source */
  setView(source) {
    const view = viewOf(source);
    current().show(view);
    current().fixedSize = { width: view.width, height: view.height };
  },
  render: () => current().player.render(current().currentView()),
  pixels() {
    const { player } = current();
    const view = current().currentView();
    player.draw(view, true);
    return player.renderer.read(view.width, view.height);
  },
  play: () => current().play(),
  pause: () => current().pause(),
  stats: () => ({ ...current().player.stats(), fps: current().times.length }),
  /** @type {import('./bench.js').Bench | null} */
  bench: null,
  /** @type {App | null} */
  app: null,
};

/** @returns {App} */
function current() {
  if (!ivv.app) throw new Error('ivv: expected a call after `await ivv.ready`, found one before');
  return ivv.app;
}

ivv.ready.catch(showFault);
Object.assign(window, { ivv });
