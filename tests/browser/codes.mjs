// Codes for the tests, and the plain chaos game that the page's points are compared with.

import { randomNumbers } from "../../fractal_exp/viewer/static/random.mjs";

export const FERN = {
  linear: [[[0, 0], [0, 0.16]], [[0.85, 0.04], [-0.04, 0.85]], [[0.2, -0.26], [0.23, 0.22]],
    [[-0.15, 0.28], [0.26, 0.24]]],
  offset: [[0, 0], [0, 1.6], [0, 1.6], [0, 0.44]],
  probabilities: [0.01, 0.85, 0.07, 0.07],
};
const half = [[0.5, 0], [0, 0.5]];
export const SQUARE = { linear: [half, half, half, half], offset: [[0, 0], [0.5, 0], [0, 0.5], [0.5, 0.5]],
  probabilities: null };
// Overlaps, so that the words that meet a window are more and more with every level.
const wide = [[0.7, 0.1], [-0.1, 0.7]];
export const OVERLAPPING = { linear: [wide, wide, wide, wide], offset: [[0, 0], [0.3, 0], [0, 0.3], [0.3, 0.3]],
  probabilities: null };

export function pointsOf(code, count, seed = 5) {
  const random = randomNumbers(seed), points = [];
  let x = 0, y = 0;
  for (let k = -100; k < count; k++) {
    let i = 0;
    for (let left = random(); i < code.count - 1 && left >= code.chances[i]; i++) left -= code.chances[i];
    const [a, b, c, d, e, f] = code.maps.subarray(6 * i, 6 * i + 6);
    [x, y] = [a * x + b * y + e, c * x + d * y + f];
    if (k >= 0) points.push([x, y]);
  }
  return points;
}

/** A point of the attractor to double precision: the image of a fixed point under a long random word. */
export function deepPoint(code, seed = 7) {
  return pointsOf(code, 1, seed)[0];
}
