// The example for three.js: what Spark shows of a `.4dgs` in Chromium, beside the player's own picture.
import assert from 'node:assert/strict';
import { readdirSync } from 'node:fs';
import { join } from 'node:path';
import test from 'node:test';
import { fileURLToPath } from 'node:url';
import { browserMissing, launch, openPage, packageDir, playerDir, psnr, rgbOf, serve } from './harness.mjs';
import { picturesOf } from './pictures.mjs';
import { randomGaussians } from './scenes.mjs';
import { write4dgs } from './write4dgs.mjs';

const SKIP = browserMissing() ?? (packageDir('three') && packageDir('@sparkjsdev/spark') ? false : 'three and @sparkjsdev/spark are not installed');
const VIEW = { world_to_camera: [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]], fx: 140, fy: 140, cx: 80, cy: 60, width: 160, height: 120 };
/** Spark blurs and cuts by its own constants, and its quads hold three standard deviations. */
const ALIKE_DB = 30;

/** Shows moments of scene.4dgs with Spark. Runs in the page. @returns RGBA bytes of each */
async function showWithSpark({ moments, view }) {
  const [THREE, SPARK, { loadSplats }] = await Promise.all([import('three'), import('@sparkjsdev/spark'), import('/tools/examples/three-spark.js')]);
  const renderer = new THREE.WebGLRenderer({ preserveDrawingBuffer: true });
  renderer.setPixelRatio(1);
  renderer.setSize(view.width, view.height);
  const camera = new THREE.PerspectiveCamera((2 * Math.atan(view.height / 2 / view.fy) * 180) / Math.PI, view.width / view.height, 0.01, 100);
  camera.quaternion.set(1, 0, 0, 0); // looks along z with y down
  const { mesh, duration, setTime } = await loadSplats('/scene.4dgs', { THREE, SPARK });
  const scene = new THREE.Scene();
  scene.add(new SPARK.SparkRenderer({ renderer, sortRadial: false, accumExtSplats: true }), mesh);
  const pictures = [];
  for (const t of moments) {
    setTime(t);
    // Spark sorts beside the frames that it draws.
    for (let frame = 0; frame < 12; frame += 1) {
      renderer.render(scene, camera);
      await new Promise((resolve) => setTimeout(resolve, 50));
    }
    const gl = renderer.getContext();
    const bytes = new Uint8Array(4 * view.width * view.height);
    gl.readPixels(0, 0, view.width, view.height, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
    const rows = Array.from({ length: view.height }, (_, y) => Array.from(bytes.subarray(4 * view.width * y, 4 * view.width * (y + 1))));
    pictures.push(rows.reverse().flat());
  }
  return { pictures, duration, count: mesh.splats.getNumSplats() };
}

test('Spark shows the moments of a file as the player does', { skip: SKIP, timeout: 300_000 }, async (t) => {
  const duration = 2;
  const bytes = write4dgs(randomGaussians(800, 0), { duration });
  const three = packageDir('three');
  const spark = join(packageDir('@sparkjsdev/spark'), 'dist/spark.module.min.js');
  const files = { 'scene.4dgs': bytes, 'tools/examples/three-spark.js': fileURLToPath(new URL('../../tools/examples/three-spark.js', import.meta.url)), 'spark.js': spark };
  for (const name of ['three.module.js', 'three.core.js']) files[name] = join(three, 'build', name);
  files['pass.js'] = join(three, 'examples/jsm/postprocessing/Pass.js');
  for (const name of readdirSync(playerDir).filter((file) => file.endsWith('.js'))) files[`assets/player/${name}`] = join(playerDir, name);
  const map = { imports: { three: '/three.module.js', 'three/addons/postprocessing/Pass.js': '/pass.js', '@sparkjsdev/spark': '/spark.js' } };
  files['spark.html'] = Buffer.from(`<!doctype html><meta charset="utf-8"><title>Spark</title><link rel="icon" href="data:,"><script type="importmap">${JSON.stringify(map)}</script>`);
  const server = await serve(files, { policy: null });
  t.after(() => server.close());
  const browser = await launch();
  t.after(() => browser.close());
  const moments = [0.3, 1.4];
  const mine = await picturesOf(browser.context, bytes, moments.map((moment) => [VIEW, moment]));
  const page = await openPage(browser.context, `${server.url}spark.html`);
  const found = await page.evaluate(showWithSpark, { moments, view: VIEW });
  assert.deepEqual([found.duration, found.count], [duration, 800]);
  const theirs = found.pictures.map(rgbOf);
  const [same, other] = [theirs.map((picture, i) => psnr(picture, mine[i])), theirs.map((picture, i) => psnr(picture, mine[1 - i]))];
  t.diagnostic(`to the player's picture of the same moment ${same.map((db) => db.toFixed(1))} dB, of the other moment ${other.map((db) => db.toFixed(1))} dB`);
  assert.ok(same.every((db, i) => db >= ALIKE_DB && db > other[i] + 6), `${same}, ${other}`);
  assert.deepEqual(page.faults, []);
});
