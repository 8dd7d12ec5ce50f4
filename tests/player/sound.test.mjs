// Sound: directions and gains under node; levels, sides and time in Chromium's OfflineAudioContext; the clock of the running page.
import assert from 'node:assert/strict';
import { existsSync, mkdtempSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { basename, join } from 'node:path';
import test from 'node:test';
import { nearestDirection, readEars } from '../../assets/player/ears.js';
import { direction, distanceGain, piece } from '../../assets/player/sound.js';
import { writeChromiumHead } from './chromium_head.mjs';
import { browserMissing, launch, openPage, serve } from './harness.mjs';
import { azimuth, azimuthOf, CIRCLE, cues, engineHears, exportedEars, listener, noise, POSE_SECONDS } from './hearing.mjs';
import { fewEars, randomGaussians, tone, wav } from './scenes.mjs';
import { write4dgs } from './write4dgs.mjs';

const SKIP = browserMissing() ?? false;
const RATE = 48000;
const SYNC_SECONDS = 0.02;
const STUCK_MS = 20_000;
/** A voice at the microphone is as loud as it was recorded, to this, dB. */
const VOICE_DB = 2;
const EYE = { rotation: [1, 0, 0, 0, 1, 0, 0, 0, 1], center: [0, 0, 0] };
const db = (ratio) => 20 * Math.log10(ratio);
/** What the player's PannerNode and `ivv sound render` may differ by with the same ears. */
const SAME_EARS = { db: 0.5, degrees: 0.5 };
const NO_ENGINE = process.env.IVV ? false : 'IVV names no program';
/** What Chromium's head and the sphere differ by at most: between the ears, and in the azimuth that a time between them means. */
const HEADS_DIFFER = { db: 3.5, degrees: 7 };
/** A set of measured responses as Debian's libmysofa has it, used where it is. */
const KEMAR = process.env.IVV_HRTF ?? '/usr/share/libmysofa/MIT_KEMAR_normal_pinna.sofa';
/** A source, and ten heads around it: where its recording was made, turned, elsewhere, beyond it, with it behind them, above and below it. */
const SOURCE = [0, 0, 2];
const HEADS = [listener([0, 0, 0], 0), listener([0, 0, 0], 32), listener([0, 0, 0], -61), listener([1, 0, 1], 0), listener([-0.8, 0, 0.6], 20), listener([0.5, 0, 3.2], -100),
  listener([0, 0, 0], 163), listener([0.9, 0, 2.7], 20), listener([-0.8, 0.6, 0.6], 20), listener([0.5, -0.7, 3.2], -100)];
/** The same heads as a player would have them that took left for right, or that turned 10 degrees too far. */
const MIRRORED = HEADS.map(({ center: [x, y, z], yaw }) => listener([-x, y, z], -yaw));
const TURNED = HEADS.map(({ center, yaw }) => listener(center, yaw + 10));

test('directions: right is x, up is y, front is -z of Web Audio, whatever way the listener faces', () => {
  assert.deepEqual(direction([2, 0, 0], EYE), [1, -0, -0]);
  assert.deepEqual(direction([0, -3, 0], EYE), [0, 1, -0]);
  assert.deepEqual(direction([0, 0, 5], EYE), [0, -0, -1]);
  const facingRight = { rotation: [0, 0, -1, 0, 1, 0, 1, 0, 0], center: [1, 0, 0] };
  const found = direction([3, 0, 2], facingRight);
  [-Math.SQRT1_2, 0, -Math.SQRT1_2].forEach((v, c) => assert.ok(Math.abs(found[c] - v) < 1e-12, `${found}`));
  assert.deepEqual(direction([0, 0, 0], EYE), [0, 0, -1]);
});

test('the law of distance: 1 at the microphone, half at twice the distance, bounded, and 1/r without a microphone', () => {
  const mic = [0, 0, 0];
  assert.equal(distanceGain([0, 0, 2], mic, mic, 0.2), 1);
  assert.equal(distanceGain([0, 0, 2], [0, 0, -2], mic, 0.2), 0.5);
  assert.equal(distanceGain([0, 0, 2], [0, 0, 2], mic, 0.2), 10);
  assert.equal(distanceGain([0, 0, 0], [0, 0, 4], mic, 0.2), 0.05);
  assert.equal(distanceGain([0, 0, 4], [0, 0, 0], null, 0.2), 0.25);
  assert.equal(distanceGain([0, 0, 0.5], [0, 0, 0], null, 0.2), 1);
});

test('pieces of a sound within a lap', () => {
  const source = { start: 1, duration: 2, loop: false };
  assert.deepEqual(piece(source, 0, 10), { at: 1, offset: 0, length: 2 });
  assert.deepEqual(piece(source, 2.5, 10), { at: 2.5, offset: 1.5, length: 0.5 });
  assert.equal(piece(source, 3, 10), null);
  assert.deepEqual(piece({ ...source, loop: true }, 4.5, 10), { at: 4.5, offset: 1.5, length: 5.5 });
  assert.deepEqual(piece({ ...source, start: -0.5 }, 0, 1), { at: 0, offset: 0.5, length: 1 });
});

test('ears: what is stored is read, the nearest direction is found, damage is told', () => {
  const ears = readEars(fewEars());
  assert.deepEqual([ears.taps, ears.rows, ears.step, ears.samples.length, ears.samples[0], ears.samples[47]], [4, [1, 4, 1], 0.25, 48, -8, 39]);
  const found = [[0, -1, 0], [0, 0, -1], [-1, 0.1, 0.2], [0.1, 0, 1], [-0.1, 0, 1], [1, 0, 0], [0.9, 0, -0.5], [0.1, 1, 0]].map((to) => nearestDirection(ears, to));
  assert.deepEqual(found, [0, 1, 2, 3, 3, 4, 4, 5]);
  const whole = fewEars();
  for (let n = 0; n < whole.length; n += 1) assert.throws(() => readEars(whole.subarray(0, n)), { name: 'FormatError', message: /expected/ }, `${n} bytes`);
  for (const [at, word] of [[0, 0], [8, 44100], [12, 0], [12, 0xffffffff], [16, 0], [16, 0xffffffff], [20, 0], [24, 0xffffffff], [32, 0], [32, 0x7fc00000], [36, 0xffffffff]]) {
    const damaged = fewEars();
    damaged.writeUInt32LE(word, at);
    assert.throws(() => readEars(damaged), { name: 'FormatError', message: /ears: expected/ }, `byte ${at}: ${word}`);
  }
});

/** Renders sources with the page's own modules. Runs in the page. */
async function renderOffline({ seconds, rate, sources, duration, listener, listeners, poseSeconds, mic, changes, ears }) {
  const [{ Mixer }, { Clock }, { readEars: read }] = await Promise.all([import('./sound.js'), import('./clock.js'), import('./ears.js')]);
  const context = new OfflineAudioContext(2, seconds * rate, rate);
  const sounds = sources.map(({ samples, ...source }) => {
    const buffer = context.createBuffer(1, samples.length, rate);
    buffer.copyToChannel(Float32Array.from(samples), 0);
    return { source: { id: 1, name: '', codec: 'wav', start: 0, duration: samples.length / rate, gain: 1, spatial: true, loop: false, position: [0, 0, 1], keys: [], step: false, ...source }, buffer };
  });
  const clock = new Clock(duration, () => context.currentTime);
  const mixer = new Mixer(context, sounds, clock, { mic, rMin: 0.2 }, ears ? read(Uint8Array.from(atob(ears), (c) => c.charCodeAt(0))) : null);
  clock.set({ playing: true });
  const listenerAt = (t) => (listeners ? listeners[Math.min(listeners.length - 1, Math.floor(t / poseSeconds))] : listener);
  mixer.advance(listenerAt(0));
  const course = [];
  for (let t = 0.01; t < seconds - 0.01; t += 0.01) {
    void context.suspend(t).then(() => {
      for (const change of changes ?? []) {
        if (!change.done && context.currentTime >= change.at) {
          change.done = true;
          clock.set(change.set);
        }
      }
      course.push([context.currentTime, clock.time()]);
      mixer.advance(listenerAt(context.currentTime));
      return context.resume();
    });
  }
  const result = await context.startRendering();
  return { left: Array.from(result.getChannelData(0)), right: Array.from(result.getChannelData(1)), course };
}

const rms = (x, from = 0.2, to = 0.9) => Math.sqrt(x.slice(from * RATE, to * RATE).reduce((s, v) => s + v * v, 0) / ((to - from) * RATE));

test('sound in Chromium', { skip: SKIP, timeout: 300_000 }, async (t) => {
  const g = randomGaussians(100, 0);
  const bytes = write4dgs(g, { duration: 2, sounds: [{ id: 3, name: 'voice', duration: 2, data: tone(2), position: [1, 0, 3] }] });
  const server = await serve({ 'scene.4dgs': bytes });
  t.after(() => server.close());
  const browser = await launch();
  t.after(() => browser.close());
  const page = await openPage(browser.context, server.url);
  // Chromium loads its responses of the head for as long as a panner is alive; offline contexts that come while it does may never
  // begin. One panner that stays keeps them loaded.
  await page.evaluate(async (sampleRate) => {
    window.keptPanner = new PannerNode(new OfflineAudioContext(2, 1, sampleRate), { panningModel: 'HRTF' });
    await new Promise((resolve) => setTimeout(resolve, 1000));
  }, RATE);
  const second = noise(RATE, 11, 0.3);
  /** What a function of the page makes with an offline context; it is run again where that never begins. */
  const evaluate = async (work, options) => {
    for (let tries = 0; tries < 3; tries += 1) {
      const result = await Promise.race([page.evaluate(work, options), new Promise((resolve) => setTimeout(resolve, STUCK_MS, null))]);
      if (result) return result;
    }
    throw new Error('the offline contexts of this browser do not begin');
  };
  const render = (options) => evaluate(renderOffline, { seconds: 1, rate: RATE, duration: 10, listener: EYE, poseSeconds: POSE_SECONDS, mic: null, ...structuredClone(options) });

  /** What heads hear one after the other of a recording that was made at the origin. */
  const renderHeads = (heads, samples, ears) => render({ ears, seconds: heads.length * POSE_SECONDS, duration: 100, mic: [0, 0, 0], listeners: heads, sources: [{ samples, position: SOURCE }] });

  await t.test('left, right, front, at two distances', async (sub) => {
    const place = async (position) => {
      const { left, right } = await render({ sources: [{ samples: second, position }] });
      return { left: rms(left), right: rms(right) };
    };
    const [left, right, front, far] = [await place([-2, 0, 0]), await place([2, 0, 0]), await place([0, 0, 2]), await place([0, 0, 4])];
    sub.diagnostic(`level differences of the ears: left ${db(left.left / left.right).toFixed(1)} dB, right ${db(right.right / right.left).toFixed(1)} dB, front ${db(front.left / front.right).toFixed(2)} dB`);
    assert.ok(db(left.left / left.right) > 6 && db(right.right / right.left) > 6);
    assert.ok(Math.abs(db(front.left / front.right)) < 1);
    assert.ok(Math.abs(db(left.left / right.right)) < 1, 'left and right mirror each other');
    const drop = db(front.left / far.left);
    sub.diagnostic(`twice the distance: ${drop.toFixed(3)} dB less`);
    assert.ok(Math.abs(drop - 6.0206) < 0.1);
  });

  await t.test('at the microphone the recording has its own level, and a listener at half the distance hears 6 dB more', async (sub) => {
    const at = async (z) => {
      const listener = { ...EYE, center: [0, 0, z] };
      const { left } = await render({ sources: [{ samples: second, position: [0, 0, 2] }], mic: [0, 0, 0], listener });
      return rms(left);
    };
    const plain = await render({ sources: [{ samples: second, spatial: false }] });
    const [atMic, near] = [await at(0), await at(1)];
    assert.ok(Math.abs(db(near / atMic) - 6.0206) < 0.1, `${db(near / atMic)}`);
    assert.ok(Math.abs(db(rms(plain.left) / rms(second))) < 0.1 && rms(plain.left) === rms(plain.right), 'a plain source sounds plainly');
    // White noise is 5 dB quieter, since Chromium's head dampens what is high; of a voice that is little.
    const low = (x) => { let y = 0; return x.map((v) => { y += 0.07 * (v - y); return y; }); };
    const voice = low(low(noise(RATE, 12, 1)));
    const { left } = await render({ sources: [{ samples: voice, position: [0, 0, 2] }], mic: [0, 0, 0] });
    sub.diagnostic(`a voice ahead: ${db(rms(left) / rms(voice)).toFixed(2)} dB`);
    assert.ok(Math.abs(db(rms(left) / rms(voice))) < VOICE_DB, `${db(rms(left) / rms(voice))} dB`);
  });

  await t.test("heads hear with Chromium's ears what `ivv sound render` renders with the same ears", { skip: NO_ENGINE }, async (sub) => {
    const folder = mkdtempSync(join(tmpdir(), 'ivv-chromium-head-'));
    sub.after(() => rmSync(folder, { recursive: true }));
    const ahead = await writeChromiumHead(folder, evaluate);
    const elsewhere = HEADS.filter(({ center: [x, y] }) => x !== 0 && y === 0);
    const atMic = elsewhere.map((head) => listener([0, 0, 0], azimuth(SOURCE, head)));
    const heads = [...HEADS, ...MIRRORED, ...TURNED, ...CIRCLE];
    const samples = noise(RATE * POSE_SECONDS * heads.length);
    const page = cues(await renderHeads([...HEADS, ...atMic], samples), HEADS.length + atMic.length);
    const hear = (listeners, hrtf) => cues(engineHears(samples, SOURCE, listeners, hrtf), listeners.length);
    const engine = hear(heads, folder);
    const circle = engine.splice(3 * HEADS.length);
    const sphere = hear([...HEADS, ...CIRCLE], 'sphere');
    const sphereCircle = sphere.splice(HEADS.length);
    // The engine makes white noise ahead as loud as its recording, and Chromium leaves its responses as they are.
    const apart = (a, b, around, i) => {
      const [mine, its] = [a, b].map(({ itd }) => azimuthOf(itd, around, azimuth(SOURCE, HEADS[i])));
      return { azimuth: mine, degrees: mine - its, ild: a.ild - b.ild, level: a.level - b.level - ahead };
    };
    const isSame = ({ degrees, ild, level }) => Math.abs(degrees) < SAME_EARS.degrees && Math.abs(ild) < SAME_EARS.db && Math.abs(level) < SAME_EARS.db;
    const [right, mirrored, turned] = [0, 1, 2].map((k) => HEADS.map((_, i) => apart(page[i], engine[k * HEADS.length + i], circle, i)));
    const toSphere = sphere.map((cue, i) => apart(page[i], cue, sphereCircle, i));
    const say = ({ degrees, ild, level }) => `${degrees.toFixed(2)} degrees, ${ild.toFixed(2)} dB between the ears, level ${level.toFixed(2)} dB`;
    sub.diagnostic(`white noise ahead: ${ahead.toFixed(2)} dB`);
    HEADS.forEach((head, i) => {
      const angle = azimuth(SOURCE, head);
      sub.diagnostic(`azimuth ${angle.toFixed(1)}: off by ${say(right[i])}; from the sphere by ${say(toSphere[i])}`);
      assert.ok(isSame(right[i]), `pose ${i} is off by ${say(right[i])}`);
      assert.ok(head.center[1] !== 0 || Math.abs(right[i].azimuth - angle) < 2, `pose ${i} at ${angle} degrees is heard at ${right[i].azimuth}`);
      assert.ok(Math.abs(toSphere[i].ild) < HEADS_DIFFER.db && Math.abs(toSphere[i].degrees) < HEADS_DIFFER.degrees, `pose ${i}: ${say(toSphere[i])} from the sphere`);
      // Straight ahead, a mirror changes nothing.
      assert.ok(i === 0 || !isSame(mirrored[i]), `pose ${i} would pass with left for right`);
      assert.ok(!isSame(turned[i]), `pose ${i} would pass with a head turned too far`);
    });
    elsewhere.forEach((head, k) => {
      const [found, law] = [page[HEADS.indexOf(head)].level - page[HEADS.length + k].level, db(2 / Math.hypot(...SOURCE.map((p, c) => p - head.center[c])))];
      sub.diagnostic(`a head elsewhere hears it ${found.toFixed(2)} dB louder than one at the microphone, by the law ${law.toFixed(2)} dB`);
      assert.ok(Math.abs(found - law) < 0.3, `${found} and ${law} dB`);
    });
  });

  for (const hrtf of ['sphere', KEMAR]) {
    await t.test(`with the engine's ears (${basename(hrtf)}) heads hear what \`ivv sound render\` renders`, { skip: NO_ENGINE || (hrtf === 'sphere' || existsSync(hrtf) ? false : `${hrtf} is not there`) }, async (sub) => {
      const samples = noise(RATE * POSE_SECONDS * (HEADS.length + CIRCLE.length));
      const ears = await exportedEars(hrtf);
      const page = cues(await renderHeads(HEADS, samples, ears.toString('base64')), HEADS.length);
      const engine = cues(engineHears(samples, SOURCE, [...HEADS, ...CIRCLE], hrtf), HEADS.length + CIRCLE.length);
      sub.diagnostic(`${ears.length} bytes of ears`);
      assert.ok(ears.length < 2_500_000);
      HEADS.forEach((head, i) => {
        const angle = azimuth(SOURCE, head);
        const [a, b] = [page[i], engine[i]].map((cue) => ({ ...cue, azimuth: azimuthOf(cue.itd, engine.slice(HEADS.length), angle) }));
        sub.diagnostic(`azimuth ${angle.toFixed(1)}: ${a.azimuth.toFixed(1)} and ${b.azimuth.toFixed(1)} degrees, level differences ${a.ild.toFixed(2)} and ${b.ild.toFixed(2)} dB, levels ${a.level.toFixed(2)} and ${b.level.toFixed(2)} dB`);
        assert.ok(Math.abs(a.azimuth - b.azimuth) < 2, `pose ${i}: ${a.azimuth} and ${b.azimuth} degrees`);
        assert.ok(Math.abs(a.ild - b.ild) < 1 && Math.abs(a.level - b.level) < 1, `pose ${i}: ${a.ild} and ${b.ild} dB, ${a.level} and ${b.level} dB`);
      });
    });
  }

  await t.test('a source that moves from left to right does', async () => {
    const { left, right } = await render({ sources: [{ samples: second, keys: [{ time: 0, position: [-2, 0, 0.1] }, { time: 1, position: [2, 0, 0.1] }] }] });
    assert.ok(db(rms(left, 0.05, 0.3) / rms(right, 0.05, 0.3)) > 4);
    assert.ok(db(rms(right, 0.7, 0.95) / rms(left, 0.7, 0.95)) > 4);
  });

  await t.test('clicks are heard within 20 ms of the clock: from the start, after a seek, over a loop, at other speeds, after a pause', async (sub) => {
    const duration = 1.5;
    const clicks = [0.25, 0.6, 1.2];
    const samples = new Array(duration * RATE).fill(0);
    for (const c of clicks) for (let i = 0; i < 48; i += 1) samples[Math.round(c * RATE) + i] = 0.8;
    let worst = 0;
    for (const changes of [[], [{ at: 0.4, set: { time: 1 } }], [{ at: 0.3, set: { speed: 0.5 } }, { at: 1.1, set: { speed: 2 } }], [{ at: 0.45, set: { playing: false } }, { at: 0.9, set: { playing: true } }]]) {
      const { left, course } = await render({ seconds: 4, duration, sources: [{ samples, spatial: false }], changes });
      const heard = left.flatMap((v, i) => (Math.abs(v) > 0.3 && !left.slice(Math.max(0, i - 480), i).some((u) => Math.abs(u) > 0.3) ? [i / RATE] : []));
      const passed = course.slice(1).reduce((n, [, s1], k) => n + clicks.filter((c) => course[k][1] < c && c <= s1).length, 0);
      assert.ok(passed >= 5 && Math.abs(heard.length - passed) <= 1, `the clock passed ${passed} clicks, heard at ${heard}`);
      for (const at of heard) {
        // The scene time that the clock showed when the click sounded, from the nearest moments that were noted.
        const k = course.findIndex(([now]) => now > at);
        if (k < 1) continue;
        const [[t0, s0], [t1, s1]] = [course[k - 1], course[k]];
        const shown = s1 >= s0 ? s0 + ((at - t0) / (t1 - t0)) * (s1 - s0) : s0;
        const error = Math.min(...clicks.map((c) => Math.abs(c - shown)));
        worst = Math.max(worst, error);
      }
    }
    sub.diagnostic(`worst: ${(1000 * worst).toFixed(1)} ms`);
    assert.ok(worst < SYNC_SECONDS, `${worst} s`);
  });

  await t.test('the page takes the clock of its sound, after a gesture', async (sub) => {
    await page.evaluate(() => window.ivv.ready);
    assert.equal(await page.evaluate(() => window.ivv.app.sound.context), null);
    assert.equal(await page.locator('#mute').isVisible(), true);
    await page.locator('#start').click();
    await page.waitForFunction(() => window.ivv.app.sound.isHeard && window.ivv.stats().time > 0.3, null, { timeout: 30_000 });
    assert.equal(await page.evaluate(() => window.ivv.app.sound.context.sampleRate), RATE, "Chromium's ears are louder at a higher rate");
    const gaps = await page.evaluate(async () => {
      const { sound, player } = window.ivv.app;
      const found = [];
      for (let i = 0; i < 20; i += 1) {
        await new Promise((resolve) => setTimeout(resolve, 20));
        const { context } = sound;
        const heard = context.currentTime - (context.outputLatency || context.baseLatency || 0);
        const { clock } = player;
        found.push(clock.anchorTime + (heard - clock.anchorNow) * clock.speed - clock.elapsed());
      }
      return found;
    });
    sub.diagnostic(`clock of the page against that of the sound: ${(1000 * Math.max(...gaps.map(Math.abs))).toFixed(1)} ms`);
    assert.ok(gaps.every((gap) => Math.abs(gap) < SYNC_SECONDS), `${gaps}`);
    await page.locator('#mute').click();
    await page.waitForFunction(() => window.ivv.app.sound.mixer.master.gain.value < 0.01);
    // At once: a hidden tab has no next frame.
    const [playing, paused] = await page.evaluate(() => {
      const { running } = window.ivv.app.sound.mixer;
      const before = running.size;
      window.ivv.pause();
      return [before, running.size];
    });
    assert.ok(playing > 0 && paused === 0, `${playing} sources, then ${paused}`);
    assert.deepEqual(page.faults, []);
  });

  await t.test('the page hears with the ears of its file; damaged ones are said, and the sound plays', async () => {
    for (const [ears, isUsed] of [[fewEars(), true], [fewEars().subarray(0, 60), false]]) {
      const other = await serve({ 'scene.4dgs': write4dgs(g, { duration: 2, ears, sounds: [{ id: 3, name: 'voice', duration: 2, data: tone(2), position: [1, 0, 3] }] }) });
      const second = await openPage(browser.context, other.url);
      await second.evaluate(() => window.ivv.ready);
      await second.locator('#start').click();
      if (!isUsed) await second.getByText('The ears of this file cannot be used').waitFor({ timeout: 20_000 });
      await second.waitForFunction(() => window.ivv.app.sound.isHeard && window.ivv.stats().time > 0.2, null, { timeout: 20_000 });
      const state = await second.evaluate(() => ({ hasEars: window.ivv.app.sound.mixer.ears !== null, rate: window.ivv.app.sound.context.sampleRate }));
      assert.deepEqual(state, { hasEars: isUsed, rate: RATE });
      assert.deepEqual(second.faults, []);
      await second.close();
      await other.close();
    }
  });

  await t.test('sound that cannot be decoded is said, and the picture plays', async () => {
    const broken = write4dgs(g, { duration: 2, sounds: [{ id: 3, name: 'voice', duration: 2, data: wav([0.1]).subarray(0, 20) }] });
    const other = await serve({ 'scene.4dgs': broken });
    const second = await openPage(browser.context, other.url);
    await second.evaluate(() => window.ivv.ready);
    await second.locator('#start').click();
    await second.getByText('Sound "voice" cannot be played').waitFor({ timeout: 20_000 });
    await second.waitForFunction(() => window.ivv.stats().time > 0.2, null, { timeout: 20_000 });
    await second.close();
    await other.close();
  });
});
