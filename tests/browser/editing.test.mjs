import assert from "node:assert/strict";
import { test } from "node:test";

import { chancesOf, plainCode, ready } from "../../fractal_exp/viewer/static/code.mjs";
import { exponentOf, largestSingularValue } from "../../fractal_exp/viewer/static/contraction.mjs";
import {
  Steps, about, flipped, shareThatContracts, withAdded, withChance, withOwnChances, withRow, withoutChances, withoutMap,
} from "../../fractal_exp/viewer/static/editing.mjs";
import {
  KINDS, boxAtHand, clipped, corners, dragged, endsOf, imageOf, mapAt, places,
} from "../../fractal_exp/viewer/static/handles.mjs";
import { boxOf } from "../../fractal_exp/viewer/static/hull.mjs";
import { homeOf, windowOf } from "../../fractal_exp/viewer/static/view.mjs";
import { FERN, pointsOf } from "./codes.mjs";

const fern = plainCode(FERN.linear.map((matrix, i) => [...matrix.flat(), ...FERN.offset[i]]), FERN.probabilities);
const box = { x: 0.2, y: -0.1, hx: 0.5, hy: 0.8 };
const window = windowOf({ x: 0, y: 0, zoom: 0.9 }, 600, 400);
const row = [0.4, -0.2, 0.3, 0.5, 0.1, -0.2];
const near = (a, b, tolerance = 1e-9) => {
  assert.equal(a.length, b.length);
  a.forEach((value, k) => assert.ok(Math.abs(value - b[k]) <= tolerance, `${a} is not ${b}`));
};
const sum = (numbers) => numbers.reduce((a, b) => a + b, 0);

test("steps are undone and redone, those of one label at once", () => {
  const steps = new Steps("a"), drag = {};
  steps.push("b");
  for (const state of ["c", "d", "e"]) steps.push(state, drag);
  steps.rest();
  steps.push("f", drag);
  const seen = [];
  for (let k = 0; k < 4; k++) {
    steps.undo();
    seen.push(steps.state);
  }
  assert.deepEqual(seen, ["e", "b", "a", "a"]);
  steps.redo();
  assert.equal(steps.state, "b");
  steps.push("g");
  steps.redo();
  assert.equal(steps.state, "g");
});

test("a code without probabilities stays without, whatever is done to it", () => {
  const free = withoutChances(fern);
  for (const code of [withRow(free, 0, row), withAdded(free, 1, row), withoutMap(free, 2)]) {
    assert.equal(code.probabilities, null);
    assert.ok(Math.abs(sum([...chancesOf(code.rows, null)]) - 1) < 1e-12);
  }
  near(withOwnChances(free).probabilities, [...chancesOf(free.rows, null)], 1e-7);
});

test("probabilities sum to 1 after every change, and the others keep their proportions", () => {
  const half = withChance(fern, 1, 0.5).probabilities;
  near(half, [0.01 / 0.3, 0.5, 0.07 / 0.3, 0.07 / 0.3], 1e-7);
  near(withChance(withChance(fern, 1, 1), 1, 0.4).probabilities, [0.2, 0.4, 0.2, 0.2], 1e-7);
  near(withoutMap(fern, 1).probabilities, [0.01 / 0.15, 0.07 / 0.15, 0.07 / 0.15], 1e-7);
  near(withAdded(fern, 1, row).probabilities, [0.008, 0.68, 0.2, 0.056, 0.056], 1e-7);
  near(withoutMap(withChance(fern, 1, 1), 1).probabilities, [1 / 3, 1 / 3, 1 / 3], 1e-7);
  assert.deepEqual(fern.probabilities, FERN.probabilities.map(Math.fround));
});

test("numbers are float32 after every change, as they are in a file", () => {
  assert.deepEqual(withRow(fern, 0, row).rows[0], row.map(Math.fround));
  assert.deepEqual(withAdded(fern, 3, row).rows[4], row.map(Math.fround));
});

