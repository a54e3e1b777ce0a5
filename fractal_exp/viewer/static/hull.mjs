// Where the attractor lies for certain: half planes, and the smallest rectangle about them. Of a code that contracts on
// average only, they are those of a box that reaches half as far again as many points; hardly any lies beyond.

import { ready } from "./code.mjs";
import { inverse, largestSingularValue, within } from "./contraction.mjs";
import { randomNumbers } from "./random.mjs";

const DIRECTIONS = 256; // of the half planes, a multiple of 4
const SWEEPS = 2000, MOST_WORK = 4e7; // at most, and steps of all sweeps: a looser bound is certain too
const TOLERANCE = 1e-7; // of the disc's radius, times how much the slowest map contracts
const POINT = 5e-6, HALF = 0.75; // half side of what counts as a point, and of the box about it
const SAMPLE = 100_000, FORGOTTEN = 2000, BEYOND = 1.5, TAIL = 1e-3; // as in fractal_exp/ifs/attractor.py
const FLAT = 0.15; // least ratio of a box's sides
const SLACK = 1 + 1e-9; // covers the rounding of all this

/** A disc {x, y, radius} that certainly holds the attractor: words with which all others begin send it, or an ellipse
 * in it, into itself (Hutchinson 1981). slack: how much they contract at least. */
export function boundingDisc({ contraction: { axes, words, factor } }) {
  const scales = words.map((row) => largestSingularValue(within(axes, row)));
  let x = 0, y = 0, weight = 0;
  words.forEach(([a, b, c, d, e, f], i) => {
    const det = (1 - a) * (1 - d) - b * c;
    x += ((1 - d) * e + b * f) / det / (1 - scales[i]);
    y += (c * e + (1 - a) * f) / det / (1 - scales[i]);
    weight += 1 / (1 - scales[i]);
  });
  x /= weight;
  y /= weight;
  const [p, q, r, s] = axes;
  let radius = 0;
  words.forEach(([a, b, c, d, e, f], i) => {
    const u = a * x + b * y + e - x, v = c * x + d * y + f - y;
    radius = Math.max(radius, Math.hypot(p * u + q * v, r * u + s * v) / (1 - scales[i]));
  });
  return { x, y, radius: radius * largestSingularValue(inverse(axes)), slack: 1 - factor };
}

/** The places of many points, x and y each in their order, of a code that contracts on average only. */
function sampled({ count, maps, chances }) {
  const random = randomNumbers(1), xs = new Float64Array(SAMPLE), ys = new Float64Array(SAMPLE);
  let x = 0, y = 0;
  for (let k = -FORGOTTEN; k < SAMPLE; k++) {
    let i = 0;
    for (let left = random(); i < count - 1 && left >= chances[i]; i++) left -= chances[i];
    const m = 6 * i;
    [x, y] = [maps[m] * x + maps[m + 1] * y + maps[m + 4], maps[m + 2] * x + maps[m + 3] * y + maps[m + 5]];
    if (k >= 0) [xs[k], ys[k]] = [x, y];
  }
  return [xs.sort(), ys.sort()];
}

/**
 * Certain upper bounds of u_k·x over the attractor, in 256 directions of angle 2 pi k / 256. A support function obeys
 * h(u) = max_i h(M_i^T u) + b_i·u and is sublinear, so that interpolating between directions never underestimates.
 */
