// Sound of a scene: each source by the ears of the file, or a panner of the browser, in its direction, with the gain of its distance. Where sound runs,
// its clock is the clock of the picture. Works in an OfflineAudioContext as well.
import { add, apply, distance } from './camera.js';
import { soundPosition, triple } from './container.js';
import { EarPair, EARS_RATE, earsOf } from './ears.js';

const SMOOTH_SECONDS = 0.015;
const LEAD_SECONDS = 0.04;
const SCHEDULE_SECONDS = 0.5;
const STANDARD_R_MIN = 0.2;
/** @type {Record<string, string>} */
const CODECS = { wav: 'audio/wav', opus: 'audio/ogg' };

/**
 * Gain of a source's distance. With the microphone's position `mic`: r_m / max(r_l, r_min), so that a listener at the microphone
 * hears the recording as it is. Without: 1 / max(r_l, 1).
 * @param {number[]} source world @param {number[]} listener world @param {number[] | null} mic world @param {number} rMin scene units
 */
export function distanceGain(source, listener, mic, rMin) {
  const reach = distance(source, listener);
  return mic ? Math.max(distance(source, mic), rMin) / Math.max(reach, rMin) : 1 / Math.max(reach, 1);
}

/**
 * Direction of a source in Web Audio's axes (x right, y up, z back), as the default listener hears it.
 * @param {number[]} source world @param {Pick<import('./camera.js').View, 'rotation' | 'center'>} listener
 */
export function direction(source, listener) {
  const [x, y, z] = apply(listener.rotation, add(source, listener.center, -1));
  const r = Math.hypot(x, y, z);
  return r < 1e-6 ? [0, 0, -1] : [x / r, -y / r, -z / r];
}

/**
 * Pieces of a source within a lap of the clip, from scene time `from` on.
 * @param {import('./container.js').SoundSource} source @param {number} from seconds @param {number} duration of the clip, seconds
 * @returns {{ at: number, offset: number, length: number } | null} start in scene time, offset in the sound, seconds that it lasts
 */
export function piece(source, from, duration) {
  const end = source.loop ? duration : Math.min(duration, source.start + source.duration);
  const at = Math.max(from, source.start, 0);
  if (at >= end) return null;
  const elapsed = at - source.start;
  return { at, offset: source.loop ? elapsed % source.duration : elapsed, length: end - at };
}

/** Plays decoded sources in time with a clock. */
export class Mixer {
  /**
   * @param {BaseAudioContext} context
   * @param {{ source: import('./container.js').SoundSource, buffer: AudioBuffer }[]} sounds
   * @param {import('./clock.js').Clock} clock whose time base is `context`'s, less `latency`
   * @param {{ mic: number[] | null, rMin: number }} law
   * @param {import('./ears.js').Ears | null} [ears] those of the file
   */
  constructor(context, sounds, clock, law, ears = null) {
    this.context = context;
    this.ears = ears;
    this.clock = clock;
    this.law = law;
    this.master = context.createGain();
    this.master.connect(context.destination);
    this.voices = sounds.map(({ source, buffer }) => this.voice(source, buffer));
    this.seen = -1;
    this.nextLap = 0;
    /** @type {Set<AudioBufferSourceNode>} */
    this.running = new Set();
    this.isPlaced = false;
  }

  /** @param {import('./container.js').SoundSource} source @param {AudioBuffer} buffer */
  voice(source, buffer) {
    const gain = this.context.createGain();
    if (!source.spatial) {
      gain.gain.value = source.gain;
      gain.connect(this.master);
      return { source, buffer, gain, point: null };
    }
    if (this.ears) {
      const pair = new EarPair(this.context, this.ears, gain, this.master);
      return { source, buffer, gain, point: pair.point.bind(pair) };
    }
    const panner = new PannerNode(this.context, { panningModel: 'HRTF', distanceModel: 'inverse', rolloffFactor: 0 });
    gain.connect(panner).connect(this.master);
    const { positionX, positionY, positionZ } = panner;
    /** @param {number[]} to */
    const point = (to) => [positionX, positionY, positionZ].forEach((axis, c) => { axis.value = to[c]; });
    return { source, buffer, gain, point };
  }

  /**
   * Follows clock and listener; call it often. @param {Pick<import('./camera.js').View, 'rotation' | 'center'>} listener
   */
  advance(listener) {
    this.place(listener);
    const { clock, context } = this;
    if (this.seen !== clock.version) {
      this.seen = clock.version;
      this.stop();
      this.nextLap = 0;
    }
    while (clock.isPlaying && (clock.loop || this.nextLap === 0)) {
      const start = this.nextLap === 0 ? clock.anchorNow : this.baseAt(this.nextLap * clock.duration);
      if (start > context.currentTime + SCHEDULE_SECONDS || !(clock.duration > 0)) return;
      this.schedule(this.nextLap);
      this.nextLap += 1;
    }
  }

  /** Time of the time base at which the clock shows `elapsed` seconds over all laps. @param {number} elapsed */
  baseAt(elapsed) {
    return this.clock.anchorNow + (elapsed - this.clock.anchorTime) / this.clock.speed;
  }

