// The page in Chromium: its policy, controls, ranges, faults, context loss, the single file, the bench; and its sources.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { mkdtempSync, readdirSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import test from 'node:test';
import { joined, moduleLists, singleFile } from './bundle.mjs';
import { browserMissing, here, launch, openPage, packageDir, playerDir, psnr, rgbOf, serve } from './harness.mjs';
import { randomGaussians } from './scenes.mjs';
import { write4dgs } from './write4dgs.mjs';

const SKIP = browserMissing() ?? false;
const MAX_CODE_LINES = 2500;
const views = { views: [0, 1].map((i) => ({ name: `camera ${i}`, world_to_camera: [[1, 0, 0, 0.2 * i], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]], fx: 140, fy: 140, cx: 80, cy: 60, width: 160, height: 120 })) };
const small = () => write4dgs(randomGaussians(400, 1), { duration: 2, views, ivv: { background: '0.1 0.2 0.3' } });
const VIEW = { ...views.views[0] };

/** A clip of many chunks whose Gaussians live for a moment each. */
function longClip() {
  const g = randomGaussians(12000, 0, 9, 12);
  g.sigma.fill(0.05);
  g.time.forEach((t, i) => { g.time[i] = Math.floor(t) + 0.5; });
  return write4dgs(g, { duration: 12, parts: 12, views });
}

const picture = (page, t) => page.evaluate(async ([v, s]) => {
  window.ivv.seek(s);
  window.ivv.setView(v);
  await window.ivv.render();
  return Array.from(window.ivv.pixels());
}, [VIEW, t]).then(rgbOf);

/** Waits until `f` of the page is true. */
const until = (page, f, arg) => page.waitForFunction(f, arg, { timeout: 30_000, polling: 50 });

test('sources: types, size, joining, no markup from text', () => {
  const files = readdirSync(playerDir).filter((name) => name.endsWith('.js'));
  const { page, worker } = moduleLists();
  assert.deepEqual([...new Set([...page, ...worker])].sort(), files.sort());
  for (const list of [page, worker]) {
    list.forEach((name, i) => {
      for (const [, from] of readFileSync(join(playerDir, name), 'utf8').matchAll(/^import [^;]*'\.\/([^']+)';\n/gm)) {
        assert.ok(list.slice(0, i).includes(from), `${name} imports ${from}, which is not before it`);
      }
    });
    assert.doesNotMatch(joined(list), /^(import|export) /m);
  }
  const all = files.map((name) => readFileSync(join(playerDir, name), 'utf8')).join('\n');
  assert.doesNotMatch(all, /innerHTML|outerHTML|insertAdjacentHTML|document\.write|\beval\(|new Function|<\/script/);
  assert.doesNotMatch(readFileSync(join(playerDir, 'index.html'), 'utf8'), / on\w+="|style="|<script>/);
  const code = all.split('\n').filter((line) => line.trim() && !/^\s*(\/\/|\/\*|\*)/.test(line)).length;
  assert.ok(code <= MAX_CODE_LINES, `${code} lines of code, expected at most ${MAX_CODE_LINES}`);
});

test('types are sound', { skip: packageDir('typescript') && packageDir('@types/webxr') ? false : 'typescript is not installed' }, () => {
  const tsc = join(packageDir('typescript'), 'bin/tsc');
  execFileSync(process.execPath, [tsc, '-p', join(here, 'tsconfig.json'), '--typeRoots', join(packageDir('@types/webxr'), '..')], { stdio: 'pipe', encoding: 'utf8' });
});

