import assert from "node:assert/strict";
import { test } from "node:test";

import { plainCode } from "../../fractal_exp/viewer/static/code.mjs";
import { hasOwn } from "../../fractal_exp/viewer/static/colours.mjs";
import { exposureOf, toneOf } from "../../fractal_exp/viewer/static/tone.mjs";

const MAPS = [[0.5, 0, 0, 0.5, 0, 0]];
const noted = (tone) => plainCode(MAPS, null, { tone });

test("a tone is read from the notes, and what is none is left out", () => {
  assert.deepEqual(toneOf(noted({ light: 0.3 })), { light: 0.3, gamma: 1, linear: false });
  assert.deepEqual(toneOf(noted({ light: 1, gamma: 20, linear: true })), { light: 1, gamma: 20, linear: true });
  assert.deepEqual(toneOf(noted({ light: 0.3, cover: 0.9 })), { light: 0.3, gamma: 1, cover: 0.9, linear: false });
  assert.deepEqual(toneOf(noted({ light: 0.3, cover: null })), { light: 0.3, gamma: 1, linear: false });
  for (const wrong of [undefined, null, 7, "bright", [], [0.3], {}, { gamma: 1 }, { light: NaN }, { light: 0 },
    { light: 1.5 }, { light: "0.3" }, { light: true }, { light: 0.3, gamma: 0 }, { light: 0.3, gamma: null },
    { light: 0.3, gamma: Infinity }, { light: 0.3, linear: 1 }, { light: 0.3, cover: 0 }, { light: 0.3, gain: 1 }]) {
    assert.equal(toneOf(noted(wrong)), null, JSON.stringify(wrong));
    assert.equal(hasOwn(noted(wrong)), false);
  }
  assert.equal(toneOf(plainCode(MAPS)), null);
  assert.equal(hasOwn(noted({ light: 0.3 })), true);
});

test("an exposure gives the light: one grey is exposed to itself, and a dense line leaves the rest visible", () => {
  const near = (a, b) => assert.ok(Math.abs(a / b - 1) < 1e-3, `${a} is not ${b}`);
  near(exposureOf([6, 6, 0, 6], 3, { light: 0.5, gamma: 1, linear: false }), Math.log(2) / 2);
  near(exposureOf([6, 6, 0, 6], 3, { light: 0.5, gamma: 1, linear: true }), 0.25);
  near(exposureOf([6, 6, 0, 6], 3, { light: 0.5, gamma: 2, linear: true }), 0.125);
  const view = [...Array(63).fill(2), 2e4], found = exposureOf(view, 2, { light: 0.3, gamma: 1, linear: false });
  assert.ok(1 - Math.exp(-found) > 0.2);
  assert.equal(exposureOf([0, 0], 1, { light: 0.5, gamma: 1, linear: false }), 1);
});
