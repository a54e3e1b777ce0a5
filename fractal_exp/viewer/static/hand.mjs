// Points thrown by the processor, for where the GPU is a program itself: SwiftShader takes fifty times as long for a
// point as this loop.

import { DRAW } from "./points.mjs";

/** Whether a renderer of this name is a program. */
export function isSoftware(name) {
  return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(name);
}

/** An empty canvas of width × height pixels with supersample² subpixels each, and how many of them are lit. */
export function canvasByHand(width, height, supersample) {
  return {
    subpixels: new Uint8Array(width * height * supersample ** 2), counts: new Uint8Array(width * height),
  };
}

/** Put DRAW points under the words `slots`, for each offset into the pool, and light their subpixels. */
export function throwByHand({ width, height, supersample, byHand }, words, slots, points, offsets) {
  const { subpixels, counts } = byHand, { maps } = words, each = supersample * supersample;
  for (const offset of offsets) {
    for (let k = 0; k < DRAW; k++) {
      const m = 6 * slots[k], x = points[2 * (offset + k)], y = points[2 * (offset + k) + 1];
      const column = maps[m] * x + maps[m + 1] * y + maps[m + 4], row = maps[m + 2] * x + maps[m + 3] * y + maps[m + 5];
      if (!(column >= 0 && column < width && row >= 0 && row < height)) continue;
      const c = column | 0, r = row | 0, pixel = r * width + c;
      const part = (((row - r) * supersample) | 0) * supersample + (((column - c) * supersample) | 0);
      const at = pixel * each + part;
      counts[pixel] += 1 - subpixels[at];
      subpixels[at] = 1;
    }
  }
}
