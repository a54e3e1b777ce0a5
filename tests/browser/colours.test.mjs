import assert from "node:assert/strict";
import { test } from "node:test";

import { Refused, plainCode, ready } from "../../fractal_exp/viewer/static/code.mjs";
import {
  PALETTES, PLAIN, STOPS, foldedWord, foldsOf, fromLink, rgbOf, toLink, whiteOf,
} from "../../fractal_exp/viewer/static/colours.mjs";
import { withAdded, withoutMap } from "../../fractal_exp/viewer/static/editing.mjs";
import { canvasByHand, colouredByHand, throwByHand } from "../../fractal_exp/viewer/static/hand.mjs";
import { readJson, writeJson } from "../../fractal_exp/viewer/static/json.mjs";
import { DRAW, POOL, Pool, shareOut } from "../../fractal_exp/viewer/static/points.mjs";
import { randomNumbers } from "../../fractal_exp/viewer/static/random.mjs";
import { windowOf } from "../../fractal_exp/viewer/static/view.mjs";
import { addressTree, cut } from "../../fractal_exp/viewer/static/words.mjs";

const HALVES = [[0.5, 0, 0, 0.5, -0.5, -0.5], [0.5, 0, 0, 0.5, 0.5, -0.5], [0.5, 0, 0, 0.5, 0, 0.5]];
const COLOURS = { rgb: [[1, 0, 0], [0, 1, 0], [0.25, 0.5, 1]], blends: [0.5, 1, 0.25] };
const code = plainCode(HALVES, null, {}, COLOURS);
const canvasOf = (kind, size) => ({
  kind, width: size, height: size, supersample: 1, byHand: canvasByHand(size, size, 1, kind),
});
const near = (a, b, by = 1e-6) => a.every((part, i) => Math.abs(part - b[i]) < by);

test("a word folds colours like its maps, one after the other, the innermost first", () => {
  const folds = foldsOf(code, { by: "own" }), word = [2, 0, 0, 2, 1];
  let colour = [0.3, 0.6, 0.9];
  for (const i of word.toReversed()) {
    colour = colour.map((part, c) => (1 - COLOURS.blends[i]) * part + COLOURS.blends[i] * COLOURS.rgb[i][c]);
  }
  const [keep, ...gift] = foldedWord(folds, word);
  assert.ok(near(gift.map((part, c) => keep * [0.3, 0.6, 0.9][c] + part), colour));
});

test("by map the last map decides, by address all do, and plain and density need no colour", () => {
  const byMap = foldsOf(code, { by: "map", palette: "fire" });
  assert.deepEqual([...byMap.keep], [0, 0, 0]);
  assert.ok(near([...byMap.gift.slice(0, 3)], rgbOf(PALETTES.fire[0])));
  assert.ok(near([...byMap.gift.slice(6)], rgbOf(PALETTES.fire[STOPS - 1])));
  assert.deepEqual([...foldsOf(code, { by: "address", palette: "fire" }).keep], [0.5, 0.5, 0.5]);
  for (const by of ["plain", "density", "nonsense"]) assert.equal(foldsOf(code, { by, palette: "sea" }), null);
  assert.equal(foldsOf(plainCode(HALVES), { by: "own" }), null);
});

test("points thrown by hand have the mean colour of the chaos game in every pixel", () => {
  const tree = addressTree(ready(code), foldsOf(code, { by: "own" })), pool = new Pool(tree), size = 4;
  const words = cut(tree, windowOf({ x: 0, y: 0, zoom: 1 }, size, size), { random: randomNumbers(3) });
  const target = canvasOf("colour", size);
  const slots = shareOut(words, randomNumbers(4));
  throwByHand(target, words, slots, pool, [0, DRAW, 2 * DRAW]);
  const bytes = colouredByHand(target.byHand), sums = new Float64Array(4 * size * size), random = randomNumbers(5);
  let x = 0, y = 0, colour = [0.5, 0.5, 0.5];
  for (let k = -100; k < 400_000; k++) {
    const i = Math.floor(3 * random()), [a, b, c, d, e, f] = HALVES[i], blend = COLOURS.blends[i];
    [x, y] = [a * x + b * y + e, c * x + d * y + f];
    colour = colour.map((part, channel) => (1 - blend) * part + blend * COLOURS.rgb[i][channel]);
    const pixel = Math.floor(((1 - y) * size) / 2) * size + Math.floor(((1 + x) * size) / 2);
    if (k < 0) continue;
    colour.forEach((part, channel) => { sums[4 * pixel + channel] += part; });
    sums[4 * pixel + 3] += 1;
  }
  for (let pixel = 0; pixel < size * size; pixel++) {
    assert.equal(bytes[4 * pixel + 3] > 0, sums[4 * pixel + 3] > 0);
    if (sums[4 * pixel + 3] < 1000) continue;
    const mean = [0, 1, 2].map((channel) => (255 * sums[4 * pixel + channel]) / sums[4 * pixel + 3]);
    assert.ok(near(mean, bytes.subarray(4 * pixel, 4 * pixel + 3), 4), `${mean} ${bytes.subarray(4 * pixel)}`);
  }
});