  /** Starts all that sounds in a lap. @param {number} lap */
  schedule(lap) {
    const { clock, context } = this;
    for (const { source, buffer, gain } of this.voices) {
      const part = piece(source, lap === 0 ? clock.anchorTime : 0, clock.duration);
      if (!part) continue;
      const node = new AudioBufferSourceNode(context, { buffer, playbackRate: clock.speed, loop: source.loop, loopEnd: Math.min(source.duration, buffer.duration) });
      // What should have begun already begins now, so much further in.
      const when = this.baseAt(lap * clock.duration + part.at);
      const late = Math.max(0, context.currentTime - when);
      node.connect(gain);
      node.start(Math.max(when, context.currentTime), part.offset + late * clock.speed);
      node.stop(Math.max(when + part.length / clock.speed, context.currentTime));
      node.onended = () => this.running.delete(node);
      this.running.add(node);
    }
  }

  stop() {
    for (const node of this.running) {
      node.onended = null;
      node.stop();
      node.disconnect();
    }
    this.running.clear();
  }

  /** Puts every source where the listener hears it. @param {Pick<import('./camera.js').View, 'rotation' | 'center'>} listener */
  place(listener) {
    const { context, clock, law } = this;
    const t = clock.time();
    for (const { source, gain, point } of this.voices) {
      if (!point) continue;
      const position = soundPosition(source, t);
      point(direction(position, listener));
      const level = source.gain * distanceGain(position, listener.center, law.mic, law.rMin);
      if (this.isPlaced) gain.gain.setTargetAtTime(level, context.currentTime, SMOOTH_SECONDS);
      else gain.gain.value = level;
    }
    this.isPlaced = true;
  }
}

/** The law of distance that a scene states. @param {import('./container.js').Scene} scene */
export function soundLaw(scene) {
  const entries = scene.metadata.get('ivv.sound');
  const rMin = Number(entries?.get('r_min') ?? NaN);
  return { mic: triple(entries, 'mic'), rMin: rMin > 0 ? rMin : STANDARD_R_MIN };
}

/** Seconds of a running context that are heard now, without the steps in which contexts count. @param {AudioContext} context */
function heardTime(context) {
  let offset = NaN;
  return () => {
    const local = performance.now() / 1000;
    const found = context.currentTime - (context.outputLatency || context.baseLatency || 0) - local;
    offset = Math.abs(found - offset) < 0.05 ? offset + 0.05 * (found - offset) : found;
    return local + offset;
  };
}

/** Sound of the page: begins with a gesture, and hands its clock to the player. */
export class Sound {
  /**
   * @param {import('./source.js').ByteSource} file @param {import('./container.js').Scene} scene @param {import('./clock.js').Clock} clock
   * @param {(text: string) => void} onFault
   */
  constructor(file, scene, clock, onFault) {
    this.file = file;
    this.scene = scene;
    this.clock = clock;
    this.onFault = onFault;
    this.isMuted = false;
    /** @type {AudioContext | null} */
    this.context = null;
    /** @type {Mixer | null} */
    this.mixer = null;
    this.isHeard = false;
    this.localTime = clock.now;
  }

  /** Call it within a gesture: browsers let no sound begin without one. */
  start() {
    if (this.context) {
      void this.context.resume();
      return;
    }
    // The ears of files are of this rate. And Chromium's own are louder at a higher one: by 6 dB at twice the rate.
    this.context = new AudioContext({ latencyHint: 'interactive', sampleRate: EARS_RATE });
    this.context.onstatechange = () => this.settle();
    void this.load(this.context);
  }

  /** @param {AudioContext} context */
  async load(context) {
    const sounds = await Promise.all(this.scene.sounds.map(async (source) => {
      try {
        if (!CODECS[source.codec]) throw new Error(`expected sound as wav or opus, found ${source.codec}`);
        const bytes = await this.file.read(source.data.offset, source.data.length);
        return [{ source, buffer: await context.decodeAudioData(bytes.slice().buffer) }];
      } catch (error) {
        this.onFault(`Sound "${source.name || source.id}" cannot be played: ${/** @type {Error} */ (error).message}`);
        return [];
      }
    }));
    const ears = await earsOf(this.file, this.scene).catch((error) => {
      this.onFault(`The ears of this file cannot be used, so you hear with the browser's: ${error.message}`);
      return null;
    });
    this.mixer = new Mixer(context, sounds.flat(), this.clock, soundLaw(this.scene), ears);
    this.mixer.master.gain.value = this.isMuted ? 0 : 1;
    this.settle();
  }

  /** Takes the clock of the sound while it runs, and the page's while it does not. */
  settle() {
    const { context, mixer, clock } = this;
    const isHeard = context?.state === 'running' && mixer !== null;
    if (!context || isHeard === this.isHeard) return;
    this.isHeard = isHeard;
    const latency = context.outputLatency || context.baseLatency || 0;
    clock.set(isHeard ? { now: heardTime(context), lead: latency + LEAD_SECONDS } : { now: this.localTime, lead: 0 });
  }

  /** @param {boolean} isMuted */
  mute(isMuted) {
    this.isMuted = isMuted;
    if (this.mixer && this.context) this.mixer.master.gain.setTargetAtTime(isMuted ? 0 : 1, this.context.currentTime, SMOOTH_SECONDS);
  }

  /** Follows clock and listener. @param {Pick<import('./camera.js').View, 'rotation' | 'center'>} listener */
  advance(listener) {
    if (this.isHeard) this.mixer?.advance(listener);
  }
}