test("a map that is stretched too far stops where it still contracts", () => {
  const alone = (make) => (share) => ({ rows: [make(share).map(Math.fround)], probabilities: null });
  const wider = (from) => (share) => about(from, box, [from[0] + 2 * share, ...from.slice(1, 4)]);
  const [kept] = alone(wider(row))(shareThatContracts(alone(wider(row)))).rows;
  assert.ok(Math.abs(exponentOf([kept], [1]) - Math.log(0.999)) < 1e-5 && largestSingularValue(kept) > 1);
  near(imageOf(kept, box, window).centre, imageOf(row, box, window).centre, 1e-4);
  assert.equal(shareThatContracts(alone(() => row)), 1);
  const slow = [0.9995, 0, 0, 0.5, 0, 0].map(Math.fround); // as it came in a file
  assert.equal(shareThatContracts(alone((share) => slow.with(4, share))), 1);
  assert.ok(shareThatContracts(alone(wider(slow))) < 1e-6);
  assert.equal(shareThatContracts(alone((share) => row.with(0, share > 0 ? NaN : row[0]))), 0);
  const others = (share) => withRow(fern, 2, wider(fern.rows[2])(share)); // a rare map, that may stretch alone
  assert.equal(shareThatContracts(others), 1);
  assert.ok(largestSingularValue(others(1).rows[2]) > 2);
});

test("to flip a map twice is to leave it, and once leaves its centre", () => {
  for (const second of [false, true]) {
    const once = flipped(row, box, second);
    near(flipped(once, box, second), row);
    near(imageOf(once, box, window).centre, imageOf(row, box, window).centre);
    assert.ok(Math.abs((once[0] * once[3] - once[1] * once[2]) + (row[0] * row[3] - row[1] * row[2])) < 1e-12);
  }
});

/** The image of the box after a handle was dragged from where it stands. */
function after(kind, by, straight = false, of = row) {
  const before = imageOf(of, box, window), place = places(before, window)[kind];
  return { before, image: imageOf(dragged(kind, of, box, place, by, window, straight), box, window), place };
}

test("each handle does what it is called, in pixels", () => {
  const moved = after("move", [30, -12]);
  near(moved.image.centre, [moved.before.centre[0] + 30, moved.before.centre[1] - 12]);
  near([...moved.image.u, ...moved.image.v], [...moved.before.u, ...moved.before.v]);
  const first = after("first", [10, 20]);
  near(first.image.u, [first.before.u[0] + 10, first.before.u[1] + 20]);
  near([...first.image.v, ...first.image.centre], [...first.before.v, ...first.before.centre]);
  const second = after("second", [-7, 4]);
  near(second.image.v, [second.before.v[0] - 7, second.before.v[1] + 4]);
  near(second.image.u, second.before.u);
  const straight = after("second", [-7, 4], true);
  assert.ok(Math.abs(straight.image.v[0] * straight.before.v[1] - straight.image.v[1] * straight.before.v[0]) < 1e-9);
});

test("scaling follows the hand along the diagonal, turning follows it round", () => {
  const { before, place } = after("scale", [0, 0]), away = place.map((part, k) => part - before.centre[k]);
  const scaled = after("scale", away.map((part) => part / 2));
  near([...scaled.image.u, ...scaled.image.v], [...before.u, ...before.v].map((part) => 1.5 * part));
  assert.ok(Math.hypot(...after("scale", away.map((part) => -3 * part)).image.u) > 0); // never to nothing
  const { place: knob } = after("turn", [0, 0]), arm = knob.map((part, k) => part - before.centre[k]);
  const quarter = [arm[1] - arm[0], -arm[0] - arm[1]]; // a quarter turn to the left on the screen
  const turned = after("turn", quarter);
  near(turned.image.u, [before.u[1], -before.u[0]]);
  near(turned.image.v, [before.v[1], -before.v[0]]);
  const little = after("turn", [arm[1] * 0.2, -arm[0] * 0.2], true).image; // 11 degrees, to the next notch
  const angle = ({ u }) => Math.atan2(-u[1], u[0]);
  assert.ok(Math.abs(angle(little) - angle(before) - Math.PI / 12) < 1e-9);
});

test("handles stand apart and in reach, for flat maps and points too", () => {
  const flat = [[0, 0, 0, 0.16, 0, 0], [0, 0, 0, 0, 0.2, 0.1], [0.3, 0.3, 0.3, 0.3, 0, 0], [0.3, 0, 0, 1e-9, 0, 0],
    [0.001, 0, 0, 0.001, 0, 0], [0.5, -0.499, 0.5, -0.5, 0, 0], row];
  for (const each of flat) {
    const stands = Object.values(places(imageOf(each, box, window), window));
    stands.forEach((one, i) => stands.slice(i + 1).forEach((other) => {
      assert.ok(Math.hypot(one[0] - other[0], one[1] - other[1]) >= 24, `${each}: ${stands}`);
    }));
    for (const kind of Object.keys(KINDS)) {
      const made = dragged(kind, each, box, places(imageOf(each, box, window), window)[kind], [9, 5], window);
      assert.ok(made.every(Number.isFinite), `${kind} ${made}`);
    }
  }
});