export function supportFunction(code) {
  const delta = (2 * Math.PI) / DIRECTIONS;
  if (code.contraction.kind === "average") {
    const [x, y] = sampled(code).map((all) => [(all[0] + all.at(-1)) / 2, (BEYOND * (all.at(-1) - all[0])) / 2]);
    return Float64Array.from({ length: DIRECTIONS }, (_, k) => {
      const u = Math.cos(k * delta), v = Math.sin(k * delta);
      return u * x[0] + v * y[0] + Math.abs(u) * x[1] + Math.abs(v) * y[1];
    });
  }
  const { x, y, radius, slack } = boundingDisc(code);
  const rows = code.plain.rows.filter((_, i) => code.chances[i] > 0), count = rows.length;
  const size = count * DIRECTIONS;
  const first = new Int32Array(size), alpha = new Float64Array(size), beta = new Float64Array(size);
  const shift = new Float64Array(size);
  const most = Math.min(SWEEPS, Math.ceil(MOST_WORK / size));
  let table = new Float64Array(DIRECTIONS);
  for (let k = 0; k < DIRECTIONS; k++) {
    const u = Math.cos(k * delta), v = Math.sin(k * delta);
    table[k] = u * x + v * y + radius;
    for (let i = 0; i < count; i++) {
      const [a, b, c, d, e, f] = rows[i];
      const p = a * u + c * v, q = b * u + d * v, n = k * count + i;
      const angle = (Math.atan2(q, p) + 2 * Math.PI) % (2 * Math.PI);
      first[n] = Math.min(Math.floor(angle / delta), DIRECTIONS - 1);
      const phi = angle - first[n] * delta, length = Math.hypot(p, q) / Math.sin(delta);
      alpha[n] = Math.max(length * Math.sin(delta - phi), 0);
      beta[n] = Math.max(length * Math.sin(phi), 0);
      shift[n] = u * e + v * f;
    }
  }
  for (let sweep = 0, fall = Infinity; sweep < most && fall > TOLERANCE * slack * radius; sweep++) {
    const swept = new Float64Array(DIRECTIONS);
    fall = 0;
    for (let k = 0; k < DIRECTIONS; k++) {
      let highest = -Infinity;
      for (let n = k * count; n < (k + 1) * count; n++) {
        const next = first[n] + 1 === DIRECTIONS ? 0 : first[n] + 1;
        highest = Math.max(highest, alpha[n] * table[first[n]] + beta[n] * table[next] + shift[n]);
      }
      swept[k] = Math.min(table[k], highest);
      fall = Math.max(fall, table[k] - swept[k]);
    }
    table = swept;
  }
  return table;
}

/** The smallest rectangle that is certain to hold the attractor: its middle {x, y} and half sides p, q as vectors. */
export function boundingRectangle(code) {
  const h = supportFunction(code);
  const quarter = DIRECTIONS / 4;
  let best = null;
  for (let k = 0; k < quarter; k++) {
    const along = h[k] + h[k + 2 * quarter], across = h[k + quarter] + h[k + 3 * quarter];
    if (best === null || along * across < best.along * best.across) best = { k, along, across };
  }
  const { k, along, across } = best;
  const angle = (2 * Math.PI * k) / DIRECTIONS, u = Math.cos(angle), v = Math.sin(angle);
  const s = (h[k] - h[k + 2 * quarter]) / 2, t = (h[k + quarter] - h[k + 3 * quarter]) / 2;
  const half = (SLACK * along) / 2, width = (SLACK * across) / 2;
  return { x: u * s - v * t, y: v * s + u * t, p: [u * half, v * half], q: [-v * width, u * width] };
}

/** An upright box about the attractor of a code in plain form: its middle {x, y} and half sides hx, hy, none of them
 * much shorter than the other, so that a flat attractor has one too. */
export function boxOf(code) {
  const [right, top, left, bottom] = sidesOf(ready(code));
  const [width, height] = [right + left, top + bottom].map((side) => Math.max(side, 0) / 2);
  const longer = Math.max(width, height), isPoint = longer <= POINT;
  const half = (side) => (isPoint ? HALF : Math.max(side, FLAT * longer));
  return { x: (right - left) / 2, y: (top - bottom) / 2, hx: half(width), hy: half(height) };
}

/** How far a code reaches to the right, up, left and down; of one that contracts on average only, all but a thousandth of
 * its points beyond each. */
function sidesOf(code) {
  if (code.contraction.kind !== "average") {
    const h = supportFunction(code);
    return [0, 1, 2, 3].map((k) => h[(k * DIRECTIONS) / 4]);
  }
  const ends = (all) => [TAIL, 1 - TAIL].map((share) => all[Math.round(share * (SAMPLE - 1))]);
  const [[left, right], [bottom, top]] = sampled(code).map(ends);
  return [right, top, -left, -bottom];
}
