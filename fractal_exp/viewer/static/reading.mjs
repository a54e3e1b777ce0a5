// Text and numbers from anywhere, taken with care. What they refuse, they refuse by name.

import { Refused } from "./code.mjs";

const NUMBER = /^[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?$/;

/** A note on one line without control characters, cut to `most` characters; empty if it is no text. */
export function plain(text, most = 200) {
  const words = typeof text === "string" ? text.split(/\s+/).filter(Boolean).join(" ") : "";
  return [...words.replace(/[\p{C}\p{Zl}\p{Zp}]/gu, "").slice(0, 2 * most)].slice(0, most).join("");
}

/** A finite number in decimal notation. Throws Refused that names it as `what`. */
export function numberOf(text, what) {
  if (!NUMBER.test(text)) throw new Refused(`${what} must be a number, got '${plain(text, 40)}'`);
  const value = Number(text);
  if (!Number.isFinite(value)) throw new Refused(`${what} must be a finite number, got '${plain(text, 40)}'`);
  return value;
}
