// WebGL 2: points thrown under words into a canvas of subpixels, and the share of them that is lit as a picture.
//
// A word comes as one affine map to clip space, so that single precision is enough at any zoom: the points beside it
// are of the attractor's size, and the word brings them to the window's. Every point sets its subpixel to 1; the mean
// over a pixel's subpixels is the third level of the canvas's mipmap.

import { canvasByHand } from "./hand.mjs";
import { DRAW, POOL } from "./points.mjs";
import { MOST_WORDS } from "./words.mjs";

const ACROSS = 64; // words in a row of their texture, two texels each

const THROW = `#version 300 es
layout(location = 0) in vec2 point;
layout(location = 1) in uint slot;
uniform highp sampler2D words;
void main() {
  int word = int(slot);
  ivec2 at = ivec2(2 * (word % ${ACROSS}), word / ${ACROSS});
  vec4 linear = texelFetch(words, at, 0), shift = texelFetch(words, at + ivec2(1, 0), 0);
  gl_Position = vec4(linear.xy * point.x + linear.zw * point.y + shift.xy, 0.0, 1.0);
  gl_PointSize = 1.0;
}`;
const LIGHT = `#version 300 es
precision mediump float;
out vec4 colour;
void main() { colour = vec4(1.0); }`;
const COVER = `#version 300 es
void main() { gl_Position = vec4(vec2(gl_VertexID % 2, gl_VertexID / 2) * 4.0 - 1.0, 0.0, 1.0); }`;
// With a share f of the points thrown, a share s of a pixel's subpixels is lit; with all of them it will be about
// 1 - (1 - s)^(1/f), so that a picture does not grow brighter while it grows sharper.
const SHOW = `#version 300 es
precision highp float;
uniform highp sampler2D canvas;
uniform int level;
uniform float done, scale;
uniform vec3 ground, ink;
out vec4 colour;
void main() {
  ivec2 size = textureSize(canvas, level), at = ivec2(gl_FragCoord.xy);
  at.y = scale == 1.0 ? at.y : size.y - 1 - at.y; // what is thrown by hand has its first row on top
  float lit = min(1.0, scale * texelFetch(canvas, min(at, size - 1), level).r);
  colour = vec4(mix(ground, ink, 1.0 - pow(1.0 - lit, 1.0 / done)), 1.0);
}`;

