// Pictures of the page in Chromium against the formulas in float64, and against `ivv render` where $IVV names the program.
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import test from 'node:test';
import { fileURLToPath } from 'node:url';
import { browserMissing, launch, psnr } from './harness.mjs';
import { engineOf, picturesOf, smaller } from './pictures.mjs';
import { decodeAll, random, randomGaussians, renderTruth } from './scenes.mjs';
import { readPly, write4dgs, writePly } from './write4dgs.mjs';

const SKIP = browserMissing() ?? false;
const demo = fileURLToPath(new URL('../../assets/demo/', import.meta.url));
const GOAL_DB = 40;

/** A camera at `center` that looks at `target`; image y is down. */
export function lookAt(center, target, width = 160, height = 120, f = 140) {
  const unit = (v) => v.map((x) => x / Math.hypot(...v));
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const z = unit(target.map((v, c) => v - center[c]));
  const x = unit(cross(z, [0, -1, 0]));
  const rows = [x, cross(z, x), z];
  return { world_to_camera: rows.map((r) => [...r, -r.reduce((s, v, c) => s + v * center[c], 0)]), fx: f, fy: f * 1.03, cx: width / 2 + 3, cy: height / 2 - 2, width, height };
}

test('pictures agree with the formulas and the engine', { skip: SKIP, timeout: 300_000 }, async (t) => {
  const browser = await launch();
  t.after(() => browser.close());
  await t.test('demo scene, eight views, each at its time', async (sub) => {
    const duration = 2;
    const ply = readFileSync(join(demo, 'scene.ply'));
    const { views } = JSON.parse(readFileSync(join(demo, 'cameras.json')));
    const background = views[0].background;
    const bytes = write4dgs(readPly(ply, duration), { duration, ivv: { background: background.join(' ') }, views: { views } });
    await compare(sub, browser.context, bytes, ply, views.map((view) => [smaller(view, 160), view.time * duration]), duration, background);
  });
  await t.test('moving Gaussians of degree 3, chunk borders and the end of the clip', async (sub) => {
    const duration = 2;
    const g = randomGaussians(2500, 3);
    const times = [0, 0.31, 0.5, 0.999, 1, 1.5, 1.77, 2 * (1 - 2 ** -30)];
    const shots = times.map((time, i) => [lookAt([2.5 * Math.sin(i), -0.6 + 0.2 * i, 3 - 2.5 * Math.cos(i)], [0, 0, 3]), time]);
    await compare(sub, browser.context, write4dgs(g, { duration }), writePly(g, duration), shots, duration, [0, 0, 0]);
  });
  await t.test('a static scene of degree 3, near and wide', async (sub) => {
    const g = randomGaussians(3000, 3, 5);
    g.sigma.fill(Infinity);
    g.velocity = g.velocity.map(() => [0, 0, 0]);
    const next = random(3);
    const shots = [0, 1, 2].map(() => [lookAt([next() - 0.5, next() - 0.5, 2.2 + next()], [next(), next() - 0.5, 4], 160, 120, 70), 0]);
    await compare(sub, browser.context, write4dgs(g, { duration: 0.5, ivv: { background: '0.2 0.3 0.4' } }), writePly(g, 0), shots, 0.5, [0.2, 0.3, 0.4]);
  });
});

/** @param {import('node:test').TestContext} sub */
async function compare(sub, context, bytes, ply, shots, duration, background) {
  const { gaussians } = await decodeAll(bytes);
  const pictures = await picturesOf(context, bytes, shots);
  const engine = engineOf(ply, 'scene.ply', shots, duration, background);
  const rows = pictures.map((picture, i) => ({
    truth: psnr(picture, renderTruth(gaussians, shots[i][0], shots[i][1], { background })),
    noCut: psnr(picture, renderTruth(gaussians, shots[i][0], shots[i][1], { background, tMin: 0 })),
    engine: engine && psnr(picture, engine[i]),
  }));
  for (const [i, { truth, noCut, engine: e }] of rows.entries()) {
    sub.diagnostic(`t ${shots[i][1].toFixed(3)}: ${truth.toFixed(1)} dB to the formulas, ${noCut.toFixed(1)} without t_min, ${e ? e.toFixed(1) : 'no'} dB to the engine`);
  }
  assert.ok(rows.every(({ truth, engine: e }) => truth >= GOAL_DB && (e === null || e >= GOAL_DB)), JSON.stringify(rows));
  const varied = pictures[0].some((v) => Math.abs(v - pictures[0][0]) > 0.1);
  assert.ok(varied, 'the picture is empty');
}
