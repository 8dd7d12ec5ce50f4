// The page around the picture: bar, settings, statistics, notices, and the page of a fault. Text goes in as text only.
import { FormatError } from './bytes.js';
import { isTyping } from './controls.js';

const IDLE_MS = 3000;
const NOTICE_MS = 6000;
const FRAME_SECONDS = 1 / 30;

/** @template {HTMLElement} T @param {string} id @returns {T} */
export const element = (id) => /** @type {T} */ (document.getElementById(id));

/** `m:ss.t`. @param {number} seconds */
export function clockText(seconds) {
  // The last moment of a clip, which is a little less, counts as its length.
  const tenths = Math.floor(seconds * 10 * (1 + 2 ** -22) + 1e-6);
  return `${Math.floor(tenths / 600)}:${String(Math.floor(tenths / 10) % 60).padStart(2, '0')}.${tenths % 10}`;
}

/** A number of bytes for people. @param {number} n */
const bytesText = (n) => (n < 1e6 ? `${(n / 1e3).toFixed(0)} kB` : `${(n / 1e6).toFixed(1)} MB`);

/** Shows a fault in place of the player. @param {unknown} error */
export function showFault(error) {
  const fault = /** @type {Error} */ (error);
  const isFile = fault instanceof FormatError;
  const isNetwork = fault instanceof TypeError || (isFile && ['http', 'busy', 'changed'].includes(fault.code));
  const [title, hint] = isNetwork
    ? ['The scene could not be fetched', 'Check that scene.4dgs lies beside this page and that the server runs. A page opened from a disk needs the single-file export.']
    : isFile
      ? ['This file cannot be played', `Export the scene again, or fetch the file anew. (${fault.code})`]
      : ['This browser cannot show the scene', 'The player needs WebGL2: a current browser with graphics acceleration turned on.'];
  element('fault-title').textContent = title;
  element('fault-text').textContent = `${fault.message.charAt(0).toUpperCase()}${fault.message.slice(1)}`;
  element('fault-hint').textContent = hint;
  element('fault').hidden = false;
  document.body.dataset.state = 'fault';
  element('fault-again').addEventListener('click', () => location.reload(), { once: true });
  element('fault-again').focus();
}

/** A line above the picture that goes away. @param {string} text */
export function notify(text) {
  const notice = element('notice');
  notice.textContent = text;
  notice.hidden = false;
  clearTimeout(Number(notice.dataset.timer));
  notice.dataset.timer = String(setTimeout(() => { notice.hidden = true; }, NOTICE_MS));
}

/** @param {string} text @param {number | null} share 0 to 1; null where it is not known */
export function showLoading(text, share) {
  element('loading-text').textContent = text;
  const bar = /** @type {HTMLProgressElement} */ (element('loading-bar'));
  if (share === null) bar.removeAttribute('value');
  else bar.value = share;
}

/** Puts another symbol and label on a button. @param {HTMLElement} button @param {string} symbol @param {string} label */
function relabel(button, symbol, label) {
  if (button.getAttribute('aria-label') === label) return;
  button.querySelector('use')?.setAttribute('href', `#${symbol}`);
  button.setAttribute('aria-label', label);
}

/**
 * @typedef {object} Actions what the page can ask for
 * @property {() => void} toggle play or pause
 * @property {(t: number) => void} seek seconds
 * @property {(seconds: number) => void} step back or on from now
 * @property {(speed: number) => void} speed
 * @property {(loops: boolean) => void} loop
 * @property {() => void} mute
 * @property {(index: number) => void} view start view by number
 * @property {() => void} reset
 * @property {(mode: 'orbit' | 'fly') => void} mode
 * @property {(share: number) => void} quality
 * @property {() => void} enterXr
 */

/** Binds the page's elements. */
export class Ui {
  /** @param {Actions} actions @param {{ duration: number, views: string[], hasSound: boolean }} scene */
  constructor(actions, scene) {
    this.actions = actions;
    this.scene = scene;
    this.time = /** @type {HTMLInputElement} */ (element('time'));
    this.time.max = String(scene.duration);
    this.isScrubbing = false;
    this.idle = 0;
    this.loaded = '';
    element('mute').hidden = !scene.hasSound;
    this.bindBar();
    this.bindSettings();
    addEventListener('keydown', (event) => this.key(event));
    for (const name of ['pointermove', 'pointerdown', 'keydown']) addEventListener(name, () => this.wake());
    this.wake();
  }

