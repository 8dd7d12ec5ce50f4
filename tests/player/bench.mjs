// Speed of the player in the Chromium of this machine: node bench.mjs [GAUSSIANS...], a row of a table for each.
import { launch, openPage, serve } from './harness.mjs';
import { randomGaussians } from './scenes.mjs';
import { write4dgs } from './write4dgs.mjs';

const counts = process.argv.slice(2).map(Number);
const views = { views: [{ name: 'a', world_to_camera: [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]], fx: 900, fy: 900, cx: 640, cy: 360, width: 1280, height: 720 }] };
const ms = (x) => x.toFixed(x < 10 ? 2 : 0);

const browser = await launch();
console.log('| live Gaussians | frames a second | frame, median and 95 %, ms | sort, ms | upload of a slice, ms | draw, ms | MB to the first frame | MB a second of the clip |');
console.log('| --- | --- | --- | --- | --- | --- | --- | --- |');
for (const n of counts.length > 0 ? counts : [10_000, 100_000, 500_000]) {
  // As in scenes, more Gaussians are smaller ones: together they cover as much.
  const gaussians = randomGaussians(n, 1);
  gaussians.scale = gaussians.scale.map((s) => s.map((x) => x * Math.sqrt(10_000 / n)));
  const server = await serve({ 'scene.4dgs': write4dgs(gaussians, { duration: 2, views }) });
  const page = await openPage(browser.context, `${server.url}?bench=1`, { viewport: { width: 1280, height: 720 } });
  await page.waitForFunction(() => window.ivv?.bench, null, { timeout: 600_000, polling: 500 });
  const { fps, frame_ms: frame, sort_ms: sort, upload_ms: upload, draw_ms: draw, live, bytes_to_first_frame: bytes, bytes_per_second: rate } = await page.evaluate(() => window.ivv.bench);
  console.log(`| ${live} | ${fps.toFixed(1)} | ${ms(frame.p50)}, ${ms(frame.p95)} | ${ms(sort)} | ${ms(upload)} | ${ms(draw)} | ${(bytes / 1e6).toFixed(2)} | ${(rate / 1e6).toFixed(2)} |`);
  await page.close();
  await server.close();
}
await browser.close();