test("points are counted where the density is wanted, and its end is a density that hardly a pixel exceeds", () => {
  const tree = addressTree(ready(code)), pool = new Pool(tree), size = 8;
  const words = cut(tree, windowOf({ x: 0, y: 0, zoom: 1 }, size, size), { random: randomNumbers(3) });
  const target = canvasOf("count", size);
  throwByHand(target, words, shareOut(words, randomNumbers(4)), pool, [0]);
  assert.equal(target.byHand.points.reduce((sum, count) => sum + count), DRAW);
  assert.equal(whiteOf([0, 0, 4, 4, 8], 2), 2);
  assert.equal(whiteOf([0, 0], 1), 1);
  assert.equal(pool.shades.length, 4 * (POOL + DRAW));
});

test("colours of a code are read and written bit for bit, and refused where they are wrong", () => {
  const text = writeJson(plainCode(HALVES, null, { name: "a" }, { rgb: COLOURS.rgb, blends: [1 / 3, 0.1, 1] }));
  const back = readJson(text);
  assert.deepEqual(back.colours, { rgb: COLOURS.rgb, blends: [1 / 3, 0.1, 1].map(Math.fround) });
  assert.equal(writeJson(back), text);
  assert.ok(!writeJson(plainCode(HALVES)).includes("colours"));
  const given = JSON.parse(text);
  for (const [colours, why] of [
    [[], /an object with rgb and blends/], [{ rgb: COLOURS.rgb }, /no blends/],
    [{ ...COLOURS, more: 1 }, /unknown keys/], [{ ...COLOURS, blends: [1, 1] }, /3 maps, colours of 3 and 2 blends/],
    [{ ...COLOURS, blends: [1, 1, 2] }, /in \[0, 1\]/],
    [{ ...COLOURS, blends: [0, 0, 0] }, /at least one blend/], [{ ...COLOURS, rgb: [[1, 1], [1, 1], [1, 1]] }, /shape/],
    [{ ...COLOURS, rgb: [["1", 0, 0], [0, 0, 0], [0, 0, 0]] }, /numbers only/],
  ]) {
    assert.throws(() => readJson(JSON.stringify({ ...given, colours })), (error) => (
      error instanceof Refused && why.test(error.message)), JSON.stringify(colours));
  }
});

test("a map that is added or deleted takes its colour along", () => {
  const more = withAdded(code, 1, HALVES[0]);
  assert.deepEqual(more.colours.rgb, [COLOURS.rgb[0], COLOURS.rgb[1], COLOURS.rgb[1], COLOURS.rgb[2]]);
  assert.deepEqual(withoutMap(code, 0).colours, { rgb: COLOURS.rgb.slice(1), blends: [1, 0.25] });
  assert.equal(withoutMap({ ...code, colours: { rgb: COLOURS.rgb, blends: [1, 0, 0] } }, 0).colours, null);
  assert.equal(withAdded(plainCode(HALVES), 0, HALVES[0]).colours, null);
});

test("a link keeps what was chosen, and takes no nonsense", () => {
  const chosen = { by: "density", palette: "fire", tone: 2, ground: "#aabbcc" };
  assert.deepEqual(fromLink(`#x=0&y=0&zoom=1${toLink(chosen, PLAIN)}`, PLAIN, false), chosen);
  assert.equal(toLink(PLAIN, PLAIN), "");
  assert.deepEqual(fromLink("#by=own&palette=__proto__&tone=1e9&ground=red", PLAIN, false), PLAIN);
  assert.equal(fromLink("#by=own", PLAIN, true).by, "own");
  const usual = { ...PLAIN, by: "own" }, white = { ...usual, ground: "#ffffff" };
  assert.deepEqual(fromLink(toLink({ ...white, ground: null }, usual), usual, true), usual);
  assert.deepEqual(fromLink(toLink(white, usual), usual, true), white);
});
