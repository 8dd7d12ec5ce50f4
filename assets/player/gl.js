// The renderer: quads back to front, blended into half floats, then the screen.
import { GEOMETRY_FLOATS, LOOK_TEXELS } from './decode.js';
import { ORDER_WIDTH, screenFragmentSource, screenVertexSource, splatFragmentSource, splatVertexSource } from './shaders.js';

const GEOMETRY_TEXELS = GEOMETRY_FLOATS / 4;

/**
 * @typedef {{ blur: number, alphaMin: number, alphaMax: number, near: number, background: number[] }} Look constants of a scene's rendering
 * @typedef {{ framebuffer: WebGLFramebuffer | null, x: number, y: number }} Target where a picture goes; y counts from the bottom
 */

/** Slots of a row of the device's textures. @param {WebGL2RenderingContext} gl */
export function rowSlotsOf(gl) {
  return Math.floor(Math.min(4096, gl.getParameter(gl.MAX_TEXTURE_SIZE)) / GEOMETRY_TEXELS);
}

/** @param {HTMLCanvasElement} canvas @returns {WebGL2RenderingContext | null} */
export function openContext(canvas) {
  const options = { alpha: false, antialias: false, depth: false, stencil: false, powerPreference: 'high-performance' };
  return /** @type {WebGL2RenderingContext | null} */ (canvas.getContext('webgl2', options));
}

/** Draws Gaussians that lie in two textures, by slot. */
export class Renderer {
  /** @param {WebGL2RenderingContext} gl @param {number} shDegree @param {Look} look @param {number} rows rows of slots to hold */
  constructor(gl, shDegree, look, rows) {
    this.gl = gl;
    this.look = look;
    this.rowSlots = rowSlotsOf(gl);
    this.lookTexels = LOOK_TEXELS[shDegree];
    const float = gl.getExtension('EXT_color_buffer_float') ?? gl.getExtension('EXT_color_buffer_half_float');
    this.pictureFormat = float ? gl.RGBA16F : gl.RGBA8;
    this.timer = gl.getExtension('EXT_disjoint_timer_query_webgl2');
    this.splat = link(gl, splatVertexSource(shDegree, this.lookTexels), splatFragmentSource);
    this.screen = link(gl, screenVertexSource, screenFragmentSource);
    this.geometry = this.texture(gl.RGBA32F, this.rowSlots * GEOMETRY_TEXELS, rows);
    this.looks = this.texture(gl.RGBA32UI, this.rowSlots * this.lookTexels, rows);
    /** Two orders: one is drawn while the other is written. @type {{ texture: WebGLTexture | null, rows: number }[]} */
    this.orders = [{ texture: null, rows: 0 }, { texture: null, rows: 0 }];
    this.corners = gl.createBuffer();
    this.quads = gl.createVertexArray();
    this.capacity = 0;
    this.current = 0;
    this.count = 0;
    /** @type {{ width: number, height: number, framebuffer: WebGLFramebuffer | null, texture: WebGLTexture | null }} */
    this.picture = { width: 0, height: 0, framebuffer: null, texture: null };
    /** @type {WebGLQuery | null} */
    this.query = null;
    this.drawMs = 0;
  }

  /** @param {number} format @param {number} width @param {number} height */
  texture(format, width, height) {
    const { gl } = this;
    const texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texStorage2D(gl.TEXTURE_2D, 1, format, width, height);
    for (const name of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, name, gl.NEAREST);
    return texture;
  }

