// The address tree: the words that meet a window, each composed to one affine map from the attractor to pixels.
//
// The points under a word w = w1 w2 ... are the images under f_w1 ∘ f_w2 ∘ ... of points of the invariant measure
// (Hutchinson 1981), and its mass is p_w1 p_w2 .... Words beside the window are dropped; the others are split until
// they lie in the window or are small against it. So the points that a view needs are thrown into that view alone, at
// any zoom. Where a code's maps overlap, more words meet a window than can be kept: then some are drawn by lot and
// stand for the rest (systematic resampling, which is unbiased), and each cut draws others.

import { foldedWord } from "./colours.mjs";
import { boundingRectangle } from "./hull.mjs";

export const MOST_WORDS = 4096; // that are handed to the GPU
const FEWEST_WORDS = 512; // the same points are put under many words, so that few points do for many
const SMALL = 1 / 8; // of the window's side: a word that reaches no further is drawn and clipped, not split
const DIMENSION = 1.5; // about that of most attractors: how mass falls with size
const STRIDE = 9; // of a word: a b c d x y to pixels, mass, node of its address, reach

/** A code made ready for cutting: maps about the middle of the rectangle that holds the attractor for certain, and what
 * they make of a colour, see `foldsOf`, or null. */
export function addressTree(code, folds = null) {
  const hull = boundingRectangle(code);
  const maps = Float64Array.from(code.maps);
  for (let i = 0; i < code.count; i++) {
    const [a, b, c, d, e, f] = maps.subarray(6 * i, 6 * i + 6);
    maps[6 * i + 4] = a * hull.x + b * hull.y + e - hull.x;
    maps[6 * i + 5] = c * hull.x + d * hull.y + f - hull.y;
  }
  return { count: code.count, maps, chances: code.chances, hull, folds };
}

/** A list of words, in one array of doubles that grows. */
class Words {
  constructor(room = 64) {
    this.data = new Float64Array(room * STRIDE);
    this.count = 0;
  }

  /** The place of a new word in `data`. */
  add() {
    const at = this.count * STRIDE;
    if (at === this.data.length) {
      const grown = new Float64Array(2 * at);
      grown.set(this.data);
      this.data = grown;
    }
    this.count += 1;
    return at;
  }

  copy(from, at) {
    const to = this.add();
    for (let k = 0; k < STRIDE; k++) this.data[to + k] = from[at + k];
    return to;
  }

  mass() {
    let sum = 0;
    for (let at = 6; at < this.count * STRIDE; at += STRIDE) sum += this.data[at];
    return sum;
  }
}

/**
 * Where the parallelogram of the word at `at` lies, -1 beside the window of width × height pixels, 1 within it, 0
 * across its edge; separating axes are those of the two. How far it reaches, as a share of the window's sides, is
 * written beside the word. hull: the half sides p q of the rectangle that holds the attractor.
 */
export function place(data, at, hull, width, height) {
  const px = hull.p[0], py = hull.p[1], qx = hull.q[0], qy = hull.q[1];
  const a = data[at], b = data[at + 1], c = data[at + 2], d = data[at + 3];
  const p0 = a * px + b * py, q0 = c * px + d * py, p1 = a * qx + b * qy, q1 = c * qx + d * qy;
  const reachX = Math.abs(p0) + Math.abs(p1), reachY = Math.abs(q0) + Math.abs(q1);
  data[at + 8] = Math.max(reachX / width, reachY / height);
  const w = width / 2, h = height / 2, dx = data[at + 4] - w, dy = data[at + 5] - h;
  const beyondX = Math.abs(dx), beyondY = Math.abs(dy);
  if (beyondX > w + reachX || beyondY > h + reachY) return -1;
  if (beyondX + reachX < w && beyondY + reachY < h) return 1;
  const area = Math.abs(p0 * q1 - p1 * q0);
  if (Math.abs(p0 * dy - q0 * dx) > area + w * Math.abs(q0) + h * Math.abs(p0)) return -1;
  if (Math.abs(p1 * dy - q1 * dx) > area + w * Math.abs(q1) + h * Math.abs(p1)) return -1;
  return 0;
}

