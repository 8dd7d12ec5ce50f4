// Films the player for the README: node film.mjs URL OUT.webp, with the URL of `ivv serve` and ffmpeg beside.
import { execFileSync } from 'node:child_process';
import { mkdtempSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { launch } from './harness.mjs';

const [url, to] = process.argv.slice(2);
const FRAMES = 48;
const SIZE = { width: 720, height: 405 };
const SWING = 0.22; // radians to either side

const browser = await launch();
const page = await browser.context.newPage();
await page.setViewportSize(SIZE);
await page.goto(url);
await page.evaluate(() => window.ivv.ready);
await page.evaluate(() => document.getElementById('start').classList.add('hidden-text'));
const folder = mkdtempSync(join(tmpdir(), 'ivv-film-'));
for (let i = 0; i < FRAMES; i += 1) {
  await page.evaluate(async ([part, swing]) => {
    const { add, apply, product, row, transposed, turn } = await import('./camera.js');
    const { app } = window.ivv;
    window.filmStart ??= { ...app.player.view, pivot: app.player.pivotDistance() };
    const start = window.filmStart;
    const pivot = add(start.center, row(start.rotation, 2), start.pivot);
    const spin = turn(app.player.up, swing * Math.sin(2 * Math.PI * part));
    app.show({ ...start, rotation: product(start.rotation, transposed(spin)), center: add(pivot, apply(spin, add(start.center, pivot, -1))) });
    window.ivv.seek(part * app.player.clock.duration);
    await window.ivv.render();
    await new Promise((resolve) => setTimeout(resolve, 60));
  }, [i / FRAMES, SWING]);
  await page.mouse.move(SIZE.width / 2 + i, SIZE.height - 60);
  await page.screenshot({ path: join(folder, `${String(i).padStart(3, '0')}.png`) });
}
await browser.close();
execFileSync('ffmpeg', ['-loglevel', 'error', '-y', '-framerate', '12', '-i', join(folder, '%03d.png'), '-c:v', 'libwebp_anim', '-quality', '62', '-compression_level', '6', '-loop', '0', to]);
rmSync(folder, { recursive: true });
