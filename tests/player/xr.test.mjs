// The headset: geometry under node; both eyes' pictures in Chromium with an emulated headset against the page's own pictures.
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import test from 'node:test';
import { Placement, pinholeOf } from '../../assets/player/xr.js';
import { browserMissing, launch, openPage, packageDir, psnr, rgbOf, serve } from './harness.mjs';
import { decodeAll, randomGaussians, renderTruth } from './scenes.mjs';
import { write4dgs } from './write4dgs.mjs';

const SKIP = browserMissing() ?? (packageDir('iwer') ? false : 'iwer is not installed');
const GOAL_DB = 40;
const START = { name: 'start', world_to_camera: [[1, 0, 0, 0.1], [0, 1, 0, -0.2], [0, 0, 1, 0.3], [0, 0, 0, 1]], fx: 140, fy: 140, cx: 80, cy: 60, width: 160, height: 120 };

test('a projection with a frustum of unequal sides is a pinhole with another centre', () => {
  const [l, r, b, t, n] = [-0.8, 1.1, -1.2, 0.9, 1];
  const p = [2 / (r - l), 0, 0, 0, 0, 2 / (t - b), 0, 0, (r + l) / (r - l), (t + b) / (t - b), -1, -1, 0, 0, -2 * n, 0];
  const { fx, fy, cx, cy } = pinholeOf(p, 200, 100);
  const pixel = (x, y) => [fx * x + cx, fy * y + cy];
  const close = (found, expected) => found.forEach((v, i) => assert.ok(Math.abs(v - expected[i]) < 1e-9, `${found} instead of ${expected}`));
  close(pixel(l, -t), [0, 0]);
  close(pixel(r, -b), [200, 100]);
});

test('the first head pose stands at the view, upright, and steps are in metres', () => {
  const turned = Math.SQRT1_2;
  const head = { position: { x: 1, y: 1.6, z: 2 }, orientation: { x: 0, y: turned, z: 0, w: turned } }; // faces -x of the room
  const view = { rotation: [0, 0, -1, 0, 1, 0, 1, 0, 0], center: [5, 0, 0] }; // looks along +x, y down
  const place = new Placement(head, view, [0, -1, 0], 2);
  const close = (found, expected) => found.forEach((v, i) => assert.ok(Math.abs(v - expected[i]) < 1e-9, `${found} instead of ${expected}`));
  close(place.pose(head).center, [5, 0, 0]);
  close(place.pose(head).rotation, view.rotation);
  close(place.pose({ ...head, position: { x: 0, y: 1.6, z: 2 } }).center, [7, 0, 0]); // a metre ahead
  close(place.pose({ ...head, position: { x: 1, y: 2.6, z: 2 } }).center, [5, -2, 0]); // a metre up
});

test('whoever looks steeply up or down, in the headset or on the page, faces the same way as before', () => {
  const pitched = (degrees) => {
    const [s, c] = [Math.sin((degrees * Math.PI) / 180), Math.cos((degrees * Math.PI) / 180)];
    return [1, 0, 0, 0, c, s, 0, -s, c]; // from +z up, y down
  };
  const half = Math.PI / 4;
  /** A head that is turned to -x of the room, and then pitched up. */
  const head = (degrees) => {
    const [s, c] = [Math.sin((degrees * Math.PI) / 360), Math.cos((degrees * Math.PI) / 360)];
    return { position: { x: 1, y: 1.6, z: 2 }, orientation: { x: Math.cos(half) * s, y: Math.sin(half) * c, z: -Math.sin(half) * s, w: Math.cos(half) * c } };
  };
  for (const page of [-89, -85, -80, 0, 80, 85, 89]) {
    for (const room of [-89, -85, -80, 0, 80, 85, 89]) {
      const place = new Placement(head(room), { rotation: pitched(page), center: [5, 0, 0] }, [0, -1, 0], 1);
      const { rotation } = place.pose(head(0));
      [1, 0, 0, 0, 1, 0, 0, 0, 1].forEach((v, i) => assert.ok(Math.abs(rotation[i] - v) < 1e-9, `page ${page}, room ${room}: ${rotation}`));
    }
  }
});

