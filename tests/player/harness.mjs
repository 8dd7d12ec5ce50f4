// What the tests share: where packages lie, a static server with ranges, Chromium, pictures.
import { existsSync, readFileSync, statSync, mkdtempSync, rmSync } from 'node:fs';
import { createServer } from 'node:http';
import { createRequire } from 'node:module';
import { tmpdir } from 'node:os';
import { extname, join, normalize } from 'node:path';
import { fileURLToPath } from 'node:url';

export const here = fileURLToPath(new URL('.', import.meta.url));
export const playerDir = fileURLToPath(new URL('../../assets/player/', import.meta.url));
const modules = process.env.IVV_NODE_MODULES ?? join(here, 'node_modules');
const require = createRequire(join(modules, 'any.js'));

/** The folder of a package, or null where it is not installed. */
export function packageDir(name) {
  return existsSync(join(modules, name)) ? join(modules, name) : null;
}

const TYPES = { '.html': 'text/html', '.js': 'text/javascript', '.css': 'text/css', '.svg': 'image/svg+xml', '.json': 'application/json', '.4dgs': 'application/octet-stream' };
export const POLICY = "default-src 'self'; worker-src 'self' blob:; style-src 'self'; connect-src 'self'; media-src 'self' blob:";

/**
 * Serves the player's files, and `files` (path -> bytes or path of a file), on 127.0.0.1. `log` has each request for a 4dgs file.
 * @param {Record<string, Buffer | string>} files @param {{ ranges?: boolean, delayMs?: number, policy?: string }} [options]
 */
export async function serve(files, { ranges = true, delayMs = 0, policy = POLICY } = {}) {
  const log = [];
  const server = createServer(async (request, response) => {
    const path = decodeURIComponent(new URL(request.url, 'http://x').pathname);
    const name = path === '/' ? 'index.html' : normalize(path).replace(/^\/+/, '');
    let body = files[name];
    if (body === undefined && existsSync(join(playerDir, name)) && statSync(join(playerDir, name)).isFile()) body = readFileSync(join(playerDir, name));
    if (typeof body === 'string') body = readFileSync(body);
    if (body === undefined) return response.writeHead(404).end('not found');
    const headers = { 'Content-Type': TYPES[extname(name)] ?? 'application/octet-stream', ...(policy ? { 'Content-Security-Policy': policy } : {}) };
    const range = ranges && /^bytes=(\d+)-(\d+)$/.exec(request.headers.range ?? '');
    if (name.endsWith('.4dgs')) {
      log.push({ range: request.headers.range ?? null });
      if (delayMs) await new Promise((resolve) => setTimeout(resolve, delayMs));
    }
    if (!range) return response.writeHead(200, { ...headers, 'Content-Length': body.length }).end(body);
    if (Number(range[1]) >= body.length) return response.writeHead(416, headers).end();
    const part = body.subarray(Number(range[1]), Number(range[2]) + 1);
    headers['Content-Range'] = `bytes ${range[1]}-${Number(range[1]) + part.length - 1}/${body.length}`;
    response.writeHead(206, { ...headers, 'Content-Length': part.length }).end(part);
  });
  await new Promise((resolve) => server.listen(0, '127.0.0.1', resolve));
  return { url: `http://127.0.0.1:${server.address().port}/`, log, close: () => new Promise((resolve) => server.close(resolve).closeAllConnections?.()) };
}

const FLAGS = ['--no-sandbox', '--disable-quic', '--no-first-run', '--disable-background-networking', '--disable-component-update', '--disable-sync',
  '--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--autoplay-policy=no-user-gesture-required', '--mute-audio'];
const CHROMIUM = process.env.IVV_CHROMIUM ?? '/usr/bin/chromium';

/** Why the browser tests cannot run here, or null. */
export function browserMissing() {
  if (!existsSync(CHROMIUM)) return `${CHROMIUM} is not there`;
  return packageDir('playwright-core') ? null : `playwright-core is not in ${modules}`;
}

/** Starts Chromium with a new profile; `flags` are added. */
export async function launch(flags = []) {
  const { chromium } = require('playwright-core');
  const profile = mkdtempSync(join(tmpdir(), 'ivv-player-'));
  const context = await chromium.launchPersistentContext(profile, {
    executablePath: CHROMIUM, headless: false, args: ['--headless=new', ...FLAGS, ...flags], viewport: { width: 640, height: 480 },
  });
  return { context, close: async () => { await context.close(); rmSync(profile, { recursive: true, force: true }); } };
}

/** Opens a page; what it reports as faults is kept in `faults`. */
export async function openPage(context, url, { init, viewport } = {}) {
  const page = await context.newPage();
  page.faults = [];
  page.on('pageerror', (error) => page.faults.push(String(error)));
  page.on('console', (message) => { if (message.type() === 'error') page.faults.push(message.text()); });
  if (viewport) await page.setViewportSize(viewport);
  if (init) await page.addInitScript(init);
  await page.goto(url);
  return page;
}

/** Mean squared error's peak signal-to-noise ratio, dB, of two pictures with values 0 to 1. */
export function psnr(a, b) {
  let sum = 0;
  for (let i = 0; i < a.length; i += 1) sum += (a[i] - b[i]) ** 2;
  return sum === 0 ? Infinity : -10 * Math.log10(sum / a.length);
}

/** RGBA bytes to rgb in 0 to 1. */
export function rgbOf(pixels) {
  const out = new Float64Array((pixels.length / 4) * 3);
  for (let i = 0; i < pixels.length / 4; i += 1) for (let c = 0; c < 3; c += 1) out[3 * i + c] = pixels[4 * i + c] / 255;
  return out;
}

/** The tensor `name` of a safetensors file of floats. */
export function safetensor(path, name) {
  const bytes = readFileSync(path);
  const n = Number(bytes.readBigUInt64LE(0));
  const { data_offsets: [from, to] } = JSON.parse(bytes.subarray(8, 8 + n).toString())[name];
  return Float64Array.from({ length: (to - from) / 4 }, (_, i) => bytes.readFloatLE(8 + n + from + 4 * i));
}

export { require };
