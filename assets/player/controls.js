// How a person moves: a camera rig, and the pointer, wheel and keys that turn and shift it.
import { add, apply, dot, product, row, scaled, transposed, turn, unit } from './camera.js';

const TURN_PER_PIXEL = 0.005;
const KEY_TURN = 1.2; // radians a second
const STEEPEST = 0.995; // sine of the angle to the horizon

/** A camera that turns about a point before it, or about itself. */
export class Rig {
  /** @param {import('./camera.js').View} view @param {number[]} up world @param {number} reach distance of what it looks at */
  constructor(view, up, reach) {
    this.view = view;
    this.up = up;
    this.reach = reach;
    /** @type {'orbit' | 'fly'} */
    this.mode = 'orbit';
  }

  /** @param {import('./camera.js').View} view @param {number} reach */
  set(view, reach) {
    this.view = view;
    this.reach = reach;
  }

  /** Rotates by `yaw` about up and `pitch` about the camera's x axis, radians. @param {number} yaw @param {number} pitch @param {boolean} [aboutItself] */
  turn(yaw, pitch, aboutItself = this.mode === 'fly') {
    const { rotation, center } = this.view;
    const forward = row(rotation, 2);
    const pivot = aboutItself ? center : add(center, forward, this.reach);
    const tilt = turn(unit(row(rotation, 0)), pitch);
    const steepness = dot(apply(tilt, forward), this.up);
    const isTooSteep = Math.abs(steepness) > STEEPEST && Math.abs(steepness) > Math.abs(dot(forward, this.up));
    const spin = isTooSteep ? turn(this.up, yaw) : product(turn(this.up, yaw), tilt);
    this.view = { ...this.view, rotation: product(rotation, transposed(spin)), center: add(pivot, apply(spin, add(center, pivot, -1))) };
  }

  /** Moves along the camera's axes: right, down, forward in scene units. @param {number[]} step */
  shift(step) {
    this.view = { ...this.view, center: add(this.view.center, apply(transposed(this.view.rotation), step)) };
  }

  /** Comes closer to what it looks at. @param {number} factor of the distance; below 1 is closer */
  approach(factor) {
    if (this.mode === 'fly') {
      this.shift([0, 0, this.reach * (1 - factor)]);
      return;
    }
    const reach = Math.max(this.reach * factor, 1e-4);
    this.shift([0, 0, this.reach - reach]);
    this.reach = reach;
  }

  /** Shifts so that what it looks at follows the pointer. @param {number} dx pixels of the picture @param {number} dy @param {{ fx: number, fy: number }} picture */
  pan(dx, dy, { fx, fy }) {
    this.shift([(-dx * this.reach) / fx, (-dy * this.reach) / fy, 0]);
  }
}

/** Directions of the keys that move: right, down, forward. @type {Record<string, number[]>} */
const MOVES = { KeyW: [0, 0, 1], KeyS: [0, 0, -1], KeyA: [-1, 0, 0], KeyD: [1, 0, 0], KeyQ: [0, 1, 0], KeyE: [0, -1, 0] };
/** Yaw and pitch of the keys that turn. @type {Record<string, number[]>} */
const TURNS = { ArrowLeft: [1, 0], ArrowRight: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };

/** Binds pointer, wheel and keys of a canvas to a rig. */
export class Controls {
  /** @param {HTMLElement} canvas @param {Rig} rig @param {() => import('./camera.js').View} picture the view as the canvas shows it */
  constructor(canvas, rig, picture) {
    this.canvas = canvas;
    this.rig = rig;
    this.picture = picture;
    /** @type {Map<number, { x: number, y: number }>} */
    this.pointers = new Map();
    /** @type {Set<string>} */
    this.keys = new Set();
    this.isFast = false;
    canvas.addEventListener('pointerdown', (event) => this.down(event));
    canvas.addEventListener('pointermove', (event) => this.move(event));
    for (const name of /** @type {const} */ (['pointerup', 'pointercancel', 'lostpointercapture'])) canvas.addEventListener(name, (event) => this.release(event));
    canvas.addEventListener('wheel', (event) => this.wheel(event), { passive: false });
    canvas.addEventListener('contextmenu', (event) => event.preventDefault());
    addEventListener('keydown', (event) => this.key(event, true));
    addEventListener('keyup', (event) => this.key(event, false));
    addEventListener('blur', () => this.keys.clear());
  }

