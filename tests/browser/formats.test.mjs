import assert from "node:assert/strict";
import { test } from "node:test";

import { Refused, plainCode } from "../../fractal_exp/viewer/static/code.mjs";
import { cornersOf, writePly } from "../../fractal_exp/viewer/static/drawings.mjs";
import { LARGEST, WRITERS, entriesOf, textOf } from "../../fractal_exp/viewer/static/formats.mjs";
import { shortest } from "../../fractal_exp/viewer/static/json.mjs";
import { randomNumbers } from "../../fractal_exp/viewer/static/random.mjs";

const NASTY = "</svg><script>alert(\"1\")</script>\u0000 & '";
const code = plainCode([[0.5, 0, 0, 0.5, 0, 0], [0.5, 0, 0, 0.5, 0.5, 0.25]], null, { name: NASTY, title: NASTY });
const box = { x: 0.5, y: 0.25, hx: 0.5, hy: 0.25 };

test("a text goes to the reader of its name's end, or else to that which its beginning tells", () => {
  const rows = "[[0.5, 0, 0, 0.5, 0, 0]]", entry = "a { .5 0 0 .5 0 0 }";
  const flame = '<flame name="b"><xform weight="1" linear="1" coefs=".5 0 0 .5 0 0"/></flame>';
  assert.deepEqual([rows, entry, flame].map((text) => entriesOf(text)[0].name), [null, "a", "b"]);
  assert.equal(entriesOf(`\ufeff \n${flame}`)[0].name, "b");
  assert.deepEqual(entriesOf(rows, "x.JSON")[0].read().rows, [[0.5, 0, 0, 0.5, 0, 0]]);
  assert.throws(() => entriesOf(entry, "x.flame"), /is not XML/);
  assert.throws(() => entriesOf(rows, "x.ifs"), /holds no code/);
  assert.equal(entriesOf(entry, "notes.txt")[0].name, "a");
  assert.throws(() => entriesOf(" \n"), Refused);
});

test("what is no text, or too long, is refused before it is read", () => {
  assert.throws(() => textOf(Uint8Array.of(0x61, 0xe9, 0x62)), /is not UTF-8 text/);
  assert.throws(() => textOf(new Uint8Array(LARGEST + 1)), /at most 16777216 are read/);
  assert.throws(() => entriesOf(" ".repeat(LARGEST + 1)), /at most 16777216 are read/);
  assert.equal(textOf(new TextEncoder().encode("é")), "é");
});

test("numbers are written as the shortest that read back", () => {
  for (const number of [0.1, 0.85, -1 / 3, 1e-30, 3.4e38, 16777217, 0, -0.04].map(Math.fround)) {
    assert.equal(Math.fround(Number(shortest(number))), number);
  }
  assert.deepEqual([0.85, -0.04, 100, 1 / 3].map((number) => shortest(Math.fround(number))),
    ["0.85", "-0.04", "100", "0.33333334"]);
});

test("a drawing holds a parallelogram for each map over the picture, and names as text", () => {
  const view = { x: 0.5, y: 0.25, zoom: 2 };
  const scene = { view, width: 300, height: 200, box, namespace: "n", picture: () => "data:x" };
  const text = WRITERS.svg.write(code, scene);
  const drawn = [...text.matchAll(/<polygon points="([^"]*)"/g)].map(([, points]) => points);
  assert.deepEqual(drawn, ["0,0 0.5,0 0.5,-0.25 0,-0.25", "0.5,-0.25 1,-0.25 1,-0.5 0.5,-0.5"]);
  assert.ok(text.includes('viewBox="-0.25 -0.75 1.5 1"') && text.includes('href="data:x"'));
  assert.ok(!text.includes("<script") && text.includes("<title>&#60;/svg&#62;&#60;script"));
  assert.deepEqual(cornersOf(code.rows[1], box)[2], [1, 0.5]);
});

test("a PLY file holds points of the attractor in the colours of the maps that led to them", () => {
  const count = 2000, bytes = writePly(code, { random: randomNumbers(1) }, count);
  const end = new TextDecoder("latin1").decode(bytes).indexOf("end_header\n") + 11;
  assert.equal(bytes.length, end + 15 * count);
  const header = new TextDecoder().decode(bytes.subarray(0, end));
  assert.match(header, /^ply\nformat binary_little_endian 1.0\ncomment [ -~]*\nelement vertex 2000\nproperty float/);
  const data = new DataView(bytes.buffer, end), colours = new Map();
  for (let k = 0; k < count; k++) {
    const [x, y] = [0, 4].map((at) => data.getFloat32(15 * k + at, true)), colour = data.getUint8(15 * k + 12);
    assert.ok(Math.abs(y - x / 2) < 1e-6 && x >= 0 && x <= 1 && data.getFloat32(15 * k + 8, true) === 0);
    colours.set(colour, [...(colours.get(colour) ?? []), x]);
  }
  const [low, high] = [...colours.values()].sort((one, other) => one[0] - other[0]);
  assert.ok(Math.max(...low) <= 0.5 && Math.min(...high) >= 0.5 && Math.abs(low.length / count - 0.5) < 0.06);
});

test("a PLY file of a code with colours holds its own, folded along the address of a point", () => {
  const colours = { rgb: [[1, 0, 0], [0, 0.5, 1]], blends: [0.5, 1] }, count = 2000;
  const bytes = writePly({ ...code, colours }, { random: randomNumbers(1) }, count);
  const data = new DataView(bytes.buffer, bytes.length - 15 * count), seen = new Set();
  for (let k = 0; k < count; k++) seen.add([12, 13, 14].map((at) => data.getUint8(15 * k + at)).join(" "));
  const runs = [1, 2, 3].map((n) => [1 - 0.5 ** n, 0.5 ** (n + 1), 0.5 ** n].map((part) => Math.round(255 * part)));
  for (const colour of [[0, 128, 255], ...runs]) assert.ok(seen.has(colour.join(" ")), colour.join(" "));
  assert.ok([...seen].every((each) => { // all mixtures lie between the two colours
    const [red, green, blue] = each.split(" ").map(Number);
    return Math.abs(red + blue - 255) <= 1 && Math.abs(2 * green - blue) <= 1;
  }));
});
