import assert from "node:assert/strict";
import { test } from "node:test";

import { readCode } from "../../fractal_exp/viewer/static/code.mjs";
import { canvasByHand, throwByHand } from "../../fractal_exp/viewer/static/hand.mjs";
import { DRAW, POOL, Pool, shareInView } from "../../fractal_exp/viewer/static/points.mjs";
import { randomNumbers } from "../../fractal_exp/viewer/static/random.mjs";
import { windowOf } from "../../fractal_exp/viewer/static/view.mjs";
import { MOST_WORDS, addressTree, cut } from "../../fractal_exp/viewer/static/words.mjs";
import { FERN, OVERLAPPING, SQUARE, deepPoint, pointsOf } from "./codes.mjs";

const tree = (data) => addressTree(readCode(data));
const cutAt = (data, view, seed = 1, size = 256) => cut(tree(data), windowOf(view, size, size),
  { random: randomNumbers(seed) });

test("the mass of the words in a view is the measure of the view, where every word lies in it or beside it", () => {
  const words = cutAt(SQUARE, { x: 0.25, y: 0.25, zoom: 4 }); // the lower left quarter
  const share = shareInView(words, new Pool(tree(SQUARE)), randomNumbers(2), 256, 256);
  assert.ok(Math.abs(words.total * share - 0.25) < 0.005, `${words.total * share}`);
  assert.ok(share > 0.8 && words.count <= MOST_WORDS && words.finished && !words.sampled);
});

test("at a billion times the words are still those of the chaos game: the mass is a power of the map's chance", () => {
  // About the corner (0, 0) of the square a view of side 2^-30 has the measure 4^-30.
  const half = 2 ** -31, words = cutAt(SQUARE, { x: half, y: half, zoom: 1 / half });
  const share = shareInView(words, new Pool(tree(SQUARE)), randomNumbers(2), 256, 256);
  assert.ok(Math.abs((words.total * share) / 4 ** -30 - 1) < 0.02);
  assert.deepEqual([...new Set(words.heaviest.slice(0, 30))], [0]);
});

test("words drawn by lot keep the measure in the mean", () => {
  const code = readCode(OVERLAPPING), [x, y] = deepPoint(code), view = { x, y, zoom: 64 };
  const made = addressTree(code), pool = new Pool(made);
  const measure = (seed, most) => {
    const words = cut(made, windowOf(view, 256, 256), { random: randomNumbers(seed), most, visits: 1e7 });
    assert.ok(words.sampled && words.finished && words.count <= MOST_WORDS);
    return words.total * shareInView(words, pool, randomNumbers(seed), 256, 256);
  };
  const all = measure(1, 1e7);
  const mean = Array.from({ length: 16 }, (_, k) => measure(k, 512)).reduce((a, b) => a + b) / 16;
  assert.ok(Math.abs(mean / all - 1) < 0.06, `${mean} ${all}`);
  const thrown = pointsOf(code, 1_000_000).filter(([u, v]) => Math.max(Math.abs(u - x), Math.abs(v - y)) < 1 / 64);
  assert.ok(Math.abs(thrown.length - 1_000_000 * all) < 4 * Math.sqrt(thrown.length), `${thrown.length} ${all}`);
});

test("a view beside the attractor has no words, and one of all of it begins with no letter", () => {
  assert.equal(cutAt(FERN, { x: 50, y: 50, zoom: 1 }).count, 0);
  const whole = cutAt(FERN, { x: 0, y: 5, zoom: 0.1 });
  assert.deepEqual(whole.common, []);
  assert.ok(whole.count >= 512 && Math.abs(whole.total - 1) < 1e-9);
});

test("a view within one word's image begins with its letters", () => {
  const words = cutAt(SQUARE, { x: 0.8, y: 0.1, zoom: 50 }); // 0.8 = .11001…, 0.1 = .00011… in binary
  assert.deepEqual(words.common.slice(0, 3), [1, 1, 0]);
});

test("the pool is of the invariant measure, and all of it is renewed part by part", () => {
  const code = readCode(FERN), made = addressTree(code), pool = new Pool(made);
  const mean = (axis) => pool.points.subarray(0, 2 * POOL).reduce((sum, v, k) => sum + (k % 2 === axis ? v : 0), 0) / POOL;
  const points = pointsOf(code, 400_000);
  const expected = [0, 1].map((axis) => points.reduce((sum, point) => sum + point[axis], 0) / points.length);
  assert.ok(Math.abs(mean(0) + made.hull.x - expected[0]) < 0.02 && Math.abs(mean(1) + made.hull.y - expected[1]) < 0.03);
  const before = Float32Array.from(pool.points);
  for (let part = 0; part < 16; part++) pool.renew();
  const kept = before.filter((value, k) => k % 2 === 0 && value === pool.points[k]).length;
  assert.ok(kept < POOL / 50, `${kept}`);
  assert.deepEqual(pool.points.subarray(2 * POOL), pool.points.subarray(0, 2 * DRAW));
});

test("points thrown by hand light the subpixel that they fall into, once", () => {
  const words = { maps: Float64Array.from([1, 0, 0, 1, 2, 1]) };
  const target = { width: 4, height: 3, supersample: 2, byHand: canvasByHand(4, 3, 2) };
  const points = new Float32Array(2 * DRAW).fill(99);
  points.set([0.1, 0.1, 0.2, 0.2, 0.6, 0.1, -3, 0]);
  throwByHand(target, words, new Uint16Array(DRAW), { points }, [0]);
  assert.deepEqual([...target.byHand.counts], [0, 0, 0, 0, 0, 0, 2, 0, 0, 0, 0, 0]);
  assert.deepEqual([...target.byHand.subpixels.subarray(24, 28)], [1, 1, 0, 0]);
});