  /** @param {PointerEvent} event */
  down(event) {
    this.canvas.setPointerCapture(event.pointerId);
    this.canvas.classList.add('dragging');
    this.pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
  }

  /** @param {PointerEvent} event */
  release(event) {
    this.pointers.delete(event.pointerId);
    if (this.pointers.size === 0) this.canvas.classList.remove('dragging');
  }

  /** @param {PointerEvent} event */
  move(event) {
    const before = this.pointers.get(event.pointerId);
    if (!before) return;
    const [dx, dy] = [event.clientX - before.x, event.clientY - before.y];
    const others = [...this.pointers].filter(([id]) => id !== event.pointerId).map(([, at]) => at);
    this.pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    const picture = this.picture();
    const scale = picture.width / this.canvas.clientWidth;
    if (others.length > 0) {
      const spread = (/** @type {{ x: number, y: number }} */ at) => Math.hypot(at.x - others[0].x, at.y - others[0].y) || 1;
      this.rig.approach(spread(before) / spread({ x: event.clientX, y: event.clientY }));
      this.rig.pan((dx * scale) / 2, (dy * scale) / 2, picture);
    } else if (event.buttons & 2 || event.buttons & 4 || event.shiftKey) {
      this.rig.pan(dx * scale, dy * scale, picture);
    } else {
      // What is under the pointer follows it: the scene turns in orbit, the gaze turns the other way in flight.
      const angle = this.rig.mode === 'fly' ? TURN_PER_PIXEL : -TURN_PER_PIXEL;
      this.rig.turn(angle * sideways(this.rig) * dx, angle * dy);
    }
  }

  /** @param {WheelEvent} event */
  wheel(event) {
    event.preventDefault();
    const lines = event.deltaMode === 1 ? event.deltaY * 16 : event.deltaY;
    this.rig.approach(Math.exp(Math.max(-200, Math.min(200, lines)) * 0.0015));
  }

  /** @param {KeyboardEvent} event @param {boolean} isDown */
  key(event, isDown) {
    this.isFast = event.shiftKey;
    const isMove = event.code in MOVES || (event.code in TURNS && document.activeElement === this.canvas);
    if (!isMove || event.ctrlKey || event.metaKey || event.altKey || isTyping(event)) {
      this.keys.delete(event.code);
      return;
    }
    if (event.code in TURNS) event.preventDefault();
    if (isDown) this.keys.add(event.code);
    else this.keys.delete(event.code);
  }

  /** Moves by the keys that are held. @param {number} seconds since the last call */
  advance(seconds) {
    if (this.keys.size === 0) return;
    const speed = this.rig.reach * (this.isFast ? 1.6 : 0.5) * seconds;
    for (const code of this.keys) {
      if (MOVES[code]) this.rig.shift(scaled(MOVES[code], speed));
      else this.rig.turn(TURNS[code][0] * sideways(this.rig) * KEY_TURN * seconds, TURNS[code][1] * KEY_TURN * seconds, true);
    }
  }
}

/** 1 where the camera stands upright, -1 where it hangs: left stays left. @param {Rig} rig */
function sideways(rig) {
  return dot(row(rig.view.rotation, 1), rig.up) > 0 ? -1 : 1;
}

/** Whether keys belong to an element that takes text or choices. @param {KeyboardEvent} event */
export function isTyping(event) {
  return event.target instanceof HTMLInputElement ? !['checkbox', 'range'].includes(event.target.type) : event.target instanceof HTMLSelectElement;
}