  /** Makes room for the corners of so many quads: two triangles of four vertices each. @param {number} count */
  reserve(count) {
    const { gl } = this;
    this.capacity = Math.ceil(count * 1.25);
    const corners = new Uint32Array(this.capacity * 6);
    for (let i = 0; i < this.capacity; i += 1) corners.set([4 * i, 4 * i + 1, 4 * i + 2, 4 * i + 2, 4 * i + 1, 4 * i + 3], 6 * i);
    gl.bindVertexArray(this.quads);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, this.corners);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, corners, gl.STATIC_DRAW);
    gl.bindVertexArray(null);
  }

  /**
   * Writes Gaussians into whole rows from `row` on. @param {number} row
   * @param {Float32Array} geometry n x 16 @param {Uint32Array} look n x 4 lookTexels
   */
  upload(row, geometry, look) {
    const { gl, rowSlots } = this;
    const n = geometry.length / GEOMETRY_FLOATS;
    /** @type {[WebGLTexture | null, number, number, number, Float32Array | Uint32Array][]} */
    const parts = [
      [this.geometry, GEOMETRY_TEXELS, gl.RGBA, gl.FLOAT, geometry],
      [this.looks, this.lookTexels, gl.RGBA_INTEGER, gl.UNSIGNED_INT, look],
    ];
    for (const [texture, texels, format, type, data] of parts) {
      const full = Math.floor(n / rowSlots);
      const split = full * rowSlots * texels * 4;
      gl.bindTexture(gl.TEXTURE_2D, texture);
      if (full > 0) gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, row, rowSlots * texels, full, format, type, data.subarray(0, split));
      if (n % rowSlots) gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, row + full, (n % rowSlots) * texels, 1, format, type, data.subarray(split));
    }
  }

  /** The slots to draw, farthest first, in an array that fills whole rows. @param {Uint32Array} order @param {number} count */
  setOrder(order, count) {
    const { gl } = this;
    this.current = 1 - this.current;
    this.count = count;
    if (count === 0) return;
    if (count > this.capacity) this.reserve(count);
    const target = this.orders[this.current];
    const rows = Math.ceil(count / ORDER_WIDTH);
    if (rows > target.rows) {
      gl.deleteTexture(target.texture);
      target.rows = Math.ceil(rows * 1.25);
      target.texture = this.texture(gl.R32UI, ORDER_WIDTH, target.rows);
    }
    gl.bindTexture(gl.TEXTURE_2D, target.texture);
    gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, ORDER_WIDTH, rows, gl.RED_INTEGER, gl.UNSIGNED_INT, order.subarray(0, rows * ORDER_WIDTH));
  }

  /** Draws the order of the last `setOrder` at time `t`. @param {import('./camera.js').View} view @param {number} t seconds @param {Target} target */
  draw(view, t, target) {
    const { gl } = this;
    const timed = this.startTimer();
    this.resize(view.width, view.height);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.picture.framebuffer);
    gl.viewport(0, 0, view.width, view.height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT);
    if (this.count > 0) this.drawSplats(view, t);
    this.show(view, target);
    if (timed) gl.endQuery(/** @type {any} */ (this.timer).TIME_ELAPSED_EXT);
  }

  /** @param {import('./camera.js').View} view @param {number} t */
  drawSplats(view, t) {
    const { gl, splat, look } = this;
    const margin = 0.15; // 0.3 of half the picture
    const { fx, fy, cx, cy, width, height } = view;
    gl.useProgram(splat.program);
    [this.geometry, this.looks, this.orders[this.current].texture].forEach((texture, unit) => {
      gl.activeTexture(gl.TEXTURE0 + unit);
      gl.bindTexture(gl.TEXTURE_2D, texture);
      gl.uniform1i(splat.at(['geometry', 'look', 'order'][unit]), unit);
    });
    gl.activeTexture(gl.TEXTURE0);
    gl.uniform1i(splat.at('row_slots'), this.rowSlots);
    gl.uniformMatrix3fv(splat.at('rotation'), true, view.rotation);
    gl.uniform3fv(splat.at('center'), view.center);
    gl.uniform4f(splat.at('intrinsics'), fx, fy, cx, cy);
    const [mx, my] = [(margin * width) / fx, (margin * height) / fy];
    gl.uniform4f(splat.at('clamp_uv'), -cx / fx - mx, -cy / fy - my, (width - cx) / fx + mx, (height - cy) / fy + my);
    gl.uniform4f(splat.at('constants'), look.blur, look.alphaMin, look.near, t);
    gl.uniform2f(splat.at('size'), width, height);
    gl.uniform2f(splat.at('alpha_range'), look.alphaMin, look.alphaMax);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    gl.bindVertexArray(this.quads);
    gl.drawElements(gl.TRIANGLES, 6 * this.count, gl.UNSIGNED_INT, 0);
    gl.disable(gl.BLEND);
  }

  /** Puts the picture over the background. @param {import('./camera.js').View} view @param {Target} target */
  show(view, target) {
    const { gl, screen } = this;
    gl.bindFramebuffer(gl.FRAMEBUFFER, target.framebuffer);
    gl.viewport(target.x, target.y, view.width, view.height);
    gl.useProgram(screen.program);
    gl.uniform1i(screen.at('picture'), 0);
    gl.uniform2i(screen.at('origin'), target.x, target.y);
    gl.uniform3fv(screen.at('background'), this.look.background);
    gl.bindTexture(gl.TEXTURE_2D, this.picture.texture);
    gl.bindVertexArray(null);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  /** @param {number} width @param {number} height */
  resize(width, height) {
    const { gl, picture } = this;
    if (picture.width === width && picture.height === height) return;
    gl.deleteTexture(picture.texture);
    picture.texture = this.texture(this.pictureFormat, width, height);
    picture.framebuffer ??= gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, picture.framebuffer);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, picture.texture, 0);
    [picture.width, picture.height] = [width, height];
  }

  /** Times one draw at a time on the device. Returns whether a query runs. */
  startTimer() {
    const { gl, timer } = this;
    if (!timer) return false;
    if (this.query) {
      if (!gl.getQueryParameter(this.query, gl.QUERY_RESULT_AVAILABLE)) return false;
      this.drawMs = gl.getQueryParameter(this.query, gl.QUERY_RESULT) / 1e6;
    }
    this.query ??= gl.createQuery();
    gl.beginQuery(timer.TIME_ELAPSED_EXT, /** @type {WebGLQuery} */ (this.query));
    return true;
  }

  /** Waits until the device has drawn. */
  finish() {
    this.gl.readPixels(0, 0, 1, 1, this.gl.RGBA, this.gl.UNSIGNED_BYTE, new Uint8Array(4));
  }

  /** What was drawn last to the canvas: RGBA rows from the top. Call it in the same task as `draw`. @param {number} width @param {number} height */
  read(width, height) {
    const { gl } = this;
    const flipped = new Uint8Array(width * height * 4);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, flipped);
    const rows = new Uint8ClampedArray(flipped.length);
    for (let y = 0; y < height; y += 1) rows.set(flipped.subarray((height - 1 - y) * width * 4, (height - y) * width * 4), y * width * 4);
    return rows;
  }
}

/** @typedef {{ program: WebGLProgram, at: (name: string) => WebGLUniformLocation | null }} Program */

/** @param {WebGL2RenderingContext} gl @param {string} vertex @param {string} fragment @returns {Program} */
function link(gl, vertex, fragment) {
  const program = gl.createProgram();
  /** @type {[number, string][]} */
  const sources = [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]];
  for (const [type, source] of sources) {
    const shader = /** @type {WebGLShader} */ (gl.createShader(type));
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS) && !gl.isContextLost()) {
      throw new Error(`shader: ${gl.getShaderInfoLog(shader)}`);
    }
  }
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost()) throw new Error(`shaders: ${gl.getProgramInfoLog(program)}`);
  /** @type {Map<string, WebGLUniformLocation | null>} */
  const locations = new Map();
  return {
    program,
    at(name) {
      if (!locations.has(name)) locations.set(name, gl.getUniformLocation(program, name));
      return locations.get(name) ?? null;
    },
  };
}
