// WebGL 2: points thrown under words into a canvas of subpixels, and the share of them that is lit as a picture.
//
// A word comes as one affine map to clip space, so that single precision is enough at any zoom: the points beside it
// are of the attractor's size, and the word brings them to the window's. There are four kinds of canvas. "lit": every
// point sets its subpixel to 1; the mean over a pixel's subpixels is a level of the canvas's mipmap. "colour": every
// point gives its subpixel its colour. "count": every point adds 1 to its pixel. "tinted": it adds its colour too.

import { STOPS, stopsOf } from "./colours.mjs";
import { canvasByHand, clearByHand, colouredByHand, tintedByHand } from "./hand.mjs";
import { DRAW, POOL } from "./points.mjs";
import {
  ACROSS, COVER, LIGHT, SHOW, SHOW_COLOUR, SHOW_TINTED, TEXELS, THROW, THROW_IN_COLOUR, TINT, showDensity,
} from "./shaders.mjs";
import { MOST_WORDS } from "./words.mjs";

export const COUNTING = ["count", "tinted"]; // kinds of canvas
const SAMPLED_ROWS = 48; // of a canvas of counts, from which the palette's end is taken

/** Throws points into a canvas; throws an Error where WebGL 2 is absent. */
export class Renderer {
  constructor(canvas) {
    this.gl = canvas.getContext("webgl2", { alpha: false, antialias: false, depth: false });
    if (!this.gl) throw new Error("this browser has no WebGL 2");
    const { gl } = this;
    this.throwing = { lit: program(gl, THROW, LIGHT), colour: program(gl, THROW_IN_COLOUR, TINT) };
    Object.assign(this.throwing, { count: this.throwing.lit, tinted: this.throwing.colour });
    this.showing = {
      lit: program(gl, COVER, SHOW), colour: program(gl, COVER, SHOW_COLOUR),
      count: program(gl, COVER, showDensity(STOPS)), tinted: program(gl, COVER, SHOW_TINTED),
    };
    this.counts = Boolean(gl.getExtension("EXT_color_buffer_float") && gl.getExtension("EXT_float_blend"));
    this.formats = { lit: gl.R8, colour: gl.RGBA8, count: gl.R32F, tinted: gl.RGBA32F };
    const names = gl.getExtension("WEBGL_debug_renderer_info");
    this.name = String(gl.getParameter(names ? names.UNMASKED_RENDERER_WEBGL : gl.RENDERER));
    this.mostTexels = gl.getParameter(gl.MAX_TEXTURE_SIZE);
    this.words = texture(gl, gl.TEXTURE_2D);
    gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA32F, TEXELS * ACROSS, MOST_WORDS / ACROSS);
    this.texels = new Float32Array(4 * TEXELS * MOST_WORDS);
    this.points = buffer(gl, 8 * (POOL + DRAW));
    this.shades = buffer(gl, 4 * (POOL + DRAW));
    this.slots = buffer(gl, 2 * DRAW);
    this.array = gl.createVertexArray();
    this.empty = gl.createVertexArray();
    gl.bindVertexArray(this.array);
    gl.enableVertexAttribArray(0);
    gl.enableVertexAttribArray(1);
    gl.enableVertexAttribArray(2);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.slots);
    gl.vertexAttribIPointer(1, 1, gl.UNSIGNED_SHORT, 0, 0);
  }

  /**
   * An empty canvas, of one of the kinds, of width × height pixels with supersample² subpixels each, supersample a
   * power of two up to 8, or 1 for counts. One that is filled by hand lies in the processor's memory, and a texture
   * takes what is to be shown of it.
   */
  target(width, height, supersample, byHand, kind = "lit") {
    const { gl } = this, format = this.formats[kind];
    const canvas = texture(gl, gl.TEXTURE_2D);
    if (byHand) {
      gl.texStorage2D(gl.TEXTURE_2D, 1, format, width, height);
      byHand = canvasByHand(width, height, supersample, kind);
      return { kind, canvas, frame: null, level: 0, side: 1, width, height, supersample, byHand };
    }
    const level = Math.min(Math.log2(supersample), kind === "lit" ? Infinity : 1);
    gl.texStorage2D(gl.TEXTURE_2D, level + 1, format, width * supersample, height * supersample);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAX_LEVEL, level);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST_MIPMAP_NEAREST);
    const frame = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, canvas, 0);
    return { kind, canvas, frame, level, side: supersample >> level, width, height, supersample };
  }

  remove(target) {
    this.gl.deleteFramebuffer(target.frame);
    this.gl.deleteTexture(target.canvas);
  }

  clear(target) {
    const { gl } = this;
    if (target.byHand) return clearByHand(target.byHand);
    gl.bindFramebuffer(gl.FRAMEBUFFER, target.frame);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT);
    return undefined;
  }

  /** The words of a cut, with the window folded in. */
  setWords(words, width, height) {
    const { gl, texels } = this, { maps, folds } = words;
    for (let n = 0; n < words.count; n++) {
      const m = 6 * n, at = 4 * TEXELS * n;
      texels.set([(2 * maps[m]) / width, (-2 * maps[m + 2]) / height, (2 * maps[m + 1]) / width,
        (-2 * maps[m + 3]) / height, (2 * maps[m + 4]) / width - 1, 1 - (2 * maps[m + 5]) / height, 0, 0], at);
      if (folds) texels.set(folds.subarray(4 * n, 4 * n + 4), at + 8);
    }
    const rows = Math.ceil(words.count / ACROSS);
    gl.bindTexture(gl.TEXTURE_2D, this.words);
    gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, TEXELS * ACROSS, rows, gl.RGBA, gl.FLOAT, texels);
  }

  /** Points of the pool, as floats x y, and their colours, as bytes r g b and one unused, from `first` on. */
  setPoints(points, shades, first = 0) {
    const { gl } = this;
    gl.bindBuffer(gl.ARRAY_BUFFER, this.points);
    gl.bufferSubData(gl.ARRAY_BUFFER, 8 * first, points);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.shades);
    gl.bufferSubData(gl.ARRAY_BUFFER, 4 * first, shades);
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
    gl.useProgram(this.throwing[target.kind]);
    gl.bindTexture(gl.TEXTURE_2D, this.words);
    gl.bindVertexArray(this.array);
    if (COUNTING.includes(target.kind)) gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE);
    for (const offset of offsets) {
      gl.bindBuffer(gl.ARRAY_BUFFER, this.points);
      gl.vertexAttribPointer(0, 2, gl.FLOAT, false, 0, 8 * offset);
      gl.bindBuffer(gl.ARRAY_BUFFER, this.shades);
      gl.vertexAttribPointer(2, 4, gl.UNSIGNED_BYTE, true, 0, 4 * offset);
      gl.drawArrays(gl.POINTS, 0, DRAW);
    }
    gl.disable(gl.BLEND);
  }

  /** Counts of the points in some rows of a target that counts. */
  someCounts({ kind, width, height, frame, byHand }) {
    const step = Math.max(1, Math.floor(height / SAMPLED_ROWS)), counts = [];
    const read = new Float32Array(4 * width), { gl } = this;
    gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
    for (let row = step >> 1; row < height; row += step) {
      if (byHand) counts.push(...byHand.points.subarray(row * width, (row + 1) * width));
      else gl.readPixels(0, row, width, 1, gl.RGBA, gl.FLOAT, read);
      if (!byHand) for (let column = 0; column < width; column++) counts.push(read[4 * column + (kind === "count" ? 0 : 3)]);
    }
    return counts;
  }

  /**
   * Show the target, of whose points the share `done` in (0,1] was thrown. look: {ground, ink}, colours [r, g, b] in
   * [0,1], and for counts {palette, tone, mean, white}: the mean count of a pixel, and the density at the palette's
   * end.
   */
  show(target, done, look) {
    const { gl } = this, using = this.showing[target.kind], { byHand, supersample } = target;
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.viewport(0, 0, target.width, target.height);
    gl.useProgram(using);
    gl.bindVertexArray(this.empty);
    gl.bindTexture(gl.TEXTURE_2D, target.canvas);
    if (byHand) this.upload(target);
    else if (target.level > 0) gl.generateMipmap(gl.TEXTURE_2D);
    const set = (name) => gl.getUniformLocation(using, name); // null, which sets nothing, for what a kind does not need
    gl.uniform1i(set("level"), target.level);
    gl.uniform1i(set("side"), target.side);
    gl.uniform1i(set("byHand"), byHand ? 1 : 0);
    gl.uniform1f(set("done"), Math.min(1, done));
    gl.uniform1f(set("scale"), byHand ? 255 / supersample ** 2 : 1);
    gl.uniform3fv(set("ground"), look.ground);
    gl.uniform3fv(set("ink"), look.ink);
    if (COUNTING.includes(target.kind)) {
      for (const name of ["mean", "white", "tone", "exposure"]) gl.uniform1f(set(name), look[name]);
      gl.uniform1f(set("gamma"), look.own?.gamma ?? 0);
      gl.uniform1i(set("linear"), look.own?.linear ? 1 : 0);
      gl.uniform3fv(set("palette"), stopsOf(look.palette));
    }
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  /** Give the texture what was thrown by hand. */
  upload({ kind, width, height, byHand }) {
    const { gl } = this;
    const [format, type, data] = {
      lit: () => [gl.RED, gl.UNSIGNED_BYTE, byHand.counts],
      colour: () => [gl.RGBA, gl.UNSIGNED_BYTE, colouredByHand(byHand)],
      count: () => [gl.RED, gl.FLOAT, byHand.points],
      tinted: () => [gl.RGBA, gl.FLOAT, tintedByHand(byHand)],
    }[kind]();
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, width, height, format, type, data);
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
