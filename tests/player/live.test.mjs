// The page of a run that trains, of `ivv train --view` itself.
import assert from 'node:assert/strict';
import { execFileSync, spawn } from 'node:child_process';
import { mkdtempSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import test from 'node:test';
import { browserMissing, launch } from './harness.mjs';

const IVV = process.env.IVV;
const SKIP = browserMissing() ?? (IVV ? false : 'IVV does not name the program');

test('a training is watched: numbers, report and scene as they come, from where one stands', { skip: SKIP, timeout: 300_000 }, async (t) => {
  const folder = mkdtempSync(join(tmpdir(), 'ivv-live-'));
  t.after(() => rmSync(folder, { recursive: true, force: true }));
  execFileSync(IVV, ['synth', '--preset', 'tiny', '-o', join(folder, 'capture'), '-q']);
  const training = spawn(IVV, ['train', join(folder, 'capture'), '-o', join(folder, 'run'), '--steps', '100000', '--max-gaussians', '400', '--view', '0', '--checkpoint-every', '40', '--eval-every', '40']);
  t.after(() => training.kill('SIGKILL'));
  const url = await new Promise((resolve, reject) => {
    let said = '';
    training.stderr.on('data', (text) => {
      said += text;
      const found = /http:\S+/.exec(said);
      if (found) resolve(found[0]);
    });
    training.on('exit', () => reject(new Error(said)));
  });
  const browser = await launch();
  t.after(() => browser.close());
  const page = await browser.context.newPage();
  const faults = [];
  page.on('pageerror', (fault) => faults.push(String(fault)));
  page.on('console', (message) => { if (message.type() === 'error') faults.push(message.text()); });
  await page.goto(url);
  const until = (f, arg) => page.waitForFunction(f, arg, { timeout: 60_000, polling: 50 });
  await until(() => /^step [1-9]\d* of 100000, .*loss \d/.test(document.getElementById('said').textContent));
  await until(() => document.getElementById('report').contentDocument?.querySelector('#plot-psnr'));
  await until(() => document.getElementById('scene').contentWindow?.ivv?.app?.hasStarted);
  // Where one stands stays when the next scene comes, and when one that is gone before it was fetched came between.
  let gone = 0;
  await page.route('**/at/*/scene.4dgs', async (route) => {
    if (gone++ > 0) await route.continue();
    else await route.fulfill({ status: 404, body: '' });
  });
  await page.evaluate(() => {
    const { app } = document.getElementById('scene').contentWindow.ivv;
    app.pause();
    app.show({ ...app.rig.view, center: [0.25, -0.5, 1.5] });
    window.before = app;
  });
  await until(() => {
    const app = document.getElementById('scene').contentWindow?.ivv?.app;
    return app !== window.before && app?.hasStarted && app.rig.view.center.every((x, k) => Math.abs(x - [0.25, -0.5, 1.5][k]) < 1e-6);
  });
  await page.unroute('**/at/*/scene.4dgs');
  assert.ok(gone > 1, `${gone} scenes were asked for after the first`);
  // Without "always the newest" it is offered.
  await page.locator('#follow').uncheck();
  await page.locator('#newest').waitFor({ timeout: 60_000 });
  const shown = await page.textContent('#which');
  await page.locator('#newest').click();
  await until((before) => document.getElementById('which').textContent !== before, shown);
  training.kill('SIGKILL');
  await until(() => /does not answer/.test(document.getElementById('said').textContent));
  assert.deepEqual(faults.filter((fault) => !/ERR_|Failed to load/.test(fault)), []);
});
