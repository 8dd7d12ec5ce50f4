// `?bench=N`: plays the clip N times along a fixed circle, and reports what frames cost.
import { add, apply, product, row, transposed, turn } from './camera.js';
import { notify } from './ui.js';

const FRAMES_A_ROUND = 60;
const SWING = 0.3; // radians to either side

/**
 * @typedef {object} Bench
 * @property {number} frames
 * @property {number} fps mean
 * @property {Record<'p5' | 'p50' | 'p95' | 'p99', number>} frame_ms
 * @property {number} sort_ms medians
 * @property {number} upload_ms of the last slice of a chunk
 * @property {number} draw_ms of a frame until the device has finished it
 * @property {number} live mean of live Gaussians
 * @property {number} width
 * @property {number} height
 * @property {number} bytes_to_first_frame
 * @property {number} bytes_per_second of the clip
 */

/** @param {import('./main.js').App} app @param {number} rounds @returns {Promise<Bench>} */
export async function runBench(app, rounds) {
  const { player } = app;
  const { clock, renderer, scene } = player;
  const bytesToFirstFrame = player.source.fetched;
  const start = player.view;
  const pivot = add(start.center, row(start.rotation, 2), player.pivotDistance());
  const times = [];
  const draws = [];
  const sorts = [];
  let live = 0;
  const total = Math.ceil(rounds * FRAMES_A_ROUND);
  const began = performance.now();
  for (let i = 0, last = performance.now(); i < total; i += 1) {
    const spin = turn(player.up, SWING * Math.sin((2 * Math.PI * i) / FRAMES_A_ROUND));
    app.show({ ...start, rotation: product(start.rotation, transposed(spin)), center: add(pivot, apply(spin, add(start.center, pivot, -1))) });
    clock.set({ time: ((i % FRAMES_A_ROUND) / FRAMES_A_ROUND) * clock.duration, playing: false });
    const view = app.currentView();
    player.exact += 1;
    const t = await player.order(view);
    sorts.push(player.sort.ms);
    const drawStart = performance.now();
    player.draw(view, true, t);
    renderer.finish();
    player.exact -= 1;
    draws.push(performance.now() - drawStart);
    live += renderer.count / total;
    await new Promise((resolve) => requestAnimationFrame(resolve));
    times.push(performance.now() - last);
    last = performance.now();
  }
  const seconds = (performance.now() - began) / 1000;
  const at = (/** @type {number[]} */ values, /** @type {number} */ share) => [...values].sort((a, b) => a - b)[Math.min(values.length - 1, Math.floor(share * values.length))];
  const bench = {
    frames: total, fps: total / seconds, frame_ms: { p5: at(times, 0.05), p50: at(times, 0.5), p95: at(times, 0.95), p99: at(times, 0.99) },
    sort_ms: at(sorts, 0.5), upload_ms: player.store.uploadMs, draw_ms: at(draws, 0.5), live: Math.round(live), width: app.canvas.width, height: app.canvas.height,
    bytes_to_first_frame: bytesToFirstFrame, bytes_per_second: scene.header.duration > 0 ? player.source.fetched / scene.header.duration : 0,
  };
  notify(`${bench.fps.toFixed(1)} frames a second, ${bench.live.toLocaleString('en')} live Gaussians, ${bench.width} x ${bench.height}; sort ${bench.sort_ms.toFixed(1)} ms, draw ${bench.draw_ms.toFixed(1)} ms`);
  return bench;
}
