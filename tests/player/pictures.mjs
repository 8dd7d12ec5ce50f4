// Pictures of the same views by the page and by the engine.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { mkdtempSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { openPage, rgbOf, safetensor, serve } from './harness.mjs';

/** The same view in a picture of another width. */
export function smaller(view, width) {
  const k = width / view.width;
  return { ...view, width, height: Math.round(view.height * k), fx: view.fx * k, fy: view.fy * k, cx: view.cx * k, cy: view.cy * k };
}

/** The page's pictures of a file, rgb in 0 to 1, for each [view, seconds]. */
export async function picturesOf(context, bytes, shots) {
  const server = await serve({ 'scene.4dgs': bytes });
  const page = await openPage(context, server.url);
  try {
    await page.evaluate(() => window.ivv.ready);
    const pictures = [];
    for (const [view, t] of shots) {
      const pixels = await page.evaluate(async ([v, s]) => {
        window.ivv.seek(s);
        window.ivv.setView(v);
        await window.ivv.render();
        return Array.from(window.ivv.pixels());
      }, [view, t]);
      pictures.push(rgbOf(pixels));
    }
    assert.deepEqual(page.faults, []);
    return pictures;
  } finally {
    await page.close();
    await server.close();
  }
}

/** What `ivv render` makes of a scene, a file of this name, or null where there is no program. @param {[any, number][]} shots with seconds */
export function engineOf(scene, name, shots, duration, background) {
  if (!process.env.IVV) return null;
  const folder = mkdtempSync(join(tmpdir(), 'ivv-player-'));
  try {
    writeFileSync(join(folder, name), scene);
    const views = shots.map(([v, t], i) => ({ ...v, name: `s${i}`, time: t / duration, time_offset: 0, flow_dt: 0.1, background, world_to_camera: [...v.world_to_camera.slice(0, 3), [0, 0, 0, 1]] }));
    writeFileSync(join(folder, 'cameras.json'), JSON.stringify({ views }));
    execFileSync(process.env.IVV, ['render', join(folder, name), '--cameras', join(folder, 'cameras.json'), '-o', folder, '--format', 'safetensors', '-q']);
    return views.map((view) => safetensor(join(folder, `${view.name}.safetensors`), 'color').map((v) => Math.min(1, Math.max(0, v))));
  } finally {
    rmSync(folder, { recursive: true });
  }
}
