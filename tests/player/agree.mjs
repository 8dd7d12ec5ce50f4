// How the page's pictures agree with `ivv render`: IVV=ivv node agree.mjs FILE.4dgs..., a row of a table for each file and moment.
import { readFileSync } from 'node:fs';
import { basename } from 'node:path';
import { lastMoment, openScene, triple } from '../../assets/player/container.js';
import { memorySource } from '../../assets/player/source.js';
import { launch, psnr } from './harness.mjs';
import { engineOf, picturesOf, smaller } from './pictures.mjs';

const VIEWS = 4;
const MOMENTS = 4;
/** Clips of less, seconds, are a frame. */
const SHORTEST = 0.1;
const LONGEST_SIDE = 480;
const GOAL_DB = 40;

/** Views to start from, spread over all that the file has. */
async function viewsOf(source, scene) {
  const data = scene.attachments.find(({ name }) => name === 'views.json')?.data;
  if (!data) throw new Error('expected a file with views to start from, found none: export it with --cameras');
  const { views } = JSON.parse(Buffer.from(await source.read(data.offset, data.length)).toString());
  const n = Math.min(VIEWS, views.length);
  return Array.from({ length: n }, (_, k) => views[Math.floor(((k + 0.5) * views.length) / n)]).map((view) => smaller(view, Math.round(Math.min(1, LONGEST_SIDE / Math.max(view.width, view.height)) * view.width)));
}

const paths = process.argv.slice(2);
if (paths.length === 0 || !process.env.IVV) throw new Error('usage: IVV=ivv node agree.mjs FILE.4dgs...');
const browser = await launch();
let isGood = true;
console.log('| file | Gaussians | pictures | at | least and mean PSNR, dB |');
console.log('| --- | --- | --- | --- | --- |');
for (const path of paths) {
  const bytes = readFileSync(path);
  const source = memorySource(new Uint8Array(bytes));
  const scene = await openScene(source);
  const { duration, count } = scene.header;
  const views = await viewsOf(source, scene);
  const background = triple(scene.metadata.get('ivv'), 'background') ?? views[0].background ?? [0, 0, 0];
  const moments = duration < SHORTEST ? [0] : Array.from({ length: MOMENTS }, (_, k) => Math.min(lastMoment(scene), (k / (MOMENTS - 1)) * duration));
  for (const t of moments) {
    const shots = views.map((view) => [view, t]);
    const engine = engineOf(bytes, 'scene.4dgs', shots, duration, background);
    const pictures = await picturesOf(browser.context, bytes, shots);
    const found = pictures.map((picture, i) => psnr(picture, engine[i]));
    isGood &&= found.every((db) => db >= GOAL_DB);
    const { width, height } = views[0];
    console.log(`| ${basename(path)} | ${count.toLocaleString('en')} | ${views.length} of ${width} x ${height} | ${t.toFixed(2)} s | ${Math.min(...found).toFixed(1)}, ${(found.reduce((a, b) => a + b, 0) / found.length).toFixed(1)} |`);
  }
}
await browser.close();
if (!isGood) throw new Error(`expected ${GOAL_DB} dB or more of every picture`);
