// An example, not a part of the player: a `.4dgs` scene in three.js through Spark (@sparkjsdev/spark 2, three >= 0.180).
// Both packages are handed in, so that this file imports nothing but the player's reader:
//
//   import * as THREE from 'three';
//   import * as SPARK from '@sparkjsdev/spark';
//   import { loadSplats } from './three-spark.js';
//   const scene4d = await loadSplats('scene.4dgs', { THREE, SPARK });
//   threeScene.add(new SPARK.SparkRenderer({ renderer, sortRadial: false, accumExtSplats: true }), scene4d.mesh);
//   renderer.setAnimationLoop((ms) => { scene4d.setTime((ms / 1000) % scene4d.duration); renderer.render(threeScene, camera); });
//
// Motion, temporal opacity and colour are shown; spherical harmonics above the constant one are not. Spark has no live set:
// it makes all Gaussians of the file each frame, and it blurs and cuts by its own constants.
import { openScene } from '../../assets/player/container.js';
import { decodeChunk, GEOMETRY_FLOATS, LOOK_TEXELS } from '../../assets/player/decode.js';
import { openUrl } from '../../assets/player/source.js';

const WIDTH = 2048;
const TEXELS = 5; // position, opacity; velocity, time; scale, rate; rotation; colour

/** All Gaussians of a file, five texels each. @param {string} url */
async function readAll(url) {
  const source = await openUrl(url);
  const scene = await openScene(source);
  const { header, grid, windows } = scene;
  const settings = { grid, windows, cutoff: header.cutoff, duration: header.duration, alphaMin: 1 / 255, shDegree: header.shDegree };
  const height = Math.max(1, Math.ceil((header.count * TEXELS) / WIDTH));
  const texels = new Float32Array(WIDTH * height * 4);
  let n = 0;
  for (const entry of scene.chunks) {
    const [record, ...bands] = await Promise.all([entry.chunk, ...entry.bands].map(({ offset, length }) => source.read(offset, length)));
    const { geometry, look, count } = await decodeChunk(record, bands, settings, entry.count);
    for (let i = 0; i < count; i += 1, n += 1) {
      const words = look.subarray(i * 4 * LOOK_TEXELS[header.shDegree]);
      texels.set(geometry.subarray(i * GEOMETRY_FLOATS, (i + 1) * GEOMETRY_FLOATS), n * TEXELS * 4);
      texels.set([words[0] & 0xffff, words[0] >>> 16, words[1]].map((word) => word / 65535), n * TEXELS * 4 + GEOMETRY_FLOATS);
    }
  }
  return { texels, height, count: header.count, duration: header.duration };
}

/** GLSL of one Gaussian at a time. */
const STATEMENTS = (/** @type {any} */ { inputs, outputs }) => `
  int first = ${inputs.index} * ${TEXELS};
  vec4 t[${TEXELS}];
  for (int i = 0; i < ${TEXELS}; ++i) t[i] = texelFetch(${inputs.texels}, ivec2((first + i) % ${WIDTH}, (first + i) / ${WIDTH}), 0);
  float dt = ${inputs.time} - t[1].w;
  float age = dt * t[2].w;
  float opacity = t[0].w * exp(-age * age);
  ${outputs.gsplat}.center = t[0].xyz + dt * t[1].xyz;
  ${outputs.gsplat}.scales = t[2].xyz;
  ${outputs.gsplat}.quaternion = t[3];
  ${outputs.gsplat}.rgba = vec4(t[4].rgb, opacity);
  ${outputs.gsplat}.index = ${inputs.index};
  ${outputs.gsplat}.flags = opacity >= 1.0 / 255.0 ? GSPLAT_FLAG_ACTIVE : 0u;`;

/**
 * A mesh of Spark whose Gaussians follow the time. @param {string} url
 * @param {{ THREE: any, SPARK: any }} packages
 * @returns {Promise<{ mesh: any, duration: number, setTime: (seconds: number) => void }>}
 */
export async function loadSplats(url, { THREE, SPARK }) {
  const { texels, height, count, duration } = await readAll(url);
  const { dyno, SplatMesh } = SPARK;
  const texture = new THREE.DataTexture(texels, WIDTH, height, THREE.RGBAFormat, THREE.FloatType);
  texture.needsUpdate = true;
  const time = dyno.dynoFloat(0);
  const sampler = dyno.dynoSampler2D(texture);
  const source = {
    prepareFetchSplat() {},
    dispose: () => texture.dispose(),
    getNumSplats: () => count,
    hasRgbDir: () => false,
    getNumSh: () => 0,
    setMaxSh() {},
    forEachSplat() {},
    /** @param {{ index: any }} input */
    fetchSplat({ index }) {
      const types = { index: 'int', time: 'float', texels: 'sampler2D' };
      const make = dyno.dyno({ inTypes: types, outTypes: { gsplat: dyno.Gsplat }, statements: (/** @type {any} */ names) => dyno.unindentLines(STATEMENTS(names)) });
      return make.apply({ index, time, texels: sampler }).gsplat;
    },
  };
  const mesh = new SplatMesh({ splats: source });
  await mesh.initialized;
  return {
    mesh,
    duration,
    setTime(seconds) {
      time.value = seconds;
      mesh.updateVersion();
    },
  };
}
