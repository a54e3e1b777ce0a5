// What readers of files share: text and numbers from anywhere, taken with care. What they refuse, they refuse by name.

import { Refused, checkCount, plainCode, total } from "./code.mjs";

const NORMALISED = 1e-3; // weights whose sum is nearer to 1 stay as they are
const NUMBER = /^[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?$/;
const WHITE = /[\t-\r\x1c-\x20\x85\xa0\u1680\u2000-\u200a\u2028\u2029\u202f\u205f\u3000]+/;

/** The words of a text, between white space of any kind. */
export function wordsOf(text) {
  return text.split(WHITE).filter(Boolean);
}

/** A note on one line without control characters, cut to `most` characters; empty if it is no text. */
export function plain(text, most = 200) {
  const words = typeof text === "string" ? wordsOf(text).join(" ") : "";
  return [...words.replace(/[\p{C}\p{Zl}\p{Zp}]/gu, "").slice(0, 2 * most)].slice(0, most).join("");
}

/** A finite number in decimal notation. Throws Refused that names it as `what`. */
export function numberOf(text, what) {
  if (!NUMBER.test(text)) throw new Refused(`${what} must be a number, got '${plain(text, 40)}'`);
  const value = Number(text);
  if (!Number.isFinite(value)) throw new Refused(`${what} must be a finite number, got '${plain(text, 40)}'`);
  return value;
}

/** `count` finite numbers between spaces. Throws Refused that names them as `what`. */
export function numbersOf(text, count, what) {
  const words = wordsOf(text);
  if (words.length !== count) throw new Refused(`${what} must be ${count} numbers, got '${plain(text, 40)}'`);
  return words.map((word) => numberOf(word, what));
}

/** The code of rows and of weights, which are divided by their sum unless that is 1. Throws Refused. */
export function weighted(rows, weights, meta) {
  checkCount(rows.length);
  if (!weights) return plainCode(rows, null, meta);
  const sum = total(weights);
  if (weights.some((weight) => weight < 0) || !(sum > 0 && sum < Infinity)) {
    throw new Refused("the maps' weights must be at least 0, not all 0 and not huge; correct them, or leave them all "
      + "out");
  }
  return plainCode(rows, Math.abs(sum - 1) <= NORMALISED ? weights : weights.map((weight) => weight / sum), meta);
}

/** Run `read`, and let what it refuses begin with `name`. */
export function named(name, read) {
  try {
    return read();
  } catch (error) {
    throw error instanceof Refused ? new Refused(`${name}: ${error.message}`) : error;
  }
}