test('both eyes see what the page shows from their poses', { skip: SKIP, timeout: 120_000 }, async (t) => {
  const bytes = write4dgs(randomGaussians(1500, 2), { duration: 2, views: { views: [START] }, ivv: { background: '0.1 0.2 0.3' } });
  const { gaussians } = await decodeAll(bytes);
  const server = await serve({ 'scene.4dgs': bytes });
  t.after(() => server.close());
  const browser = await launch();
  t.after(() => browser.close());
  const page = await browser.context.newPage();
  const faults = [];
  page.on('pageerror', (error) => faults.push(String(error)));
  await page.setViewportSize({ width: 320, height: 160 });
  await page.addInitScript(readFileSync(join(packageDir('iwer'), 'build/iwer.min.js'), 'utf8'));
  await page.addInitScript(() => {
    window.headset = new window.IWER.XRDevice(window.IWER.metaQuest3);
    window.headset.installRuntime({ forceInstall: true });
    window.headset.position.set(0.2, 1.6, 0.3);
    window.headset.ipd = 0.08;
    window.headset.stereoEnabled = true;
  });
  await page.goto(server.url);
  await page.evaluate(() => window.ivv.ready);
  await page.locator('#enter-xr').waitFor({ state: 'visible', timeout: 10_000 });
  const eyes = await page.evaluate(async () => {
    const request = navigator.xr.requestSession.bind(navigator.xr);
    navigator.xr.requestSession = async (...args) => (window.session = await request(...args));
    window.ivv.seek(0.8);
    const { gl, sort } = window.ivv.app.player;
    // An entry that fails leaves no session behind.
    gl.makeXRCompatible = () => Promise.reject(new Error('another adapter'));
    await window.ivv.app.xr.enter().catch((fault) => (window.refused = fault.message));
    delete gl.makeXRCompatible;
    await window.ivv.app.xr.enter();
    const frame = () => new Promise((resolve) => window.session.requestAnimationFrame(resolve));
    for (let i = 0; i < 10 || sort.isBusy; i += 1) await frame();
    window.headset.quaternion.set(0.05, 0.1, 0.02, 0.99).normalize();
    window.headset.position.set(0.25, 1.65, 0.1);
    for (let i = 0; i < 10; i += 1) await frame();
    // This runs within a frame, behind the player's own part of it.
    return window.ivv.app.xr.eyes.map((eye) => {
      const pixels = new Uint8Array(eye.width * eye.height * 4);
      gl.bindFramebuffer(gl.FRAMEBUFFER, window.session.renderState.baseLayer.framebuffer);
      gl.readPixels(eye.x, eye.y, eye.width, eye.height, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
      const rows = Array.from({ length: eye.height }, (_, y) => Array.from(pixels.subarray((eye.height - 1 - y) * eye.width * 4, (eye.height - y) * eye.width * 4))).flat();
      return { ...eye, pixels: rows };
    });
  });
  assert.equal(await page.evaluate(() => window.refused), 'another adapter');
  assert.equal(eyes.length, 2);
  const [a, b] = eyes.map(({ center }) => center);
  const apart = Math.hypot(...a.map((v, c) => v - b[c]));
  assert.ok(apart > 0.04 && apart < 0.1, `eyes ${apart} apart`);
  assert.ok(Math.abs((a[1] + b[1]) / 2 - (0.2 - 0.05)) < 0.02, `the head rose by 0.05 from the start view, y is down: ${a}`);

  await t.test('sticks scrub and walk, the trigger plays', async () => {
    const before = await page.evaluate(() => ({ time: window.ivv.stats().time, base: window.ivv.app.xr.placement.base }));
    await page.evaluate(() => {
      window.headset.controllers.right.updateAxes('thumbstick', 0.9, 0);
      window.headset.controllers.left.updateAxes('thumbstick', 0, -0.9);
    });
    await page.waitForFunction((old) => window.ivv.stats().time > old.time + 0.02 && window.ivv.app.xr.placement.base[2] > old.base[2] + 0.02, before, { timeout: 20_000 });
    await page.evaluate(() => {
      for (const side of ['left', 'right']) window.headset.controllers[side].updateAxes('thumbstick', 0, 0);
      window.headset.controllers.right.updateButtonValue('trigger', 1);
    });
    await page.waitForFunction(() => window.ivv.stats().playing, null, { timeout: 20_000 });
    await page.evaluate(() => window.headset.controllers.right.updateButtonValue('trigger', 0));
  });

  await page.evaluate(async () => { window.ivv.pause(); await window.session.end(); });
  await page.waitForFunction(() => window.ivv.app.xr.session === null);
  for (const [i, eye] of eyes.entries()) {
    const rows = [0, 1, 2].map((r) => eye.rotation.slice(3 * r, 3 * r + 3));
    const world_to_camera = rows.map((row) => [...row, -row.reduce((s, v, c) => s + v * eye.center[c], 0)]);
    const mono = await page.evaluate(async (view) => {
      window.ivv.seek(0.8);
      window.ivv.setView(view);
      await window.ivv.render();
      return Array.from(window.ivv.pixels());
    }, { ...eye, pixels: undefined, world_to_camera });
    const found = psnr(rgbOf(eye.pixels), rgbOf(mono));
    const truth = psnr(rgbOf(eye.pixels), renderTruth(gaussians, { ...eye, world_to_camera }, 0.8, { background: [0.1, 0.2, 0.3] }));
    t.diagnostic(`eye ${i}, ${eye.width} x ${eye.height}, centre ${eye.cx.toFixed(1)} ${eye.cy.toFixed(1)}: ${found.toFixed(1)} dB to the page's own picture, ${truth.toFixed(1)} dB to the formulas`);
    assert.ok(found >= GOAL_DB && truth >= GOAL_DB, `eye ${i}: ${found} dB, ${truth} dB`);
    const picture = rgbOf(eye.pixels);
    assert.ok(picture.some((v) => Math.abs(v - picture[0]) > 0.1), 'the picture is empty');
  }
  assert.deepEqual(faults, []);
});
