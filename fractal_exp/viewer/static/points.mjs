// Points of the invariant measure, and which word each of them goes under.

import { meanColour } from "./colours.mjs";
import { randomNumbers } from "./random.mjs";

export const POOL = 1 << 18; // points that are kept
export const DRAW = 1 << 16; // points of one draw; the pool is repeated by as many at its end
const PART = POOL / 16; // that is renewed at once
const FIRST = 5; // parts that do for a first picture
const ORBITS = 64; // chaos games that run side by side
const WARM_UP = 256; // steps that lead from a fixed point to the invariant measure
const STRIDE = 10_127; // odd, about .618 of a part: points that follow each other in an orbit lie far apart

/** Points of the invariant measure about the tree's middle, as floats x y, and their colours where the tree has folds
 * of colours, as bytes r g b and one unused; `renew` replaces a part of them. */
export class Pool {
  constructor(tree, seed = 1) {
    this.points = new Float32Array(2 * (POOL + DRAW));
    this.shades = new Uint8Array(4 * (POOL + DRAW));
    this.colours = new Float64Array(3 * ORBITS);
    this.orbits = new Float64Array(2 * ORBITS);
    this.seed = seed;
    this.follow(tree, POOL / PART);
  }

  /** Fill the pool with points of another tree: some parts at once, and the others as they are renewed. */
  follow(tree, parts = FIRST) {
    this.tree = tree;
    this.random = randomNumbers(this.seed);
    this.cumulative = Float64Array.from(tree.chances);
    for (let i = 1; i < tree.count; i++) this.cumulative[i] += this.cumulative[i - 1];
    this.cumulative[lastPossible(tree.chances)] = Infinity;
    this.orbits.fill(0);
    if (tree.folds) for (let j = 0; j < ORBITS; j++) this.colours.set(meanColour(tree.folds, tree.chances), 3 * j);
    this.next = this.filled = 0;
    for (let step = 0; step < WARM_UP; step++) for (let j = 0; j < ORBITS; j++) this.step(j);
    for (let part = 0; part < parts; part++) this.renew();
  }

  /** Fill what is left. */
  fill() {
    while (this.filled < POOL) this.renew();
  }

  step(j) {
    const { maps } = this.tree, { orbits, cumulative } = this;
    const chance = this.random();
    let i = 0;
    while (chance >= cumulative[i]) i += 1;
    const m = 6 * i, x = orbits[2 * j], y = orbits[2 * j + 1];
    orbits[2 * j] = maps[m] * x + maps[m + 1] * y + maps[m + 4];
    orbits[2 * j + 1] = maps[m + 2] * x + maps[m + 3] * y + maps[m + 5];
    if (this.tree.folds) this.fold(j, i);
  }

  fold(j, i) {
    const { keep, gift } = this.tree.folds, { colours } = this;
    for (let c = 0; c < 3; c++) colours[3 * j + c] = keep[i] * colours[3 * j + c] + gift[3 * i + c];
  }

  /** Replace a part of the points, each part in its turn: the places [first, points, shades] where that was done. */
  renew() {
    const { points, orbits, shades, colours } = this, first = this.next, { folds } = this.tree;
    for (let k = 0; k < PART; k++) {
      const j = k % ORBITS, at = 2 * (first + (Math.imul(k, STRIDE) & (PART - 1)));
      this.step(j);
      points[at] = orbits[2 * j];
      points[at + 1] = orbits[2 * j + 1];
      if (folds) for (let c = 0; c < 3; c++) shades[2 * at + c] = 255 * colours[3 * j + c] + 0.5;
    }
    this.next = (first + PART) % POOL;
    this.filled = Math.max(this.filled, first + PART);
    const renewed = points.subarray(2 * first, 2 * (first + PART));
    const coloured = shades.subarray(4 * first, 4 * (first + PART));
    if (first >= DRAW) return [[first, renewed, coloured]];
    points.set(renewed, 2 * (POOL + first));
    shades.set(coloured, 4 * (POOL + first));
    return [[first, renewed, coloured], [POOL + first, renewed, coloured]];
  }
}

/** A place from which on `count` points of a pool may be taken. */
export function placeIn(pool, random, count) {
  return Math.floor(random() * (pool.filled === POOL ? POOL : pool.filled - count));
}

function lastPossible(chances) {
  let last = 0;
  chances.forEach((chance, i) => { if (chance > 0) last = i; });
  return last;
}

/** Which word each of the DRAW points of a draw goes under, in proportion to their mass, by systematic sampling. */
export function shareOut(words, random, into = new Uint16Array(DRAW)) {
  const step = words.total / into.length;
  let word = 0, reached = words.mass[0];
  for (let k = 0, at = random() * step; k < into.length; k++, at += step) {
    while (at >= reached && word < words.count - 1) reached += words.mass[++word];
    into[k] = word;
  }
  return into;
}

/** The share of the points that fall into the window of width × height pixels, by trying some of them. */
export function shareInView(words, pool, random, width, height, tries = 16_384) {
  const slots = shareOut(words, random, new Uint16Array(tries));
  const offset = placeIn(pool, random, tries);
  let inside = 0;
  for (let k = 0; k < tries; k++) {
    const m = 6 * slots[k], { maps } = words;
    const x = pool.points[2 * (offset + k)], y = pool.points[2 * (offset + k) + 1];
    const column = maps[m] * x + maps[m + 1] * y + maps[m + 4], row = maps[m + 2] * x + maps[m + 3] * y + maps[m + 5];
    if (column >= 0 && column < width && row >= 0 && row < height) inside += 1;
  }
  return inside / tries;
}
