// Text and numbers from anywhere, taken with care. What they refuse, they refuse by name.

import { Refused } from "./code.mjs";

const NUMBER = /^[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?$/; // one way to read each text, so no time grows with its square

const LOOKED_AT = 10; // times the characters of a note that are kept

/** A note on one line without control characters, cut to `most` characters; empty if it is no text. */
export function plain(text, most = 200) {
  const words = typeof text === "string" ? text.slice(0, LOOKED_AT * most).split(/\s+/).filter(Boolean).join(" ") : "";
  return [...words.replace(/[\p{C}\p{Zl}\p{Zp}]/gu, "").slice(0, 2 * most)].slice(0, most).join("");
}

/** A value of JSON in a few words, whatever is in it. */
export function brief(value) {
  if (value === undefined) return "none";
  if (Array.isArray(value)) return "a list";
  return value !== null && typeof value === "object" ? "an object" : `'${plain(JSON.stringify(value), 40)}'`;
}

/** A finite number in decimal notation. Throws Refused that names it as `what`. */
export function numberOf(text, what) {
  if (!NUMBER.test(text)) throw new Refused(`${what} must be a number, got '${plain(text, 40)}'`);
  const value = Number(text);
  if (!Number.isFinite(value)) throw new Refused(`${what} must be a finite number, got '${plain(text, 40)}'`);
  return value;
}
