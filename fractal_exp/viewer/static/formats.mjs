// Files of codes, in and out: which reader a text goes to, and what can be written.

import { Refused } from "./code.mjs";
import { writePly, writeSvg } from "./drawings.mjs";
import { readFlame, writeFlame } from "./flame.mjs";
import { readFractint, writeFractint } from "./fractint.mjs";
import { readJson, writeJson, writeLists, writeRows } from "./json.mjs";
import { plain } from "./reading.mjs";

export const LARGEST = 16 * 2 ** 20; // bytes of a file that is read
const READERS = { json: readJson, ifs: readFractint, flame: readFlame, flam3: readFlame };

/** What can be written: label, the end of a file's name, and write(code, scene), which gives a text or bytes. */
export const WRITERS = {
  json: { label: "JSON", ending: "json", write: writeJson },
  rows: { label: "JSON, rows", ending: "json", write: writeRows },
  lists: { label: "JSON, ifs_m and ifs_t", ending: "json", write: writeLists },
  fractint: { label: "Fractint", ending: "ifs", write: writeFractint },
  flame: { label: "flam3", ending: "flame", write: (code, scene) => writeFlame(code, scene.camera) },
  svg: { label: "SVG drawing", ending: "svg", write: writeSvg },
  ply: { label: "PLY points", ending: "ply", write: writePly },
};

/** A file's bytes as text. Throws Refused unless they are UTF-8 and at most 16 MiB. */
export function textOf(bytes) {
  if (bytes.length > LARGEST) throw new Refused(`the file has ${bytes.length} bytes, at most ${LARGEST} are read`);
  try {
    return new TextDecoder("utf-8", { fatal: true, ignoreBOM: true }).decode(bytes);
  } catch {
    throw new Refused("the file is not UTF-8 text; save it as UTF-8");
  }
}

/** The codes in a text, [{name, read}]: read by the end of the file's name, or by how the text begins. */
export function entriesOf(text, file = "") {
  if (text.length > LARGEST) throw new Refused(`the text has ${text.length} characters, at most ${LARGEST} are read`);
  const ending = file.includes(".") ? file.split(".").at(-1).toLowerCase() : "";
  const read = Object.hasOwn(READERS, ending) ? READERS[ending] : READERS[guessed(text)];
  const body = read === readJson ? text : text.replace(/\x1a+$/, "").replace(/^\ufeff/, "");
  if (!body.trim()) throw new Refused("the file is empty");
  const entries = read(body);
  if (!entries.length) throw new Refused("the file holds no code");
  return entries;
}

function guessed(text) {
  const first = text.replace(/^\ufeff/, "").trimStart()[0];
  return { "<": "flame", "[": "json", "{": "json" }[first] ?? "ifs";
}

/** A file name without an ending, of plain letters. */
export function fileName(title) {
  return plain(title).toLowerCase().replace(/[^a-z0-9]+/g, "-").replace(/^-+|-+$/g, "").slice(0, 40) || "fractal";
}
