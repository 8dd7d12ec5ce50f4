// The headset: WebXR immersive-vr, two pictures with one order, the head as view and listener, sticks that move and scrub.
import { add, apply, cross, dot, product, rotationOf, row, scaled, transposed, unit } from './camera.js';

const METRES_A_SECOND = 1.2;
const SCRUB_SHARE_A_SECOND = 0.25;
const DEAD_ZONE = 0.15;
/** From XR's camera axes (x right, y up, z back) to ours. */
const FLIP = [1, 0, 0, 0, -1, 0, 0, 0, -1];

/**
 * A pinhole camera of a projection matrix and a size. @param {ArrayLike<number>} p column-major
 * @param {number} width pixels @param {number} height pixels
 */
export function pinholeOf(p, width, height) {
  return { fx: (p[0] * width) / 2, fy: (p[5] * height) / 2, cx: (width / 2) * (1 - p[8]), cy: (height / 2) * (1 + p[9]), width, height };
}

/** Where a pose of the headset's space stands in the scene. */
export class Placement {
  /**
   * Puts the head where the view stands, upright, facing where the view faces.
   * @param {XRRigidTransform} head @param {Pick<import('./camera.js').View, 'rotation' | 'center'>} view
   * @param {number[]} up world @param {number} unitsPerMetre
   */
  constructor(head, view, up, unitsPerMetre) {
    const from = uprightOf(product(FLIP, transposed(rotationOf(head.orientation))), [0, 1, 0]);
    this.turn = product(transposed(uprightOf(view.rotation, up)), from);
    this.scale = unitsPerMetre;
    const { x, y, z } = head.position;
    this.base = add(view.center, apply(this.turn, [x, y, z]), -this.scale);
  }

  /** World pose of a pose. @param {XRRigidTransform} pose */
  pose({ position: { x, y, z }, orientation }) {
    const toCamera = product(FLIP, product(transposed(rotationOf(orientation)), transposed(this.turn)));
    return { rotation: toCamera, center: add(this.base, apply(this.turn, [x, y, z]), this.scale) };
  }
}

/** Rows right, up, forward of a camera that is set upright. @param {number[]} rotation @param {number[]} up */
function uprightOf(rotation, up) {
  const rise = dot(row(rotation, 2), up);
  // Ahead of a camera that looks steeply up lies what is below in its picture; of one that looks steeply down, what is above.
  const gaze = Math.abs(rise) > 0.99 ? scaled(row(rotation, 1), rise) : row(rotation, 2);
  const forward = unit(add(gaze, up, -dot(gaze, up)));
  return [...cross(forward, up), ...up, ...forward];
}

/** Shows the scene in a headset. */
export class XrShow {
  /** @param {import('./main.js').App} app */
  constructor(app) {
    this.app = app;
    /** @type {XRSession | null} */
    this.session = null;
    /** @type {XRReferenceSpace | null} */
    this.space = null;
    /** @type {Placement | null} */
    this.placement = null;
    /** Views of the eyes in the last frame. @type {(import('./camera.js').View & { x: number, y: number })[]} */
    this.eyes = [];
    this.last = 0;
    void this.offer();
  }

  /** Shows the button where a headset is there. */
  async offer() {
    const isThere = await navigator.xr?.isSessionSupported('immersive-vr').catch(() => false);
    this.app.ui.showXr(isThere === true);
  }

  async enter() {
    const { xr } = navigator;
    if (!xr || this.session) return;
    const { gl } = this.app.player;
    this.app.sound?.start();
    const session = await xr.requestSession('immersive-vr', { optionalFeatures: ['local-floor'] });
    session.addEventListener('end', () => this.leave(session));
    try {
      await gl.makeXRCompatible();
      await session.updateRenderState({ baseLayer: new XRWebGLLayer(session, gl, { antialias: false, depth: false, stencil: false }) });
      this.space = await session.requestReferenceSpace('local-floor').catch(() => session.requestReferenceSpace('local'));
    } catch (error) {
      await session.end().catch(() => {});
      throw error;
    }
    this.space.addEventListener('reset', () => { this.placement = null; });
    session.addEventListener('select', () => this.app.ui.actions.toggle());
    this.placement = null;
    this.session = session;
    session.requestAnimationFrame((now, frame) => this.frame(now, frame));
  }

  /** @param {XRSession} session */
  leave(session) {
    if (this.session !== session) return;
    this.session = null;
    this.eyes = [];
    this.app.rig.set(this.app.player.view, this.app.player.pivotDistance());
  }

  /** @param {number} now ms @param {XRFrame} frame */
  frame(now, frame) {
    const { session, app } = this;
    if (!session || !this.space) return;
    session.requestAnimationFrame((next, nextFrame) => this.frame(next, nextFrame));
    const pose = frame.getViewerPose(this.space);
    const layer = session.renderState.baseLayer;
    if (!pose || !layer) return;
    const { player } = app;
    const unitsPerMetre = 1 / (player.scene.frame?.metresPerUnit || 1);
    const place = (this.placement ??= new Placement(pose.transform, app.rig.view, player.up, unitsPerMetre));
    this.steer(session, place.pose(pose.transform), Math.min(0.1, (now - this.last) / 1000));
    this.last = now;
    app.step(place.pose(pose.transform), now);
    this.eyes = pose.views.flatMap((view) => {
      const port = layer.getViewport(view);
      if (!port?.width) return [];
      const { width, height, x, y } = port;
      return [{ ...place.pose(view.transform), ...pinholeOf(view.projectionMatrix, width, height), x, y }];
    });
    for (const eye of this.eyes) player.renderer.draw(eye, player.clock.time(), { framebuffer: layer.framebuffer, x: eye.x, y: eye.y });
    app.times.push(now);
  }

  /** Sticks: the left one walks, the right one scrubs and lifts. @param {XRSession} session @param {Pick<import('./camera.js').View, 'rotation'>} head @param {number} seconds */
  steer(session, head, seconds) {
    const { placement, app } = this;
    const { clock, up } = app.player;
    for (const { gamepad, handedness } of session.inputSources) {
      const axes = gamepad?.axes ?? [];
      const [x, y] = [axes[2] ?? axes[0] ?? 0, axes[3] ?? axes[1] ?? 0].map((v) => (Math.abs(v) < DEAD_ZONE ? 0 : v));
      if (!placement || (x === 0 && y === 0)) continue;
      const step = METRES_A_SECOND * placement.scale * seconds;
      if (handedness === 'right') {
        if (x !== 0 && clock.duration > 0) app.seek((clock.time() + x * SCRUB_SHARE_A_SECOND * clock.duration * seconds + clock.duration) % clock.duration);
        placement.base = add(placement.base, up, -y * step);
      } else {
        const upright = uprightOf(head.rotation, up);
        placement.base = add(add(placement.base, row(upright, 2), -y * step), row(upright, 0), x * step);
      }
    }
  }
}
