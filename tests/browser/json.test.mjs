import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";

import { Refused, plainCode } from "../../fractal_exp/viewer/static/code.mjs";
import { cornersOf, writeSvg } from "../../fractal_exp/viewer/static/drawings.mjs";
import { fileName } from "../../fractal_exp/viewer/static/exchange.mjs";
import { readJson, shortest, writeJson } from "../../fractal_exp/viewer/static/json.mjs";

const NASTY = "</svg><script>alert(\"1\")</script>\u0000 & '";
const code = plainCode([[0.5, 0, 0, 0.5, 0, 0], [0.5, 0, 0, 0.5, 0.5, 0.25]], null, { name: NASTY, title: NASTY });
const box = { x: 0.5, y: 0.25, hx: 0.5, hy: 0.25 };
const OWN = '{"format": "fractal-exp/ifs", "version": 1, "linear": [[[0.5, 0], [0, 0.5]]], "offset": [[1, 2]]';

test("a code is written and read bit for bit", () => {
  const extreme = plainCode([[1e-30, 0, 3.4e-45, 0.1, 3e38, -1 / 3]], [1], { name: "<&'\"> \n}", deep: [{ a: 1 }] });
  for (const each of [code, extreme]) assert.deepEqual(readJson(writeJson(each)), each);
});

test("the package's own JSON and the two public spellings are read", () => {
  const row = [0.5, 0, 0, 0.5, 1, 2];
  for (const text of [
    `${OWN}}`, `${OWN}, "probabilities": null, "meta": {}}`, ` \n[[0.5, 0, 0, 0.5, 1, 2]]`,
    '{"ifs_m": [[0.5, 0, 0, 0.5]], "ifs_t": [[1, 2]]}', '{"ifs_m": [[[0.5, 0], [0, 0.5]]], "ifs_t": [[1, 2]]}',
  ]) {
    const { rows, probabilities } = readJson(text);
    assert.deepEqual([rows, probabilities], [[row], null], text);
  }
  assert.deepEqual(readJson("[[0.5, 0, 0, 0.5, 1, 2, 1]]").probabilities, [1]);
  assert.deepEqual(readJson('{"ifs_m": [[0, 0, 0, 0]], "ifs_t": [[0, 0]], "ifs_p": [1]}').probabilities, [1]);
});

test("what is no code is refused, and said in a line", () => {
  const deep = `${'{"a": '.repeat(50_000)}1${"}".repeat(50_000)}`;
  for (const [text, why] of [
    ["{", /^the text is not JSON/], ["[[0,0,0,0,0,NaN]]", /^the text is not JSON/], ["null", /a JSON object or a list/],
    ["3", /a JSON object or a list/], ["[]", /six numbers each/], ["[[0,0,0,0,0]]", /six numbers each/],
    ["[[0,0,0,0,0,1e39]]", /up to 3.4/], ['[[0,0,0,0,0,"1"]]', /numbers only, got '"1"'/], ["[[1,0,0,1,0,0]]", /contract/],
    ["[[0,0,0,0,0,0,0.5]]", /must sum to 1/], ['{"ifs_m": [[0,0,0,0]]}', /needs ifs_t beside it/],
    ['{"ifs_m": [[0,0,0]], "ifs_t": [[0,0]]}', /linear must have shape/], ['{"ifs_m": [], "ifs_t": []}', /shape/],
    ['{"ifs_m": [[0,0,0,0]], "ifs_t": [[0,0],[0,0]]}', /offset must have shape/], ["{}", /expected format/],
    ['{"ifs_m": [[0,0,0,0]], "ifs_t": [[0,0]], "x": 1}', /unknown keys 'x'/], [`${OWN}, "<b>": 1}`, /unknown keys '<b>/],
    [`${OWN.replace("1,", "2,")}}`, /version '2'; no other/], [`${OWN}, "meta": [1]}`, /free notes/],
    [`${OWN}, "meta": ${deep}}`, /nested too deeply/], ["[".repeat(100_000), /^the text is not JSON/],
    ['{"__proto__": {"ifs_m": [[0,0,0,0]], "ifs_t": [[0,0]]}}', /unknown keys '__proto__'/],
    [JSON.stringify(Array(1001).fill([0, 0, 0, 0, 0, 0])), /at most 1000 maps, got 1001/],
  ]) {
    assert.throws(() => readJson(text), (error) => error instanceof Refused && why.test(error.message)
      && error.message.length < 500, `${text.slice(0, 60)}, ${why}`);
  }
});

test("a code is taken or refused as the package does", () => {
  for (const { accepted, text } of JSON.parse(readFileSync(new URL("../code_cases.json", import.meta.url), "utf8"))) {
    if (accepted) assert.deepEqual(readJson(writeJson(readJson(text))), readJson(text), text);
    else assert.throws(() => readJson(text), Refused, text);
  }
});

test("of text in another format, the command that converts it is named", () => {
  for (const text of ["fern { .5 0 0 .5 0 0 }", "<flame name='a'/>", "ply\n", "", "\u0000"]) {
    assert.throws(() => readJson(text), (error) => error instanceof Refused && error.message.includes("fractal-convert"));
  }
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
  const text = writeSvg(code, scene);
  const drawn = [...text.matchAll(/<polygon points="([^"]*)"/g)].map(([, points]) => points);
  assert.deepEqual(drawn, ["0,0 0.5,0 0.5,-0.25 0,-0.25", "0.5,-0.25 1,-0.25 1,-0.5 0.5,-0.5"]);
  assert.ok(text.includes('viewBox="-0.25 -0.75 1.5 1"') && text.includes('href="data:x"'));
  assert.ok(!text.includes("<script") && text.includes("<title>&#60;/svg&#62;&#60;script"));
  assert.deepEqual(cornersOf(code.rows[1], box)[2], [1, 0.5]);
});

test("file names are plain", () => {
  assert.deepEqual(["Barnsley's fern (1)", "../../etc/passwd", "ф"].map(fileName),
    ["barnsley-s-fern-1", "etc-passwd", "fractal"]);
});
