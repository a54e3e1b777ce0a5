import assert from "node:assert/strict";
import { test } from "node:test";

import { keyMove } from "../../fractal_exp/viewer/static/gestures.mjs";
import {
  MOST_ZOOM, between, fromFragment, panned, shownAddress, shownZoom, toFragment, windowOf, zoomed,
} from "../../fractal_exp/viewer/static/view.mjs";

const at = (view, column, row) => {
  const { left, top, scale } = windowOf(view, 300, 200);
  return [left + column / scale, top - row / scale];
};
const near = (a, b, tolerance) => a.forEach((value, k) => assert.ok(Math.abs(value - b[k]) <= tolerance, `${a} ${b}`));

test("the shorter side of a window reaches from -1/zoom to 1/zoom about the middle, y upwards", () => {
  assert.deepEqual(windowOf({ x: 1, y: 2, zoom: 4 }, 300, 200), { left: 0.625, top: 2.25, scale: 400, width: 300, height: 200 });
});

test("zooming step by step to a billion leaves the point under the pointer where it is", () => {
  let view = { x: 0.1, y: -0.2, zoom: 1 };
  const point = at(view, 210, 40);
  while (view.zoom < 1e9) view = zoomed(view, 1.3, 210, 40, 300, 200, 0.1);
  near(at(view, 210, 40), point, 1e-3 / view.zoom);
});

test("the zoom stays between its bounds", () => {
  assert.equal(zoomed({ x: 0, y: 0, zoom: 1e11 }, 1e6, 0, 0, 300, 200, 1).zoom, MOST_ZOOM);
  assert.equal(zoomed({ x: 0, y: 0, zoom: 2 }, 1e-6, 0, 0, 300, 200, 0.5).zoom, 0.5);
});

test("dragging moves the picture with the hand, at any depth", () => {
  for (const zoom of [1, 1e9]) {
    const view = { x: 0.3, y: 0.4, zoom };
    near(at(panned(view, 30, -20, 300, 200), 130, 80), at(view, 100, 100), 1e-6 / zoom);
  }
});

test("a glide ends where it is to end, and keeps the point in its place that both views show there", () => {
  const from = { x: 0.5, y: 0.5, zoom: 1 }, to = zoomed(from, 8, 210, 40, 300, 200, 0.1);
  assert.equal(between(from, to, 1), to);
  near(at(between(from, to, 0.4), 210, 40), at(from, 210, 40), 1e-12);
  near(Object.values(between(from, { ...from, x: 0.7 }, 0.5)), [0.6, 0.5, 1], 1e-12);
});

test("a link keeps a view to the last digit, and what is no view is none", () => {
  const view = { x: 0.1234567890123456, y: -1e-9, zoom: 123456789.125 };
  assert.deepEqual(fromFragment(toFragment(view), 1e-3), view);
  for (const text of ["", "#", "#x=1&y=2", "#x=1&y=2&zoom=0", "#x=1&y=2&zoom=-3", "#x=1&y=2&zoom=", "#x=NaN&y=0&zoom=1",
    "#x=1e99&y=0&zoom=1", "#<script>"]) assert.equal(fromFragment(text, 1e-3), null, text);
  assert.equal(fromFragment("#x=0&y=0&zoom=1e30", 1e-3).zoom, MOST_ZOOM);
});

test("a zoom and an address are short", () => {
  assert.deepEqual([1, 0.25, 64, 12345.6, 3.14159, 2.5e6, 1e9].map(shownZoom),
    ["1", "0.25", "64", "12\u202f346", "3.14", "2.5 million", "1 billion"]);
  assert.equal(shownAddress([1, 1, 1, 1, 0, 2, 2]), "2⁴ 1 3 3");
  assert.equal(shownAddress(Array(12).fill(9)), "10¹²");
  assert.equal(shownAddress([]), "");
});

test("keys have their moves, and those of the browser stay with it", () => {
  const done = [];
  const moves = { zoom: (factor) => done.push(["zoom", factor > 1]), pan: (x, y) => done.push(["pan", x, y]),
    home: () => done.push(["home"]) };
  for (const key of ["+", "-", "ArrowLeft", "0", "Home"]) keyMove({ key })(moves, 100, 200);
  assert.deepEqual(done, [["zoom", true], ["zoom", false], ["pan", 12, 0], ["home"], ["home"]]);
  assert.equal(keyMove({ key: "c", ctrlKey: true }), undefined);
  assert.equal(keyMove({ key: "Tab" }), undefined);
  assert.equal(keyMove({ key: "constructor" }), undefined);
});