/** The letters of the tree's words: each node knows its letter and the node before. */
class Letters {
  constructor() {
    this.letter = [];
    this.before = [];
  }

  add(letter, before) {
    this.letter.push(letter);
    this.before.push(before);
    return this.letter.length - 1;
  }

  spell(node) {
    const word = [];
    for (; node >= 0; node = this.before[node]) word.push(this.letter[node]);
    return word.reverse();
  }
}

class Cutting {
  constructor(tree, window, random, visits, most) {
    Object.assign(this, { tree, window, random, visits, most });
    this.letters = new Letters();
    this.leaves = new Words();
    this.visited = 0;
    this.sampled = false;
  }

  root() {
    const { left, top, scale } = this.window, { x, y } = this.tree.hull;
    const words = new Words();
    words.data.set([scale, 0, 0, -scale, (x - left) * scale, (top - y) * scale, 1, -1, 0], words.add());
    return words;
  }

  /** Put the children of a word that meet the window among `open`, or among the leaves where they are small. */
  split(data, at, open, small = SMALL) {
    const { count, maps, chances, hull } = this.tree, { width, height } = this.window;
    const a = data[at], b = data[at + 1], c = data[at + 2], d = data[at + 3], x = data[at + 4], y = data[at + 5];
    const mass = data[at + 6], node = data[at + 7];
    for (let i = 0; i < count; i++) {
      if (chances[i] === 0) continue;
      const to = open.add(), into = open.data, m = 6 * i;
      into[to] = a * maps[m] + b * maps[m + 2];
      into[to + 1] = a * maps[m + 1] + b * maps[m + 3];
      into[to + 2] = c * maps[m] + d * maps[m + 2];
      into[to + 3] = c * maps[m + 1] + d * maps[m + 3];
      into[to + 4] = a * maps[m + 4] + (b * maps[m + 5] + x);
      into[to + 5] = c * maps[m + 4] + (d * maps[m + 5] + y);
      into[to + 6] = mass * chances[i];
      this.visited += 1;
      const where = place(into, to, hull, width, height), whole = where === 1 || into[to + 8] <= small;
      if (where >= 0) into[to + 7] = this.letters.add(i, node);
      if (where >= 0 && whole) this.leaves.copy(into, to);
      if (where < 0 || whole) open.count -= 1;
    }
  }

  /** Follow the words across the edge until none is left, or until the budget of visits is spent. */
  descend() {
    const { hull } = this.tree, { width, height } = this.window;
    let open = this.root();
    const where = place(open.data, 0, hull, width, height);
    if (where !== 0 || open.data[8] <= SMALL) {
      if (where >= 0) this.leaves = open;
      return;
    }
    while (open.count > 0 && this.visited < this.visits) {
      const next = new Words(Math.max(64, open.count));
      for (let n = 0; n < open.count; n++) this.split(open.data, n * STRIDE, next);
      open = next.count > this.most ? this.drawn(next, this.most, (at) => this.promise(next.data, at)) : next;
      if (this.leaves.count > 4 * MOST_WORDS) this.thinLeaves();
    }
    this.finished = open.count === 0;
    for (let n = 0; n < open.count; n++) this.leaves.copy(open.data, n * STRIDE);
  }

  /** What a large word is likely to give to the window: its mass, less the more it reaches beyond. */
  promise(data, at) {
    return data[at + 6] / Math.max(1, data[at + 8]) ** DIMENSION;
  }

