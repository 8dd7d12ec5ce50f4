// Makes the single-file page as README.md of the player says it: the proof that the recipe works, and a tool for the tests.
import { createHash } from 'node:crypto';
import { readFileSync } from 'node:fs';
import { join } from 'node:path';
import { playerDir } from './harness.mjs';

const text = (name) => readFileSync(join(playerDir, name), 'utf8');

/** The lists of modules that README.md states, in order. @returns {{ page: string[], worker: string[] }} */
export function moduleLists() {
  const readme = text('README.md');
  const list = (name) => new RegExp(`^- ${name}: (.+)$`, 'm').exec(readme)[1].split(', ').map((file) => file.replaceAll('`', ''));
  return { page: list('page'), worker: list('worker') };
}

/** Modules as one script: no imports, no exports. @param {string[]} names */
export function joined(names) {
  return names.map((name) => text(name).replace(/^import [^;]*;\n/gm, '').replace(/^export /gm, '')).join('\n');
}

/** @param {Buffer} scene the bytes of the .4dgs file */
export function singleFile(scene) {
  const { page, worker } = moduleLists();
  const script = joined(page);
  const style = text('style.css');
  const hash = (s) => `'sha256-${createHash('sha256').update(s).digest('base64')}'`;
  const policy = `default-src 'none'; script-src ${hash(script)} blob:; style-src ${hash(style)}; worker-src blob:; img-src data:; media-src blob:`;
  const icon = `data:image/svg+xml;base64,${Buffer.from(text('icon.svg')).toString('base64')}`;
  /** @type {[string, string][]} */
  const changes = [
    ['<meta charset="utf-8">', `<meta charset="utf-8">\n<meta http-equiv="Content-Security-Policy" content="${policy}">`],
    ['href="icon.svg"', `href="${icon}"`],
    ['<link rel="stylesheet" href="style.css">', `<style>${style}</style>`],
    ['<script type="module" src="main.js"></script>', `<script type="text/plain" id="worker">${joined(worker)}</script>\n`
      + `<script type="application/octet-stream;base64" id="scene">${scene.toString('base64')}</script>\n<script type="module">${script}</script>`],
  ];
  return changes.reduce((html, [from, to]) => {
    if (html.split(from).length !== 2) throw new Error(`index.html: expected "${from}" once`);
    return html.replace(from, () => to);
  }, text('index.html'));
}
