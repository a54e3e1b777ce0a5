import assert from "node:assert/strict";
import { test } from "node:test";

import { readJson } from "../../fractal_exp/viewer/static/json.mjs";
import { numberOf, plain } from "../../fractal_exp/viewer/static/reading.mjs";

const ENOUGH = 100, MEASURABLE = 0.5, LONGEST = 2 ** 18; // ms, ms, characters
const STEEPEST = 4; // times as long for a character in a text of eight times the length, or 8 if time grows with its square
const START = '{"format": "fractal-exp/ifs", "version": 1, "linear": [[[0, 0], [0, 0]]], "offset": [[0, 0]';
const number = (text) => numberOf(text, "a");
const READERS = {
  "digits and x": (size) => number(`${"1".repeat(size)}x`), "digits": (size) => number("1".repeat(size)),
  "digits, e, x": (size) => number(`${"1".repeat(size)}e+x`), "zeros": (size) => number(`0.${"0".repeat(size)}1`),
  "a name of spaces": (size) => plain(" ".repeat(size)), "a name of words": (size) => plain("a ".repeat(size / 2)),
  "spaces": (size) => readJson(`${" ".repeat(size)}x`), "lists": (size) => readJson(`[[${"[],".repeat(size / 3)}0]]`),
  "keys": (size) => readJson(`{${Array.from({ length: size / 8 }, (_, i) => `"${i}": 0`).join(",")}}`),
  "offsets": (size) => readJson(`${START}${",[0,0]".repeat(size / 6)}]}`),
  "chances": (size) => readJson(`${START}], "probabilities": [${"0,".repeat(size / 2)}1]}`),
  "colours": (size) => readJson(`${START}], "colours": {"rgb": [[0,0,0]], "blends": [${"0,".repeat(size / 2)}1]}}`),
};

/** The processor's time for one reading, in ms. */
function milliseconds(read, size) {
  const started = process.cpuUsage();
  try {
    read(size);
  } catch (error) {
    assert.equal(error.constructor.name, "Refused", error.stack);
  }
  const { user, system } = process.cpuUsage(started);
  return (user + system) / 1000;
}

for (const [kind, read] of Object.entries(READERS)) {
  test(`the time to read ${kind} grows with their length and no faster`, () => {
    const times = [];
    for (let size = 2 ** 8; size <= LONGEST && (times.at(-1) ?? 0) < ENOUGH; size *= 2) {
      times.push(Math.min(...[1, 2, 3].map(() => milliseconds(read, size))));
    }
    const before = Math.max(times.at(-4), MEASURABLE); // of a text of an eighth of the length
    assert.ok(times.at(-1) / before < 8 * STEEPEST, `${times.join(", ")} ms for texts that double`);
  });
}

test("what is deep in a text that is refused is not repeated", () => {
  const deep = `${"[".repeat(50_000)}${"]".repeat(50_000)}`;
  for (const text of [`{"format": ${deep}}`, `{"format": "fractal-exp/ifs", "version": ${deep}}`, `[[{"a": ${deep}}]]`]) {
    assert.throws(() => readJson(text), (error) => error.constructor.name === "Refused" && error.message.length < 200);
  }
});
