// Changes of a code, each a new value, and the way back through them. A code is in plain form: {rows, probabilities,
// meta, colours}, as code.mjs has it. Where it has no probabilities of its own, every change leaves it without.

import { chancesOf, total } from "./code.mjs";
import { exponentOf, largestSingularValue } from "./contraction.mjs";

const MOST_STRETCH = 0.999; // up to which a map may be stretched by hand, or all of them in the mean
const MOST_STEPS = 500; // that are kept to be undone

/** The steps of an editing; `state` is the present one. */
export class Steps {
  constructor(state) {
    this.past = [];
    this.future = [];
    this.state = state;
    this.label = null;
  }

  /** Go to a new state. Steps of one label in a row are undone at once; a step without a label stands alone. */
  push(state, label = null) {
    if (label === null || label !== this.label) this.past.push(this.state);
    if (this.past.length > MOST_STEPS) this.past.shift();
    this.future = [];
    this.state = state;
    this.label = label;
  }

  /** Let the next step stand alone, whatever its label. */
  rest() {
    this.label = null;
  }

  undo() {
    this.swap(this.past, this.future);
  }

  redo() {
    this.swap(this.future, this.past);
  }

  swap(from, to) {
    this.label = null;
    if (!from.length) return;
    to.push(this.state);
    this.state = from.pop();
  }
}

/** The code with another row in place of map i, in float32. */
export function withRow(code, i, row) {
  return { ...code, rows: code.rows.with(i, row.map(Math.fround)) };
}

/** The code in which map i has the probability p in [0,1], and the others what is left, in proportion. */
export function withChance(code, i, p) {
  const chances = [...chancesOf(code.rows, code.probabilities)], rest = 1 - chances[i];
  const share = (chance) => (rest > 0 ? (chance * (1 - p)) / rest : (1 - p) / (chances.length - 1));
  return { ...code, probabilities: chances.map((chance, k) => Math.fround(k === i ? p : share(chance))) };
}

/** The code with the probabilities that it has in the chaos game as its own. */
export function withOwnChances(code) {
  return { ...code, probabilities: [...chancesOf(code.rows, code.probabilities)].map(Math.fround) };
}

/** The code without probabilities of its own. */
export function withoutChances(code) {
  return { ...code, probabilities: null };
}

/** The code with one map more after map i; of given probabilities it gets the share `part`, by default the mean one,
 * and of given colours those of map i. */
export function withAdded(code, i, row, part = 1 / code.rows.length) {
  const chances = code.probabilities && scaled(code.probabilities.toSpliced(i + 1, 0, part));
  const rows = code.rows.toSpliced(i + 1, 0, row.map(Math.fround));
  const colours = splicedColours(code, (list) => list.toSpliced(i + 1, 0, list[i]));
  return { ...code, rows, probabilities: chances, colours };
}

/** Colours after a change of the lists of them, so that each map keeps its own; null where no map gives one. */
function splicedColours({ colours = null }, change) {
  const blends = colours && change(colours.blends);
  return blends?.some((blend) => blend > 0) ? { rgb: change(colours.rgb), blends } : null;
}

/** The code without map i, which must not be the only one. */
export function withoutMap(code, i) {
  const chances = code.probabilities && scaled(code.probabilities.toSpliced(i, 1));
  const colours = splicedColours(code, (list) => list.toSpliced(i, 1));
  return { ...code, rows: code.rows.toSpliced(i, 1), probabilities: chances, colours };
}

/** Numbers divided by their sum; equal ones where that is 0. */
function scaled(numbers) {
  const sum = total(numbers);
  return numbers.map((number) => Math.fround(sum > 0 ? number / sum : 1 / numbers.length));
}

/** A row whose map sends `at` where it did, with another matrix [a, b, c, d]. */
export function about(row, at, [a, b, c, d]) {
  const [p, q, r, s, e, f] = row;
  return [a, b, c, d, e + (p - a) * at.x + (q - b) * at.y, f + (r - c) * at.x + (s - d) * at.y];
}

/** A row that is flipped about the point `at`: its first side turned round, or its second. */
export function flipped(row, at, second = false) {
  const [a, b, c, d] = row;
  return about(row, at, second ? [a, -b, c, -d] : [-a, b, -c, d]);
}

/**
 * The share of a change, in [0,1], up to which the maps contract on average. make(share) gives the code; make(0) is the
 * one before, which may contract less than MOST_STRETCH asks, but must not contract less still.
 */
export function shareThatContracts(make) {
  const stretch = ({ rows, probabilities }) => {
    const chances = chancesOf(rows, probabilities), chosen = rows.filter((_, i) => chances[i] !== 0); // or NaN
    if (chosen.every((row) => largestSingularValue(row) <= MOST_STRETCH)) return 0;
    return Math.exp(exponentOf(chosen, chances.filter((chance) => chance !== 0)));
  };
  const most = Math.max(MOST_STRETCH, stretch(make(0)));
  const contracts = (share) => stretch(make(share)) <= most;
  if (contracts(1)) return 1;
  let low = 0, high = 1;
  for (let step = 0; step < 30; step++) {
    const share = (low + high) / 2;
    if (contracts(share)) low = share;
    else high = share;
  }
  return low;
}
