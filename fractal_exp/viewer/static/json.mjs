// A code as JSON: the package's own format, and for reading the two public spellings. The package converts all others.

import { Refused, checkCount, plainCode } from "./code.mjs";
import { brief, plain } from "./reading.mjs";

const FORMAT = "fractal-exp/ifs", VERSION = 1;
const LARGEST = 3.4028234663852886e38; // of float32, to which all numbers are rounded
const OWN = ["format", "version", "linear", "offset", "probabilities", "colours", "meta"];
const LISTS = ["ifs_m", "ifs_t", "ifs_p"];

/** The code in a text. Throws Refused, which names the command for what is no JSON. */
export function readJson(text) {
  let data;
  try {
    data = JSON.parse(text);
  } catch (error) {
    if (/^\s*[[{]/.test(text)) throw new Refused(`the text is not JSON: ${plain(error.message)}`);
    throw new Refused("a page reads JSON alone; of a file in another format, `fractal-convert FILE code.json` makes "
      + "JSON, and `fractal-convert FILE:NAME code.json` of one of several codes");
  }
  return codeOf(data);
}

/** The code of plain data in any of the three spellings. Throws Refused. */
export function codeOf(data) {
  const isObject = data !== null && typeof data === "object";
  if (!isObject) throw new Refused("a code is a JSON object or a list of rows of six numbers");
  const maps = Array.isArray(data) ? data : data.linear ?? data.ifs_m;
  if (Array.isArray(maps) && maps.length) checkCount(maps.length);
  if (Array.isArray(data)) return fromRows(data);
  return fromOwn(Object.hasOwn(data, "ifs_m") ? respelled(data) : data);
}

function fromOwn(data) {
  onlyKeys(data, OWN);
  if (data.format !== FORMAT || data.version !== VERSION) {
    throw new Refused(`expected format '${FORMAT}' version ${VERSION}, got ${brief(data.format)} version `
      + `${brief(data.version)}; no other version is read`);
  }
  const missing = ["linear", "offset"].filter((key) => !Object.hasOwn(data, key));
  if (missing.length) throw new Refused(`the code has no ${missing.join(" and no ")}`);
  const meta = data.meta ?? {};
  if (typeof meta !== "object" || Array.isArray(meta)) throw new Refused("meta holds free notes by name (an object)");
  checkDepth(meta);
  numbers("linear", data.linear);
  if (!hasShape(data.linear, [2, 2])) throw new Refused("linear must have shape (N, 2, 2) with N >= 1");
  const colours = data.colours ?? null;
  if (colours !== null) checkColours(colours);
  return fromParts(data.linear, data.offset, data.probabilities ?? null, meta, colours);
}

/** Throws Refused if notes are nested too deeply to be written again. */
function checkDepth(meta) {
  try {
    JSON.stringify(meta);
  } catch {
    throw new Refused("the notes in 'meta' are nested too deeply");
  }
}

function checkColours(colours) {
  if (typeof colours !== "object" || Array.isArray(colours)) {
    throw new Refused("colours are an object with rgb and blends");
  }
  onlyKeys(colours, ["rgb", "blends"]);
  const missing = ["rgb", "blends"].filter((key) => !Object.hasOwn(colours, key));
  if (missing.length) throw new Refused(`the colours have no ${missing.join(" and no ")}`);
  numbers("rgb", colours.rgb);
  numbers("blends", colours.blends);
  if (!hasShape(colours.rgb, [3])) throw new Refused("rgb must have shape (N, 3), red, green and blue of each map");
  if (!hasShape(colours.blends, [])) throw new Refused("blends must be a list of numbers, one for each map");
}

/** Lists ifs_m, ifs_t and ifs_p in the package's own spelling. */
function respelled(data) {
  onlyKeys(data, LISTS);
  if (!Object.hasOwn(data, "ifs_t")) throw new Refused("ifs_m needs ifs_t beside it: one offset (x, y) per matrix");
  const halves = (matrix) => (hasShape([matrix], [4]) ? [matrix.slice(0, 2), matrix.slice(2)] : matrix);
  const linear = Array.isArray(data.ifs_m) ? data.ifs_m.map(halves) : data.ifs_m;
  return { format: FORMAT, version: VERSION, linear, offset: data.ifs_t, probabilities: data.ifs_p };
}

function fromParts(linear, offset, probabilities, meta, colours) {
  numbers("offset", offset);
  if (!hasShape(offset, [2]) || offset.length !== linear.length) {
    throw new Refused(`offset must have shape (${linear.length}, 2) as there are ${linear.length} matrices`);
  }
  if (probabilities !== null) numbers("probabilities", probabilities);
  const isList = probabilities === null || hasShape(probabilities, []);
  if (!isList) throw new Refused("probabilities must be a list of numbers");
  return plainCode(linear.map((matrix, i) => [...matrix.flat(), ...offset[i]]), probabilities, meta, colours);
}

function fromRows(rows) {
  numbers("rows", rows);
  const width = [6, 7].find((count) => hasShape(rows, [count]));
  if (!width) throw new Refused("a list of rows needs six numbers each, a b c d e f, or seven with the probability");
  return plainCode(rows.map((row) => row.slice(0, 6)), width === 7 ? rows.map((row) => row[6]) : null);
}

function onlyKeys(data, allowed) {
  const unknown = Object.keys(data).filter((key) => !allowed.includes(key)).sort();
  if (!unknown.length) return;
  throw new Refused(`unknown keys '${plain(unknown.join(", "), 80)}'; a code has ${allowed.join(", ")}, free notes go `
    + "into 'meta'");
}

/** Throws Refused unless lists in lists hold nothing but numbers that float32 can hold. */
function numbers(name, value) {
  const rest = [value];
  while (rest.length) {
    const item = rest.pop();
    if (Array.isArray(item)) {
      for (const each of item) rest.push(each);
    } else if (typeof item !== "number") {
      throw new Refused(`${name} must hold numbers only, got ${brief(item)}`);
    } else if (!Number.isFinite(Math.fround(item))) {
      throw new Refused(`${name} must hold finite numbers up to ${LARGEST} (float32), got ${item}`);
    }
  }
}

/** Whether a value is a list, with at least one element, of arrays of such sides. */
function hasShape(value, sides) {
  const fits = (item, [side, ...rest]) => (side === undefined ? typeof item === "number"
    : Array.isArray(item) && item.length === side && item.every((each) => fits(each, rest)));
  return Array.isArray(value) && value.length > 0 && value.every((item) => fits(item, sides));
}

/** The package's own JSON, all of a code. */
export function writeJson({ rows, probabilities, meta, colours = null }) {
  const list = (items) => `[${items.join(", ")}]`;
  const linear = rows.map(([a, b, c, d]) => list([list([a, b].map(shortest)), list([c, d].map(shortest))]));
  const offset = rows.map(([, , , , e, f]) => list([e, f].map(shortest)));
  const chances = probabilities ? list(probabilities.map(shortest)) : "null";
  const lines = [`"format": "${FORMAT}"`, `"version": ${VERSION}`, `"linear": [\n  ${linear.join(",\n  ")}\n ]`,
    `"offset": [\n  ${offset.join(",\n  ")}\n ]`, `"probabilities": ${chances}`,
    ...(colours ? [writtenColours(colours, list)] : []), `"meta": ${JSON.stringify(meta)}`];
  return `{\n ${lines.join(",\n ")}\n}\n`;
}

function writtenColours({ rgb, blends }, list) {
  return `"colours": {"rgb": ${list(rgb.map((colour) => list(colour.map(shortest))))}, "blends": ${
    list(blends.map(shortest))}}`;
}

/** The shortest decimal that reads back as the same float32. */
export function shortest(number) {
  for (let digits = 1; digits < 9; digits++) {
    const text = number.toPrecision(digits);
    if (Math.fround(Number(text)) === number) return String(Number(text));
  }
  return String(Number(number.toPrecision(9)));
}