  /** About `most` of the words, drawn by lot in proportion to `weight`, their mass raised so that the sum is kept in
   * the mean. Those that would be drawn more than once are kept as they are. */
  drawn(words, most, weight) {
    const weights = new Float64Array(words.count);
    for (let n = 0; n < words.count; n++) weights[n] = weight(n * STRIDE);
    const step = this.threshold(weights, most);
    const kept = new Words(most);
    let lot = this.random() * step;
    for (let n = 0; n < words.count; n++) {
      if (weights[n] >= step) {
        kept.copy(words.data, n * STRIDE);
      } else if ((lot -= weights[n]) < 0) {
        kept.data[kept.copy(words.data, n * STRIDE) + 6] *= step / weights[n];
        lot += step;
      }
    }
    this.sampled = true;
    return kept;
  }

  /** The weight from which on words are kept for certain, so that `most` are left. */
  threshold(weights, most) {
    const sorted = Float64Array.from(weights).sort();
    let sum = 0;
    for (const weight of sorted) sum += weight;
    let rest = most;
    for (let n = sorted.length - 1; n >= 0 && sorted[n] * rest >= sum && rest > 1; n--) {
      sum -= sorted[n];
      rest -= 1;
    }
    return sum / rest;
  }

  thinLeaves() {
    if (this.leaves.count <= MOST_WORDS) return;
    const leaves = this.leaves;
    this.leaves = this.drawn(leaves, MOST_WORDS, (at) => leaves.data[at + 6]);
  }

  /** Split heavy leaves, so that no word takes so many points that they would be the same ones again. */
  spread() {
    for (let pass = 0; pass < 64; pass++) {
      const before = this.leaves, limit = before.mass() / FEWEST_WORDS;
      this.leaves = new Words(Math.max(64, 2 * before.count));
      let heavy = 0;
      for (let n = 0; n < before.count; n++) {
        const at = n * STRIDE;
        if (before.data[at + 6] > limit && before.count < MOST_WORDS / 2) {
          heavy += 1;
          this.split(before.data, at, new Words(), Infinity);
        } else this.leaves.copy(before.data, at);
      }
      if (heavy === 0) break;
    }
  }
}

/**
 * The words that meet a window {left, top, scale, width, height}: `scale` pixels to a unit, (left, top) its upper left
 * corner. maps: rows a b c d x y from points about the hull's middle to pixels (column, row); mass: of each; total: the
 * sum; common: the letters with which every word in the view begins; heaviest: the letters of the heaviest one;
 * sampled: whether words were drawn by lot, so that another cut gives others; finished: whether the budget of `visits`
 * sufficed; folds: what each makes of a colour, keep r g b, where the tree has folds. most: words across the edge that
 * are followed at once. `random` gives numbers in [0,1).
 */
export function cut(tree, window, { random = Math.random, visits = 600_000, most = 512 } = {}) {
  const cutting = new Cutting(tree, window, random, visits, most);
  cutting.finished = true;
  cutting.descend();
  cutting.spread();
  cutting.thinLeaves();
  const { leaves, letters, sampled, finished, visited } = cutting, count = leaves.count;
  const maps = new Float64Array(6 * count), mass = new Float64Array(count);
  let heaviest = -1;
  for (let n = 0; n < count; n++) {
    maps.set(leaves.data.subarray(n * STRIDE, n * STRIDE + 6), 6 * n);
    mass[n] = leaves.data[n * STRIDE + 6];
    if (heaviest < 0 || mass[n] > mass[heaviest]) heaviest = n;
  }
  const nodes = Array.from({ length: count }, (_, n) => leaves.data[n * STRIDE + 7]);
  const folds = tree.folds && Float32Array.from(nodes.flatMap((node) => foldedWord(tree.folds, letters.spell(node))));
  return {
    count, maps, mass, total: leaves.mass(), sampled, finished, visited, folds,
    common: commonLetters(nodes, letters),
    heaviest: heaviest < 0 ? [] : letters.spell(nodes[heaviest]),
  };
}

function commonLetters(nodes, letters) {
  let common = null;
  for (const node of nodes) {
    if (common !== null && common.length === 0) break;
    const word = letters.spell(node);
    if (common === null) common = word;
    let same = 0;
    while (same < common.length && same < word.length && common[same] === word[same]) same += 1;
    common.length = same;
  }
  return common ?? [];
}