  /** Shows or hides what has to do with time. @param {boolean} hasTime */
  showTime(hasTime) {
    document.body.toggleAttribute('data-still', !hasTime);
    element('start').hidden = !hasTime;
  }

  /** @param {boolean} isThere whether a headset is there */
  showXr(isThere) {
    element('enter-xr').hidden = !isThere;
  }

  bindBar() {
    const { actions, time } = this;
    for (const id of ['play', 'start']) element(id).addEventListener('click', () => actions.toggle());
    element('mute').addEventListener('click', () => actions.mute());
    element('full').addEventListener('click', () => this.fullScreen());
    element('enter-xr').addEventListener('click', () => actions.enterXr());
    time.addEventListener('input', () => { this.isScrubbing = true; actions.seek(Number(time.value)); });
    time.addEventListener('change', () => { this.isScrubbing = false; });
    time.addEventListener('keydown', (event) => {
      const step = { ArrowLeft: -FRAME_SECONDS, ArrowRight: FRAME_SECONDS, PageDown: -1, PageUp: 1 }[event.key];
      if (step === undefined) return;
      event.preventDefault();
      actions.step(step);
    });
    element('settings-open').addEventListener('click', () => this.showSettings(element('settings').hidden === true));
    element('canvas').addEventListener('pointerdown', () => this.showSettings(false));
  }

  bindSettings() {
    const { actions, scene } = this;
    const views = /** @type {HTMLSelectElement} */ (element('views'));
    scene.views.forEach((name, i) => views.add(new Option(name || `View ${i + 1}`, String(i))));
    element('views-row').hidden = scene.views.length === 0;
    /** @param {string} id @param {(input: any) => void} act */
    const onChange = (id, act) => element(id).addEventListener('change', ({ target }) => act(target));
    onChange('views', ({ value }) => actions.view(Number(value)));
    onChange('mode', ({ value }) => actions.mode(value));
    onChange('speed', ({ value }) => actions.speed(Number(value)));
    onChange('quality', ({ value }) => actions.quality(Number(value)));
    onChange('loop', ({ checked }) => actions.loop(checked));
    onChange('stats-on', ({ checked }) => { element('stats').hidden = !checked; });
    element('reset').addEventListener('click', () => actions.reset());
    element('help-open').addEventListener('click', () => this.showHelp());
  }

  showHelp() {
    /** @type {HTMLDialogElement} */ (element('help')).showModal();
  }

  /** @param {boolean} isShown */
  showSettings(isShown) {
    element('settings').hidden = !isShown;
    element('settings-open').setAttribute('aria-expanded', String(isShown));
  }

  fullScreen() {
    if (document.fullscreenElement) void document.exitFullscreen();
    else document.documentElement.requestFullscreen?.().catch(() => notify('This browser does not allow full screen here.'));
  }

