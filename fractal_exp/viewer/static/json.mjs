// A code as JSON: the package's own format and the two public spellings.

import { Refused, checkCount, plainCode } from "./code.mjs";
import { plain } from "./reading.mjs";

const FORMAT = "fractal-exp/ifs", VERSION = 1;
const LARGEST = 3.4028234663852886e38; // of float32
const DEEPEST = 500; // lists in lists
const OWN = ["format", "version", "linear", "offset", "probabilities", "colours", "meta"];
const LISTS = ["ifs_m", "ifs_t", "ifs_p"];

/** The one code of a JSON file. */
export function readJson(text) {
  return [{ name: null, read: () => codeOf(parsed(text)) }];
}

function parsed(text) {
  let data;
  try {
    data = JSON.parse(text);
  } catch (error) {
    throw new Refused(`the file is not JSON: ${plain(error.message)}`);
  }
  checkKeys(text);
  return data;
}

/** JSON.parse takes the last of two values for one key in silence; that is refused, and so is great depth. */
function checkKeys(text) {
  const open = [];
  for (let at = 0, string = []; at < text.length; at++) {
    const letter = text[at];
    if (letter === '"') {
      const end = endOfString(text, at);
      string = [at, end];
      at = end - 1;
    } else if (letter === "{" || letter === "[") {
      if (open.push(letter === "{" ? new Set() : null) <= DEEPEST) continue;
      throw new Refused("the file is no JSON that can be read: its lists are nested too deeply");
    } else if (letter === "}" || letter === "]") {
      open.pop();
    } else if (letter === ":") {
      const keys = open.at(-1), name = JSON.parse(text.slice(...string));
      if (keys.has(name)) throw new Refused(`the file gives the key '${plain(name, 40)}' twice; remove one`);
      keys.add(name);
    }
  }
}

/** Where the text goes on after the string that begins at `at`; a regular expression would run out of stack. */
function endOfString(text, at) {
  do at += text[at] === "\\" ? 2 : 1;
  while (text[at] !== '"');
  return at + 1;
}

/** The code of plain data in any of the three spellings. Throws Refused. */
export function codeOf(data) {
  const isObject = data !== null && typeof data === "object";
  if (!isObject) throw new Refused("a code is a JSON object or a list of rows of six numbers");
  const maps = Array.isArray(data) ? data : data.linear ?? data.ifs_m;
  if (Array.isArray(maps) && maps.length) checkCount(maps.length);
  if (Array.isArray(data)) return fromRows(data);
  return Object.hasOwn(data, "ifs_m") ? fromLists(data) : fromOwn(data);
}

function fromOwn(data) {
  onlyKeys(data, OWN);
  if (data.format !== FORMAT || data.version !== VERSION) {
    throw new Refused(`expected format '${FORMAT}' version ${VERSION}, got '${plain(String(data.format), 40)}' version `
      + `'${plain(String(data.version), 40)}'; no other version is read`);
  }
  const missing = ["linear", "offset"].filter((key) => !Object.hasOwn(data, key));
  if (missing.length) throw new Refused(`the code has no ${missing.join(" and no ")}`);
  const meta = data.meta ?? {};
  if (typeof meta !== "object" || Array.isArray(meta)) throw new Refused("meta holds free notes by name (an object)");
  numbers("linear", data.linear);
  if (!hasShape(data.linear, [2, 2])) throw new Refused("linear must have shape (N, 2, 2) with N >= 1");
  const colours = data.colours ?? null;
  if (colours !== null) checkColours(colours);
  return fromParts(data.linear, data.offset, data.probabilities ?? null, ["offset", "probabilities"], meta, colours);
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

function fromLists(data) {
  onlyKeys(data, LISTS);
  if (!Object.hasOwn(data, "ifs_t")) throw new Refused("ifs_m needs ifs_t beside it: one offset (x, y) per matrix");
  numbers("ifs_m", data.ifs_m);
  if (!hasShape(data.ifs_m, [2, 2]) && !hasShape(data.ifs_m, [4])) {
    throw new Refused("ifs_m must have shape (N, 2, 2) or (N, 4) with N >= 1");
  }
  return fromParts(data.ifs_m, data.ifs_t, data.ifs_p ?? null, ["ifs_t", "ifs_p"], {});
}

function fromParts(linear, offset, probabilities, [offsetName, chanceName], meta, colours = null) {
  numbers(offsetName, offset);
  if (!hasShape(offset, [2]) || offset.length !== linear.length) {
    throw new Refused(`${offsetName} must have shape (${linear.length}, 2) as there are ${linear.length} matrices`);
  }
  if (probabilities !== null) numbers(chanceName, probabilities);
  const isList = probabilities === null || hasShape(probabilities, []);
  if (!isList) throw new Refused(`${chanceName} must be a list of numbers`);
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
      throw new Refused(`${name} must hold numbers only, got '${plain(JSON.stringify(item), 40)}'`);
    } else if (!(Math.abs(item) <= LARGEST)) {
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

/** Rows a b c d e f, and p where the code has probabilities. */
export function writeRows({ rows, probabilities }) {
  const lines = rows.map((row, i) => [...row, ...(probabilities ? [probabilities[i]] : [])].map(shortest).join(", "));
  return `[[${lines.join("],\n [")}]]\n`;
}

/** The spelling ifs_m, ifs_t, ifs_p. */
export function writeLists({ rows, probabilities }) {
  const lists = (part) => `[${rows.map((row) => part(row.map(shortest))).join(",\n  ")}]`;
  const chances = probabilities ? `,\n "ifs_p": [${probabilities.map(shortest).join(", ")}]` : "";
  return `{"ifs_m": ${lists(([a, b, c, d]) => `[[${a}, ${b}], [${c}, ${d}]]`)},\n "ifs_t": ${
    lists(([, , , , e, f]) => `[${e}, ${f}]`)}${chances}}\n`;
}

/** The shortest decimal that reads back as the same float32. */
export function shortest(number) {
  for (let digits = 1; digits < 9; digits++) {
    const text = number.toPrecision(digits);
    if (Math.fround(Number(text)) === number) return String(Number(text));
  }
  return String(Number(number.toPrecision(9)));
}
