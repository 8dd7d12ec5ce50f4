// The clock of a scene: seconds of the clip as a function of a running time base, which sound replaces by its own.

/** Maps a time base to scene time, with speed and loop. */
export class Clock {
  /** @param {number} duration seconds @param {() => number} now seconds of the time base */
  constructor(duration, now) {
    this.duration = duration;
    this.now = now;
    this.isPlaying = false;
    this.loop = true;
    this.speed = 1;
    /** Scene time at the time base's `anchorNow`. */
    this.anchorTime = 0;
    this.anchorNow = 0;
    /** Counts whatever moves the mapping. */
    this.version = 0;
    /** Seconds between a command to play and the first moment, which sound needs to start. */
    this.lead = 0;
  }

  /** Scene time that has gone by since the anchor, over all laps. */
  elapsed() {
    return this.isPlaying ? this.anchorTime + Math.max(0, this.now() - this.anchorNow) * this.speed : this.anchorTime;
  }

  /** Seconds of the clip, 0 up to but not including its duration. */
  time() {
    const t = this.elapsed();
    // As in `lastMoment`.
    const last = this.duration * (1 - 2 ** -23);
    return this.loop && this.duration > 0 ? Math.min(last, t % this.duration) : Math.min(last, Math.max(0, t));
  }

  /** Whether a clip that does not loop has come to its end. */
  hasEnded() {
    return !this.loop && this.elapsed() >= this.duration;
  }

  /** @param {{ time?: number, playing?: boolean, speed?: number, loop?: boolean, now?: () => number, lead?: number }} change */
  set({ time = this.time(), playing = this.isPlaying, speed = this.speed, loop = this.loop, now = this.now, lead = this.lead }) {
    Object.assign(this, { isPlaying: playing, speed, loop, now, lead });
    this.anchorTime = Math.min(Math.max(0, time), this.duration);
    this.anchorNow = now() + lead;
    this.version += 1;
  }
}