  /** @param {KeyboardEvent} event */
  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || isTyping(event)) return;
    const { actions } = this;
    const { target } = event;
    const onButton = target instanceof HTMLButtonElement || (target instanceof HTMLInputElement && target.type === 'checkbox');
    /** @type {Record<string, () => void>} */
    const commands = {
      j: () => actions.step(-1), l: () => actions.step(1), ',': () => actions.step(-FRAME_SECONDS), '.': () => actions.step(FRAME_SECONDS),
      home: () => actions.seek(0), m: () => actions.mute(), f: () => this.fullScreen(), r: () => actions.reset(), '?': () => this.showHelp(),
      v: () => this.flip('views', this.scene.views.map((_, i) => String(i))), g: () => this.flip('mode', ['orbit', 'fly']), i: () => element('stats-on').click(), escape: () => this.showSettings(false),
    };
    if (!onButton) commands[' '] = () => actions.toggle();
    const command = commands[event.key.toLowerCase()];
    if (!command || element('fault').hidden === false) return;
    if (event.key === ' ') event.preventDefault();
    command();
  }

  /** Takes the next choice of a list. @param {string} id @param {string[]} values */
  flip(id, values) {
    if (values.length === 0) return;
    const select = /** @type {HTMLSelectElement} */ (element(id));
    select.value = values[(values.indexOf(select.value) + 1) % values.length];
    select.dispatchEvent(new Event('change'));
  }

  /** Shows the bar, which goes away when nobody does anything for a while. */
  wake() {
    document.body.classList.remove('idle');
    this.idle = performance.now() + IDLE_MS;
  }

  /** @param {{ time: number, isPlaying: boolean, isWaiting: boolean, isMuted: boolean, buffered: number[][] }} state */
  update({ time, isPlaying, isWaiting, isMuted, buffered }) {
    const { duration } = this.scene;
    relabel(element('play'), isPlaying ? 'i-pause' : 'i-play', isPlaying ? 'Pause' : 'Play');
    relabel(element('mute'), isMuted ? 'i-mute' : 'i-sound', isMuted ? 'Sound on' : 'Mute');
    element('mute').setAttribute('aria-pressed', String(isMuted));
    if (isPlaying) element('start').hidden = true;
    if (isPlaying && element('settings').hidden && performance.now() > this.idle) document.body.classList.add('idle');
    const text = isWaiting ? 'Loading' : clockText(time);
    const clock = element('clock');
    if (clock.dataset.text !== text) {
      clock.dataset.text = text;
      const now = document.createElement('b');
      now.textContent = text;
      clock.replaceChildren(now, ` / ${clockText(duration)}`);
      this.time.setAttribute('aria-valuetext', `${text} of ${clockText(duration)}`);
    }
    if (!this.isScrubbing) this.time.value = String(time);
    this.time.style.setProperty('--at', `${(100 * time) / (duration || 1)}%`);
    const loaded = bands(buffered, duration);
    if (loaded !== this.loaded) this.time.style.setProperty('--loaded', loaded);
    this.loaded = loaded;
  }

  /** @param {ReturnType<import('./player.js').Player['stats']> & { fps: number }} stats */
  showStats(stats) {
    if (element('stats').hidden) return;
    const rows = {
      'Frames a second': stats.fps.toFixed(0), 'Live Gaussians': stats.live.toLocaleString('en'), 'On the device': stats.resident.toLocaleString('en'),
      Sort: `${stats.sort_ms.toFixed(1)} ms`, Draw: stats.draw_ms ? `${stats.draw_ms.toFixed(1)} ms` : 'not measured', Upload: `${stats.upload_ms.toFixed(1)} ms`,
      Fetched: `${bytesText(stats.bytes)} of ${bytesText(stats.file_bytes)}`,
    };
    const list = /** @type {HTMLElement} */ (element('stats').querySelector('dl'));
    list.replaceChildren(...Object.entries(rows).flatMap(([name, value]) => [['dt', name], ['dd', value]].map(([tag, text]) => Object.assign(document.createElement(tag), { textContent: text }))));
  }
}

/** The parts of the time bar that are loaded, as a CSS gradient. @param {number[][]} spans seconds @param {number} duration */
function bands(spans, duration) {
  const merged = /** @type {number[][]} */ ([]);
  for (const [from, to] of spans.filter(([t0, t1]) => t1 - t0 < 0.95 * duration || spans.length === 1).sort((a, b) => a[0] - b[0])) {
    const last = merged[merged.length - 1];
    if (last && from <= last[1] + 1e-9) last[1] = Math.max(last[1], to);
    else merged.push([from, to]);
  }
  if (merged.length === 0) return 'linear-gradient(transparent, transparent)';
  const percent = (/** @type {number} */ t) => `${((100 * t) / (duration || 1)).toFixed(2)}%`;
  const stops = merged.flatMap(([from, to]) => [`transparent ${percent(from)}`, `rgb(255 255 255 / 20%) ${percent(from)} ${percent(to)}`, `transparent ${percent(to)}`]);
  return `linear-gradient(to right, ${stops.join(', ')})`;
}
