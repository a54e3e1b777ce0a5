import assert from "node:assert/strict";
import { test } from "node:test";

import { readCode } from "../../fractal_exp/viewer/static/code.mjs";
import { boundingRectangle, supportFunction } from "../../fractal_exp/viewer/static/hull.mjs";
import { FERN, SQUARE, pointsOf } from "./codes.mjs";

test("numbers are rounded to float32, in which the package keeps them", () => {
  const { maps, chances, count } = readCode(FERN);
  assert.equal(count, 4);
  assert.deepEqual([...maps.slice(6, 12)], [0.85, 0.04, -0.04, 0.85, 0, 1.6].map(Math.fround));
  assert.ok(Math.abs(chances.reduce((a, b) => a + b) - 1) < 1e-15);
});

test("chances without any are those of |det| + 0.01", () => {
  const { chances } = readCode({ ...FERN, probabilities: null });
  const weights = [0.01, 0.7241 + 0.01, 0.1038 + 0.01, 0.1088 + 0.01];
  const sum = weights.reduce((a, b) => a + b);
  weights.forEach((weight, i) => assert.ok(Math.abs(chances[i] - weight / sum) < 1e-6));
});

test("a code that does not contract, or that holds no numbers, is refused by the map's number", () => {
  const wild = { ...SQUARE, linear: [...SQUARE.linear.slice(0, 3), [[11, 0], [0, 0.5]]] };
  assert.throws(() => readCode(wild), /must be contractive.* and is 2.01, since map 4 has singular value 11;/);
  assert.throws(() => readCode({ ...SQUARE, linear: SQUARE.linear.map(() => [[NaN, 0], [0, 0]]) }), /map 1/);
});

test("the half planes are those of the unit square, and the rectangle is the square", () => {
  const h = supportFunction(readCode(SQUARE));
  assert.ok(Math.abs(h[0] - 1) < 1e-6 && Math.abs(h[64] - 1) < 1e-6 && Math.abs(h[128]) < 1e-6);
  const { x, y, p, q } = boundingRectangle(readCode(SQUARE));
  assert.ok(Math.abs(x - 0.5) < 1e-6 && Math.abs(y - 0.5) < 1e-6);
  assert.ok(Math.abs(Math.hypot(...p) - 0.5) < 1e-6 && Math.abs(Math.hypot(...q) - 0.5) < 1e-6);
});

test("every point of the fern lies in the rectangle", () => {
  const { x, y, p, q } = boundingRectangle(readCode(FERN));
  const outside = pointsOf(readCode(FERN), 20_000).filter(([u, v]) => [p, q].some(([a, b]) => {
    return Math.abs((u - x) * a + (v - y) * b) > a * a + b * b;
  }));
  assert.equal(outside.length, 0);
});
