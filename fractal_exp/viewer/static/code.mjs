// A code as the page reads it: maps and their chances, to the last digit those of the Python package.

import { LEAST_SHRINKING, contractionOf, largestSingularValue } from "./contraction.mjs";

export const PROBABILITY_FLOOR = 0.01; // p_i is proportional to |det M_i| + floor where a code has none of its own
export const MOST_MAPS = 1000; // of a code that is shown

/** What a person can mend: its message says what was expected, what was got and the remedy. */
export class Refused extends Error {}

const kept = (number) => Math.fround(number) + 0; // which makes 0 of -0, as a file has it

/**
 * A code in plain form: {rows, probabilities, meta, colours}. rows: a b c d e f of x' = a x + b y + e, y' = c x + d y +
 * f; probabilities: as many, or null; colours: {rgb, blends}, [r, g, b] and a number of each map in [0,1], or null. All
 * are rounded to float32, in which the package keeps a code. Throws Refused on numbers that are not finite, on maps
 * that do not even contract on average, and on probabilities or colours that are none.
 */
export function plainCode(rows, probabilities = null, meta = {}, colours = null) {
  checkCount(rows.length);
  const rounded = rows.map((row) => row.map(kept));
  const chances = probabilities && probabilities.map(kept);
  rounded.forEach((row, i) => {
    if (row.every(Number.isFinite)) return;
    throw new Refused(`map ${i + 1} has a number that is not finite, or larger than float32 can hold; correct it`);
  });
  if (chances) checkProbabilities(chances, rows.length);
  checkContractive(rounded, chancesOf(rounded, chances));
  return { rows: rounded, probabilities: chances, meta, colours: colours && plainColours(colours, rows.length) };
}

/** Throws Refused unless maps contract in a norm or on average. */
function checkContractive(rows, chances) {
  const { kind, exponent } = contractionOf(rows, chances);
  if (kind !== "neither") return;
  const sizes = rows.map((row, i) => (chances[i] > 0 ? largestSingularValue(row) : 0)), largest = Math.max(...sizes);
  throw new Refused("the maps must be contractive, at least on average: their Lyapunov exponent must be below "
    + `${-LEAST_SHRINKING} and is ${Number(exponent.toPrecision(3))}, since map ${sizes.indexOf(largest) + 1} has `
    + `singular value ${Number(largest.toPrecision(6))}; shrink its matrix or drop the map`);
}

function plainColours({ rgb, blends }, count) {
  if (rgb.length !== count || blends.length !== count) {
    throw new Refused(`the code has ${count} maps, colours of ${rgb.length} and ${blends.length} blends; give each map `
      + "one, or leave colours out");
  }
  const rounded = { rgb: rgb.map((colour) => colour.map(kept)), blends: blends.map(kept) };
  for (const [name, numbers] of Object.entries(rounded)) {
    if (numbers.flat().every((number) => number >= 0 && number <= 1)) continue;
    throw new Refused(`${name} must lie in [0, 1]`);
  }
  if (!rounded.blends.some((blend) => blend > 0)) throw new Refused("at least one blend must be above 0");
  return rounded;
}

/** Throws Refused unless a page shows a code of so many maps. */
export function checkCount(maps) {
  if (maps < 1) throw new Refused("the code has no map");
  if (maps > MOST_MAPS) throw new Refused(`a page shows a code of at most ${MOST_MAPS} maps, got ${maps}`);
}

function checkProbabilities(chances, count) {
  if (chances.length !== count) throw new Refused(`${count} maps need ${count} probabilities, got ${chances.length}`);
  if (!chances.every(Number.isFinite)) throw new Refused("probabilities must be finite numbers");
  const least = Math.min(...chances), sum = total(chances);
  if (least < 0) throw new Refused(`probabilities must not be negative, got ${least}`);
  if (!(Math.abs(sum - 1) <= 1e-3)) {
    throw new Refused(`probabilities must sum to 1, got ${Number(sum.toPrecision(6))}; divide them by their sum`);
  }
}

/** A code made ready for drawing, {count, maps, chances, contraction, plain}: maps is one array of all rows, plain the
 * code. */
export function ready(plain) {
  const { rows, probabilities } = plain, chances = chancesOf(rows, probabilities);
  const maps = Float64Array.from(rows.flat());
  return { count: rows.length, maps, chances, contraction: contractionOf(rows, chances), plain };
}

/** The code of the package's JSON, ready for drawing. Throws Refused on one that cannot be drawn. */
export function readCode({ linear, offset, probabilities }) {
  return ready(plainCode(linear.map((matrix, i) => [...matrix.flat(), ...offset[i]]), probabilities));
}

/** The code that a page holds: float32 numbers of its rows, and of its probabilities and colours or null, in base 64.
 */
export function unpacked({ rows, probabilities, colours, meta }) {
  const numbers = floats(rows);
  const list = Array.from({ length: numbers.length / 6 }, (_, i) => [...numbers.subarray(6 * i, 6 * i + 6)]);
  return plainCode(list, probabilities && [...floats(probabilities)], meta, colours && unpackedColours(colours));
}

function unpackedColours({ rgb, blends }) {
  const numbers = [...floats(rgb)];
  return { rgb: list3(numbers), blends: [...floats(blends)] };
}

function list3(numbers) {
  return Array.from({ length: numbers.length / 3 }, (_, i) => numbers.slice(3 * i, 3 * i + 3));
}

function floats(text) {
  return new Float32Array(Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer);
}

/** The probabilities of the chaos game, whose sum is 1. */
export function chancesOf(rows, probabilities) {
  const chances = probabilities ?? rows.map(([a, b, c, d]) => Math.abs(a * d - b * c) + PROBABILITY_FLOOR);
  const sum = total(chances);
  return Float64Array.from(chances, (chance) => chance / sum);
}

export function total(numbers) {
  return numbers.reduce((sum, number) => sum + number, 0);
}