/** Throws points into a canvas; throws an Error where WebGL 2 is absent. */
export class Renderer {
  constructor(canvas) {
    this.gl = canvas.getContext("webgl2", { alpha: false, antialias: false, depth: false });
    if (!this.gl) throw new Error("this browser has no WebGL 2");
    const { gl } = this;
    this.throwing = program(gl, THROW, LIGHT);
    this.showing = program(gl, COVER, SHOW);
    const names = gl.getExtension("WEBGL_debug_renderer_info");
    this.name = String(gl.getParameter(names ? names.UNMASKED_RENDERER_WEBGL : gl.RENDERER));
    this.mostTexels = gl.getParameter(gl.MAX_TEXTURE_SIZE);
    this.words = texture(gl, gl.TEXTURE_2D);
    gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA32F, 2 * ACROSS, MOST_WORDS / ACROSS);
    this.texels = new Float32Array(8 * MOST_WORDS);
    this.points = buffer(gl, 8 * (POOL + DRAW));
    this.slots = buffer(gl, 2 * DRAW);
    this.array = gl.createVertexArray();
    this.empty = gl.createVertexArray();
    gl.bindVertexArray(this.array);
    gl.enableVertexAttribArray(0);
    gl.enableVertexAttribArray(1);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.slots);
    gl.vertexAttribIPointer(1, 1, gl.UNSIGNED_SHORT, 0, 0);
  }

  /**
   * An empty canvas of width × height pixels with supersample² subpixels each, supersample a power of two up to 8.
   * One that is filled by hand lies in the processor's memory, and a texture takes the number of lit subpixels.
   */
  target(width, height, supersample, byHand) {
    const { gl } = this;
    if (byHand) {
      const canvas = texture(gl, gl.TEXTURE_2D);
      gl.texStorage2D(gl.TEXTURE_2D, 1, gl.R8, width, height);
      byHand = canvasByHand(width, height, supersample);
      return { canvas, frame: null, level: 0, width, height, supersample, byHand };
    }
    const level = Math.log2(supersample);
    const canvas = texture(gl, gl.TEXTURE_2D);
    gl.texStorage2D(gl.TEXTURE_2D, level + 1, gl.R8, width * supersample, height * supersample);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAX_LEVEL, level);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST_MIPMAP_NEAREST);
    const frame = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, canvas, 0);
    return { canvas, frame, level, width, height, supersample };
  }

  remove(target) {
    this.gl.deleteFramebuffer(target.frame);
    this.gl.deleteTexture(target.canvas);
  }

  clear(target) {
    const { gl } = this;
    target.byHand?.subpixels.fill(0);
    target.byHand?.counts.fill(0);
    if (target.byHand) return;
    gl.bindFramebuffer(gl.FRAMEBUFFER, target.frame);
    gl.clearColor(0, 0, 0, 1);
    gl.clear(gl.COLOR_BUFFER_BIT);
  }

  /** The words of a cut, with the window folded in. */
  setWords(words, width, height) {
    const { gl, texels } = this, { maps } = words;
    for (let n = 0; n < words.count; n++) {
      const m = 6 * n;
      texels.set([(2 * maps[m]) / width, (-2 * maps[m + 2]) / height, (2 * maps[m + 1]) / width,
        (-2 * maps[m + 3]) / height, (2 * maps[m + 4]) / width - 1, 1 - (2 * maps[m + 5]) / height, 0, 0], 8 * n);
    }
    const rows = Math.ceil(words.count / ACROSS);
    gl.bindTexture(gl.TEXTURE_2D, this.words);
    gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, 2 * ACROSS, rows, gl.RGBA, gl.FLOAT, texels);
  }

  /** Points of the pool, as floats x y, from `first` on. */
  setPoints(points, first = 0) {
    const { gl } = this;
    gl.bindBuffer(gl.ARRAY_BUFFER, this.points);
    gl.bufferSubData(gl.ARRAY_BUFFER, 8 * first, points);
  }

  setSlots(slots) {
    const { gl } = this;
    gl.bindBuffer(gl.ARRAY_BUFFER, this.slots);
    gl.bufferSubData(gl.ARRAY_BUFFER, 0, slots);
  }

  /** Throw DRAW points into the target for each offset into the pool. */
  throwPoints(target, offsets) {
    const { gl } = this;
    gl.bindFramebuffer(gl.FRAMEBUFFER, target.frame);
    gl.viewport(0, 0, target.width * target.supersample, target.height * target.supersample);
    gl.useProgram(this.throwing);
    gl.bindTexture(gl.TEXTURE_2D, this.words);
    gl.bindVertexArray(this.array);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.points);
    for (const offset of offsets) {
      gl.vertexAttribPointer(0, 2, gl.FLOAT, false, 0, 8 * offset);
      gl.drawArrays(gl.POINTS, 0, DRAW);
    }
  }

  /** Show the target, of whose points the share `done` in (0,1] was thrown; colours are [r, g, b] in [0,1]. */
  show(target, done, ground, ink) {
    const { gl } = this;
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.viewport(0, 0, target.width, target.height);
    gl.useProgram(this.showing);
    gl.bindVertexArray(this.empty);
    gl.bindTexture(gl.TEXTURE_2D, target.canvas);
    if (target.byHand) {
      gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
      const { width, height, byHand } = target;
      gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, width, height, gl.RED, gl.UNSIGNED_BYTE, byHand.counts);
    } else if (target.level > 0) gl.generateMipmap(gl.TEXTURE_2D);
    const set = (name) => gl.getUniformLocation(this.showing, name);
    gl.uniform1i(set("level"), target.level);
    gl.uniform1f(set("done"), Math.min(1, done));
    gl.uniform1f(set("scale"), target.byHand ? 255 / target.supersample ** 2 : 1);
    gl.uniform3fv(set("ground"), ground);
    gl.uniform3fv(set("ink"), ink);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  /** A function that tells whether the GPU has done all that was asked of it until now. */
  fence() {
    const { gl } = this;
    const sync = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    gl.flush();
    let passed = false;
    return () => {
      if (!passed && gl.getSyncParameter(sync, gl.SYNC_STATUS) === gl.SIGNALED) {
        gl.deleteSync(sync);
        passed = true;
      }
      return passed;
    };
  }
}

function program(gl, vertex, fragment) {
  const made = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    gl.attachShader(made, shader);
  }
  gl.linkProgram(made);
  if (!gl.getProgramParameter(made, gl.LINK_STATUS) && !gl.isContextLost()) {
    throw new Error(`the shaders do not link: ${gl.getProgramInfoLog(made)}`);
  }
  return made;
}

function texture(gl, kind) {
  const made = gl.createTexture();
  gl.bindTexture(kind, made);
  gl.texParameteri(kind, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
  gl.texParameteri(kind, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
  gl.texParameteri(kind, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
  gl.texParameteri(kind, gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE);
  return made;
}

function buffer(gl, bytes) {
  const made = gl.createBuffer();
  gl.bindBuffer(gl.ARRAY_BUFFER, made);
  gl.bufferData(gl.ARRAY_BUFFER, bytes, gl.DYNAMIC_DRAW);
  return made;
}
