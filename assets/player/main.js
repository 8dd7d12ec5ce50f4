import { viewOf } from './camera.js';
import { Player, viewFor } from './player.js';
import { openUrl } from './source.js';
const canvas = /** @type {HTMLCanvasElement} */ (document.getElementById('canvas'));
const ivv = {
  ready: (async () => {
    const source = await openUrl('scene.4dgs');
    ivv.player = await Player.open(canvas, source, (e) => console.error('fault', e.message));
  })(),
  seek(t) { ivv.player.clock.set({ time: t }); },
  setView(v) { ivv.view = viewOf(v); canvas.width = v.width; canvas.height = v.height; ivv.player.view = ivv.view; },
  render() { return ivv.player.render(ivv.view); },
  pixels() { ivv.player.draw(ivv.view, true); return ivv.player.renderer.read(ivv.view.width, ivv.view.height); },
  stats() { return ivv.player.stats(); },
};
window.ivv = ivv;
