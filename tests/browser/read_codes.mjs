// What the page's readers and writers make of texts: a list of [file name, text, choice] on stdin, one answer each.

import { WRITERS, entriesOf } from "../../fractal_exp/viewer/static/formats.mjs";
import { Refused } from "../../fractal_exp/viewer/static/code.mjs";

const CAMERA = { camera: { x: 0, y: 0, zoom: 1 } };
const TEXTS = ["json", "rows", "lists", "fractint", "flame"];
let given = "";
for await (const part of process.stdin.setEncoding("utf-8")) given += part;
const answers = JSON.parse(given).map(([file, text, choice = 0]) => {
  try {
    const entries = entriesOf(text, file), code = entries[choice].read();
    const written = TEXTS.map((key) => [key, WRITERS[key].write(code, CAMERA)]);
    return { names: entries.map(({ name }) => name), ...code, written: Object.fromEntries(written) };
  } catch (error) {
    if (!(error instanceof Refused)) return { broken: String(error.stack) };
    return { refused: error.message };
  }
});
process.stdout.write(JSON.stringify(answers));
