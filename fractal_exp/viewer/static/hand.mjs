// Points thrown by the processor, for where the GPU is a program itself: SwiftShader takes fifty times as long for a
// point as this loop.

import { DRAW } from "./points.mjs";

/** Whether a renderer of this name is a program. */
export function isSoftware(name) {
  return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(name);
}

/**
 * An empty canvas of width × height pixels with supersample² subpixels each, and how many of them are lit; with `kind`
 * "colour" also the points of each pixel and the sums of their colours, with "count" only the points, and with "tinted"
 * points and sums.
 */
export function canvasByHand(width, height, supersample, kind = "lit") {
  const pixels = width * height, subpixels = "lit colour".includes(kind) ? pixels * supersample ** 2 : 0;
  const made = { subpixels: new Uint8Array(subpixels), counts: new Uint8Array(pixels) };
  if (kind !== "lit") made.points = new Float32Array(pixels);
  if (kind === "colour") Object.assign(made, { sums: new Float32Array(3 * pixels), bytes: new Uint8Array(4 * pixels) });
  if (kind === "tinted") Object.assign(made, { sums: new Float32Array(3 * pixels), mixed: new Float32Array(4 * pixels) });
  return made;
}

/** Empty a canvas again. */
export function clearByHand(byHand) {
  for (const array of Object.values(byHand)) array.fill(0);
}

/** Put DRAW points under the words `slots`, for each offset into the pool, and light their subpixels. */
export function throwByHand({ width, height, supersample, byHand }, words, slots, { points, shades }, offsets) {
  const { subpixels, counts, points: hits, sums } = byHand, { maps, folds } = words, each = supersample * supersample;
  for (const offset of offsets) {
    for (let k = 0; k < DRAW; k++) {
      const m = 6 * slots[k], x = points[2 * (offset + k)], y = points[2 * (offset + k) + 1];
      const column = maps[m] * x + maps[m + 1] * y + maps[m + 4], row = maps[m + 2] * x + maps[m + 3] * y + maps[m + 5];
      if (!(column >= 0 && column < width && row >= 0 && row < height)) continue;
      const c = column | 0, r = row | 0, pixel = r * width + c;
      if (hits) hits[pixel] += 1;
      if (subpixels.length) {
        const part = (((row - r) * supersample) | 0) * supersample + (((column - c) * supersample) | 0);
        const at = pixel * each + part;
        counts[pixel] += 1 - subpixels[at];
        subpixels[at] = 1;
      }
      if (!sums) continue;
      const f = 4 * slots[k], s = 4 * (offset + k);
      for (let channel = 0; channel < 3; channel++) {
        sums[3 * pixel + channel] += folds[f] * shades[s + channel] + 255 * folds[f + 1 + channel];
      }
    }
  }
}

/** The mean colour of each pixel and how many of its subpixels are lit, as bytes r g b lit. */
export function colouredByHand({ counts, points, sums, bytes }) {
  for (let pixel = 0; pixel < counts.length; pixel++) {
    if (points[pixel] === 0) continue;
    for (let channel = 0; channel < 3; channel++) {
      bytes[4 * pixel + channel] = sums[3 * pixel + channel] / points[pixel] + 0.5;
    }
    bytes[4 * pixel + 3] = counts[pixel];
  }
  return bytes;
}

/** The sums of the colours of each pixel's points, in [0,1] each, and their number. */
export function tintedByHand({ points, sums, mixed }) {
  for (let pixel = 0; pixel < points.length; pixel++) {
    for (let channel = 0; channel < 3; channel++) mixed[4 * pixel + channel] = sums[3 * pixel + channel] / 255;
    mixed[4 * pixel + 3] = points[pixel];
  }
  return mixed;
}