test("handles stand at the ends that are in the window, and follow the hand there too", () => {
  for (const [x, y] of [[0.5, 0.7], [-0.5, 0.7], [0.4, -0.5], [-0.5, -0.5]]) {
    const each = [...row.slice(0, 4), 0, 0], { centre } = imageOf(each, box, window);
    [each[4], each[5]] = [x - (centre[0] - 300) / window.scale, y - (200 - centre[1]) / window.scale];
    const before = imageOf(each, box, window), stands = places(before, window);
    const inside = Object.values(stands).filter(([p, q]) => p > 0 && p < 600 && q > 0 && q < 400);
    assert.ok(inside.length >= 4, `${x} ${y}: ${stands}`);
    for (const kind of ["first", "second"]) {
      const made = imageOf(dragged(kind, each, box, stands[kind], [6, 8], window), box, window);
      const moved = places(made, window, endsOf(before, window))[kind];
      near(moved, [stands[kind][0] + 6, stands[kind][1] + 8], 1e-6);
    }
  }
});

test("at any depth the handles are in the window, and a drag moves the map by as many pixels", () => {
  const at = pointsOf(ready(fern), 1)[0], fernBox = boxOf(fern);
  for (const zoom of [1, 100, 1e6, 1e9]) {
    const deep = windowOf({ x: at[0], y: at[1], zoom }, 600, 400);
    for (const each of fern.rows.slice(1)) {
      const held = boxAtHand(each, fernBox, deep), image = imageOf(each, held, deep);
      const stands = places(image, deep), made = dragged("move", each, held, stands.move, [25, -40], deep);
      if (zoom > 1) assert.ok(Object.values(stands).every(([x, y]) => x > 0 && x < 600 && y > 0 && y < 400));
      near(imageOf(made, held, deep).centre, [image.centre[0] + 25, image.centre[1] - 40], 1e-3);
      const turned = imageOf(dragged("turn", each, held, stands.turn, [30, 0], deep), held, deep);
      near(turned.centre, image.centre, 0.2);
      assert.ok(Math.hypot(turned.u[0] - image.u[0], turned.u[1] - image.u[1]) > 1);
    }
  }
});

test("a click takes the smallest map under it, and the next larger with the next click", () => {
  const image = (size) => ({ centre: [100, 100], u: [size, 0], v: [0, size] });
  const images = [image(80), image(20), image(50), { centre: [300, 300], u: [0, 0], v: [0, 40] }];
  assert.deepEqual([null, 1, 2, 0].map((selected) => mapAt([105, 95], images, selected)), [1, 2, 0, 1]);
  assert.equal(mapAt([160, 100], images, null), 0);
  assert.equal(mapAt([303, 330], images, null), 3);
  assert.equal(mapAt([303, 360], images, null), null);
  assert.equal(mapAt([500, 100], images, 2), null);
});

test("corners that are too far are cut off, and nothing that is seen", () => {
  const far = corners({ centre: [1e9, 50], u: [1.5e9, 0], v: [0, 1e9] }), seen = { width: 300, height: 200 };
  const cut = clipped(far, seen);
  assert.ok(cut.length >= 3 && cut.flat().every((part) => Math.abs(part) < 400));
  const within = corners({ centre: [150, 100], u: [20, 5], v: [-5, 20] });
  assert.deepEqual(clipped(within, seen), within);
  assert.deepEqual(clipped(corners({ centre: [-900, 0], u: [1, 0], v: [0, 1] }), seen), []);
});

test("the box about a code is that of its points, and frames it as the package does", () => {
  const { x, y, hx, hy } = boxOf(fern), points = pointsOf(ready(fern), 50_000);
  const xs = points.map(([u]) => u), ys = points.map(([, v]) => v);
  near([x - hx, x + hx, y - hy, y + hy], [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)], 0.1);
  assert.ok(Math.abs(homeOf({ x, y, hx, hy }).zoom - 1.5 / (2 * hy)) < 1e-12);
  assert.deepEqual(homeOf({ x: 1e-5, y: 0, hx: 0.75, hy: 0.5 }), { x: 0, y: 0, zoom: 1 });
  const point = boxOf(plainCode([[0.5, 0, 0, 0.5, 1, 2]]));
  near([point.x, point.y, homeOf(point).zoom], [2, 4, 1], 1e-6);
  const line = boxOf(plainCode([[0.5, 0, 0, 0.5, 0, 0], [0.5, 0, 0, 0.5, 0.5, 0]]));
  near([line.x, line.hx, line.hy], [0.5, 0.5, 0.075], 1e-6);
});