test('the page', { skip: SKIP, timeout: 400_000 }, async (t) => {
  const browser = await launch();
  t.after(() => browser.close());
  const { context } = browser;
  /** Runs `body` with a page that shows `bytes`. */
  const withPage = async (bytes, body, { server: serverOptions, ...options } = {}) => {
    const server = await serve(bytes === null ? {} : { 'scene.4dgs': bytes }, serverOptions);
    const page = await openPage(context, `${server.url}${options.query ?? ''}`, options);
    try {
      await body(page, server);
    } finally {
      await page.close();
      await server.close();
    }
  };
  const ready = (page) => page.evaluate(() => window.ivv.ready);

  await t.test('plays, pauses, scrubs and moves by keys and pointer, under its policy', async () => {
    await withPage(small(), async (page) => {
      await ready(page);
      const stats = () => page.evaluate(() => window.ivv.stats());
      const center = () => page.evaluate(() => window.ivv.app.rig.view.center);
      await page.locator('#start').click();
      await until(page, () => window.ivv.stats().playing && window.ivv.stats().time > 0.1);
      assert.equal(await page.locator('#play').getAttribute('aria-label'), 'Pause');
      await page.locator('#canvas').focus();
      await page.keyboard.press('Space');
      assert.equal((await stats()).playing, false);
      await page.locator('#time').focus();
      const before = (await stats()).time;
      await page.keyboard.press('ArrowRight');
      assert.ok(Math.abs((await stats()).time - before - 1 / 30) < 1e-3);
      // The time bar takes no text: keys still act.
      await page.keyboard.press('Space');
      await until(page, () => window.ivv.stats().playing);
      await page.keyboard.press('Space');
      await until(page, () => !window.ivv.stats().playing);
      const start = await center();
      await page.mouse.move(200, 200);
      await page.mouse.down();
      await page.mouse.move(260, 220, { steps: 3 });
      await page.mouse.up();
      const turned = await center();
      assert.ok(turned[0] < start[0] - 0.1 && turned[1] < start[1] - 0.01, `dragged right and down: the camera goes left and up: ${start} to ${turned}`);
      await page.mouse.wheel(0, -200);
      await until(page, (c) => window.ivv.app.rig.view.center[2] > c[2] + 0.1, turned);
      await page.locator('#canvas').focus();
      await page.keyboard.down('KeyD');
      await until(page, (x) => window.ivv.app.rig.view.center[0] > x + 0.05, (await center())[0]);
      await page.keyboard.up('KeyD');
      await page.keyboard.press('v');
      assert.ok(Math.abs((await center())[0] + 0.2) < 1e-9);
      await page.keyboard.press('i');
      await page.locator('#stats').getByText('Live Gaussians').waitFor();
      assert.deepEqual(page.faults, []);
    });
  });

  await t.test('what the view looks at follows a pointer that shifts it, however the view fits the canvas', async () => {
    await withPage(small(), async (page) => {
      await ready(page);
      const pivot = await page.evaluate(() => {
        const { reach, view: { center, rotation } } = window.ivv.app.rig;
        return center.map((x, c) => x + reach * rotation[6 + c]);
      });
      /** Where the picture has what was looked at. */
      const place = () => page.evaluate((point) => {
        const { center, rotation, fx, fy, cx, cy } = window.ivv.app.currentView();
        const [x, y, z] = [0, 1, 2].map((r) => point.reduce((sum, v, c) => sum + rotation[3 * r + c] * (v - center[c]), 0));
        return [(fx * x) / z + cx, (fy * y) / z + cy];
      }, pivot);
      const start = await place();
      await page.mouse.move(200, 200);
      await page.mouse.down({ button: 'right' });
      await page.mouse.move(300, 160, { steps: 3 });
      await page.mouse.up({ button: 'right' });
      const end = await place();
      const scale = await page.evaluate(() => window.ivv.app.canvas.width / window.ivv.app.canvas.clientWidth);
      const [dx, dy] = end.map((v, c) => (v - start[c]) / scale);
      assert.ok(Math.abs(dx - 100) < 0.5 && Math.abs(dy + 40) < 0.5, `shifted by ${dx}, ${dy} pixels of the page`);
    });
  });

  await t.test('one finger turns, two come closer', async () => {
    await withPage(small(), async (page) => {
      await ready(page);
      const session = await context.newCDPSession(page);
      const touch = (type, ...points) => session.send('Input.dispatchTouchEvent', { type, touchPoints: points.map(([x, y], id) => ({ x, y, id })) });
      const pose = () => page.evaluate(() => ({ reach: window.ivv.app.rig.reach, rotation: window.ivv.app.rig.view.rotation }));
      const start = await pose();
      await touch('touchStart', [150, 300]);
      await touch('touchMove', [190, 300]);
      await touch('touchEnd');
      const turned = await pose();
      assert.notDeepEqual(turned.rotation, start.rotation);
      await touch('touchStart', [150, 300], [250, 300]);
      await touch('touchMove', [100, 300], [300, 300]);
      await touch('touchEnd');
      assert.ok((await pose()).reach < 0.7 * turned.reach);
    }, { viewport: { width: 390, height: 844 } });
  });

  await t.test('by ranges: the first picture needs a part of the file, a seek one chunk', async () => {
    const bytes = longClip();
    await withPage(bytes, async (page, { log }) => {
      await ready(page);
      const first = await page.evaluate(() => window.ivv.stats());
      assert.ok(first.bytes < 0.6 * bytes.length, `${first.bytes} of ${bytes.length}`);
      assert.ok(log.every(({ range }) => range));
      await picture(page, 9.5);
      const after = await page.evaluate(() => window.ivv.stats());
      assert.ok(after.bytes - first.bytes < bytes.length / 8, `${after.bytes - first.bytes} more`);
      assert.ok(after.live > 300 && after.chunks_resident <= 3);
    });
  });

  await t.test('an exact picture comes where others must go first, and after a context was lost meanwhile', async () => {
    await withPage(longClip(), async (page) => {
      await ready(page);
      const expected = [await picture(page, 9.5), await picture(page, 4.5)];
      await picture(page, 0);
      const found = [];
      for (const [at, loses] of [[9.5, false], [4.5, true]]) {
        // No room but that of what is there.
        const bytes = await page.evaluate(async ([view, t, isLost]) => {
          const { player } = window.ivv.app;
          if (!isLost) player.store.free.length = 0;
          window.ivv.setView(view);
          window.ivv.seek(t);
          const drawn = window.ivv.render();
          if (isLost) player.restart();
          const late = new Promise((_, reject) => setTimeout(() => reject(new Error('no picture')), 10_000));
          await Promise.race([drawn, late]);
          return Array.from(window.ivv.pixels());
        }, [VIEW, at, loses]);
        found.push(rgbOf(bytes));
      }
      found.forEach((image, i) => assert.equal(psnr(image, expected[i]), Infinity));
    });
  });

  await t.test('the same picture where the server ignores ranges', async () => {
    const bytes = longClip();
    const pictures = [];
    for (const ranges of [true, false]) await withPage(bytes, async (page) => { await ready(page); pictures.push(await picture(page, 3.5)); }, { server: { ranges } });
    assert.equal(psnr(pictures[0], pictures[1]), Infinity);
  });

  await t.test('a clip whose length is no single has Gaussians at its end, and says its length', async () => {
    const [duration, end] = [3.3, Math.fround(3.3)];
    await withPage(write4dgs(randomGaussians(400, 0, 1, duration), { duration, end, views }), async (page) => {
      await ready(page);
      await picture(page, duration);
      assert.ok((await page.evaluate(() => window.ivv.stats().live)) > 50);
      await until(page, () => document.getElementById('clock').textContent === '0:03.3 / 0:03.3');
    });
  });

  await t.test('a slow file waits, and plays on', async () => {
    await withPage(longClip(), async (page) => {
      await ready(page);
      await page.evaluate(() => window.ivv.play());
      await until(page, () => window.ivv.stats().time > 1.2);
      assert.deepEqual(page.faults, []);
    }, { server: { delayMs: 250 } });
  });

  await t.test('what cannot be played is said', async () => {
    const good = small();
    const broken = Buffer.from(good);
    broken.fill(0x55, good.indexOf(Buffer.from([0x78, 0x9c])) + 2, good.indexOf(Buffer.from([0x78, 0x9c])) + 60);
    const model = Buffer.from(good);
    model.write('keyframe-delta', good.indexOf('gaussian-birth'));
    /** @type {[string, Buffer | null, string, RegExp][]} */
    const cases = [
      ['no file', null, 'The scene could not be fetched', /404/],
      ['empty', Buffer.alloc(0), 'This file cannot be played', /found nothing/],
      ['text', Buffer.from('x'.repeat(5000)), 'This file cannot be played', /no \.4dgs file/],
      ['cut', good.subarray(0, good.length - 50), 'This file cannot be played', /cut short/],
      ['model', model, 'This file cannot be played', /keyframe-delta/],
      ['data', broken, 'This file cannot be played', /damaged data/],
    ];
    for (const [name, bytes, title, text] of cases) {
      await withPage(bytes, async (page) => {
        await page.locator('#fault').waitFor({ state: 'visible', timeout: 20_000 });
        assert.equal(await page.locator('#fault-title').textContent(), title, name);
        assert.match(await page.locator('#fault-text').textContent(), text, name);
        assert.match(await page.evaluate(() => window.ivv.ready.then(() => 'ready', (error) => error.message)), text, name);
      });
    }
  });

  await t.test('without WebGL2 the page says so', async () => {
    await withPage(small(), async (page) => {
      await page.getByText('The player needs WebGL2').waitFor({ timeout: 20_000 });
    }, { init: () => { HTMLCanvasElement.prototype.getContext = () => null; } });
  });

  await t.test('text of a file is text', async () => {
    const evil = '<img src=x onerror="document.title=\'evil\'">';
    const bytes = write4dgs(randomGaussians(50, 0), { duration: 2, views: { views: [{ ...VIEW, name: evil }] } });
    await withPage(bytes, async (page) => {
      await ready(page);
      assert.equal(await page.locator('#views option').first().textContent(), evil);
      assert.notEqual(await page.title(), 'evil');
    });
  });

  await t.test('a lost graphics context comes back with the same picture', async () => {
    await withPage(longClip(), async (page) => {
      await ready(page);
      const before = await picture(page, 2.5);
      await page.evaluate(() => {
        window.lose = window.ivv.app.player.gl.getExtension('WEBGL_lose_context');
        window.lose.loseContext();
      });
      await page.waitForTimeout(200);
      await page.evaluate(() => window.lose.restoreContext());
      await until(page, () => window.ivv.app.player.store.slots.some(({ state }) => state === 'resident') && !window.ivv.app.player.gl.isContextLost());
      assert.equal(psnr(await picture(page, 2.5), before), Infinity);
    });
  });

  await t.test('one HTML file opens from a disk', async () => {
    const folder = mkdtempSync(join(tmpdir(), 'ivv-player-'));
    const bytes = small();
    let served;
    await withPage(bytes, async (page) => { await ready(page); served = await picture(page, 0.8); });
    const file = (name) => join(folder, name);
    writeFileSync(file('scene.html'), singleFile(bytes));
    const pages = ['scene.html'];
    if (process.env.IVV) {
      writeFileSync(file('scene.4dgs'), bytes);
      execFileSync(process.env.IVV, ['export', file('scene.4dgs'), '-o', file('by-ivv.html')]);
      pages.push('by-ivv.html');
    }
    try {
      for (const name of pages) {
        const page = await openPage(context, `file://${file(name)}`);
        await ready(page);
        assert.equal(psnr(await picture(page, 0.8), served), Infinity, name);
        assert.deepEqual(page.faults, [], name);
        await page.close();
      }
    } finally {
      rmSync(folder, { recursive: true });
    }
  });

  await t.test('a still scene shows no time', async () => {
    const g = randomGaussians(100, 0);
    g.sigma.fill(Infinity);
    g.velocity = g.velocity.map(() => [0, 0, 0]);
    await withPage(write4dgs(g, { duration: 1 }), async (page) => {
      await ready(page);
      assert.equal(await page.locator('#time').isVisible(), false);
      assert.equal(await page.locator('#start').isVisible(), false);
      const { center } = await page.evaluate(() => window.ivv.app.rig.view);
      assert.ok(center[2] < 1.5, `without views the camera stands before the middle: ${center}`);
    });
  });

  await t.test('?bench=1 measures', async (sub) => {
    await withPage(small(), async (page) => {
      await page.waitForFunction(() => window.ivv?.bench, null, { timeout: 60_000 });
      const bench = await page.evaluate(() => window.ivv.bench);
      sub.diagnostic(JSON.stringify(bench));
      assert.equal(bench.frames, 60);
      assert.ok(bench.fps > 0 && bench.frame_ms.p99 >= bench.frame_ms.p50 && bench.live > 50 && bench.bytes_to_first_frame > 1000);
    }, { query: '?bench=1', viewport: { width: 160, height: 120 } });
  });
});
