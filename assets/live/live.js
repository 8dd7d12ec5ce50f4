// The page of a run that trains: its numbers, the scene as of a checkpoint, the report so far.

/** @param {string} id */
const element = (id) => /** @type {HTMLElement} */ (document.getElementById(id));
const scene = /** @type {HTMLIFrameElement} */ (element('scene'));
const report = /** @type {HTMLIFrameElement} */ (element('report'));
const follow = /** @type {HTMLInputElement} */ (element('follow'));

/** A scene is shown for so long before the next one takes its place. */
const LOOK_MS = 5000;

/** @type {any} What the run said last. */
let state = {};
/** @type {string | null} Name of the scene that is shown. */
let shown = null;
/** When the scene that is shown came, ms; infinite while it is still to come. */
let since = Infinity;
/** @type {{ view: any, time: number } | null} Where one stood when a scene was seen last: one that is gone before it came has no place. */
let place = null;
/** @type {number | null} The report that is shown. */
let told = null;

/** @param {number} seconds */
function duration(seconds) {
  const s = Math.round(seconds);
  if (s < 60) return `${s} s`;
  if (s < 3600) return `${Math.floor(s / 60)} min ${s % 60} s`;
  return `${Math.floor(s / 3600)} h ${Math.floor((s % 3600) / 60)} min`;
}

/** @param {any} now */
function numbers(now) {
  const said = [`step ${now.step} of ${now.total}`];
  if (Number.isFinite(now.seconds)) {
    said.push(duration(now.seconds));
    if (!now.ended && now.step > 0) said.push(`${duration((now.seconds / now.step) * (now.total - now.step))} left`);
  }
  if (Number.isFinite(now.loss)) said.push(`loss ${now.loss.toFixed(4)}`);
  if (Number.isFinite(now.psnr)) said.push(`${now.psnr.toFixed(2)} dB in training`);
  if (Number.isFinite(now.gaussians)) said.push(`${now.gaussians} Gaussians`);
  return said.join(', ');
}

/** Shows the newest scene, from where the last one was seen and at its time. */
function showNewest() {
  const before = /** @type {any} */ (scene.contentWindow)?.ivv?.app;
  if (before?.hasStarted) place = { view: { ...before.rig.view }, time: before.player.clock.time() };
  shown = state.scene;
  since = Infinity;
  scene.hidden = false;
  scene.src = `at/${shown}/`;
  scene.onload = async () => {
    const { ivv } = /** @type {any} */ (scene.contentWindow);
    // Of a scene that is gone already the player says so; the next one is better.
    await ivv?.ready.catch(() => undefined);
    since = ivv?.app ? performance.now() : -Infinity;
    if (!place || !ivv?.app) return;
    ivv.app.show(place.view);
    ivv.app.seek(place.time);
  };
  element('which').textContent = shown?.startsWith('end-') ? 'The scene, trained' : `The scene after ${Number(shown)} steps`;
  element('newest').hidden = true;
}

/** Shows the newest scene when its time has come. */
function renew() {
  if (!state.scene || state.scene === shown) return;
  if (shown === null || (follow.checked && performance.now() - since > LOOK_MS)) showNewest();
  else element('newest').hidden = follow.checked;
}

/** @param {any} now */
function show(now) {
  state = now;
  element('name').textContent = now.name;
  document.title = `${now.step} of ${now.total}, ${now.name}`;
  const done = /** @type {HTMLProgressElement} */ (element('done'));
  done.max = Math.max(1, now.total);
  done.value = now.step;
  element('said').className = '';
  element('said').textContent = now.ended ? `ended; ${numbers(now)}` : numbers(now);
  renew();
  if (now.report !== null && now.report !== told) {
    // A reload keeps the place that is read.
    if (told === null) report.src = 'report.html';
    else report.contentWindow?.location.reload();
    told = now.report;
    report.hidden = false;
    element('when').textContent = 'Course and test views';
  }
}

element('newest').addEventListener('click', showNewest);
follow.addEventListener('change', renew);
setInterval(renew, 1000);
const events = new EventSource('events');
events.addEventListener('message', ({ data }) => show(JSON.parse(data)));
events.addEventListener('error', () => {
  element('said').className = 'gone';
  element('said').textContent = state.ended ? `ended; ${numbers(state)}` : 'The training does not answer: it has ended, or its machine cannot be reached';
});
