// FRACTINT's text files: name { a b c d e f p … }, several to a file, comments after a semicolon.

import { Refused, chancesOf, checkCount } from "./code.mjs";
import { shortest } from "./json.mjs";
import { named, numberOf, plain, weighted, wordsOf } from "./reading.mjs";

const LINES = /\r\n|[\n\r\v\f\x1c-\x1e\x85\u2028\u2029]/;
const LONGEST_NAME = 60, MOST_COMMENT = 2000; // characters that are kept
const IN_3D = 13; // numbers of a map in space

/** The codes of a file, [{name, read}]; see the package's class Fractint. Throws Refused if braces do not match. */
export function readFractint(text) {
  return blocksOf(text).map((block) => ({ name: nameOf(block) || null, read: () => codeOf(block) }));
}

function nameOf({ header }) {
  return plain(header.split("(")[0]);
}

function blocksOf(text) {
  const blocks = [];
  let block = null, header = "";
  for (const line of text.split(LINES)) {
    const [content, ...comment] = line.split(";");
    for (const piece of content.split(/([{}])/)) {
      if (piece === "{" && block) {
        throw new Refused(`entry '${plain(block.header, 40)}' has a second '{'; end each entry with '}'`);
      } else if (piece === "{") {
        block = { header: wordsOf(header).join(" "), lines: [], comments: [] };
        header = "";
      } else if (piece === "}") {
        if (block) blocks.push(block);
        block = null;
        header = "";
      } else if (block) block.lines.push(piece);
      else if (piece.trim()) header = piece;
    }
    block?.comments.push(comment.join(";"));
  }
  if (block) throw new Refused(`entry '${plain(block.header, 40)}' does not end; close it with '}'`);
  return blocks.filter((each) => each.header.toLowerCase() !== "comment");
}

function codeOf({ header, lines, comments }) {
  return named(`entry '${plain(header, 40)}'`, () => {
    if (header.toUpperCase().replaceAll(" ", "").includes("(3D)")) {
      throw new Refused("is a code in space (3D); only codes in the plane are read, of 6 or 7 numbers a map");
    }
    const maps = mapsOf(lines), meta = {};
    const name = nameOf({ header }), comment = comments.map((each) => plain(each)).filter(Boolean).join("\n");
    if (name) meta.name = name;
    if (comment) meta.comment = comment.slice(0, MOST_COMMENT);
    const weights = maps[0].length === 7 ? maps.map((row) => row[6]) : null;
    return weighted(maps.map((row) => row.slice(0, 6)), weights, meta);
  });
}

/** Rows of six or seven numbers: a line is a map, or seven numbers are, wherever lines end. */
function mapsOf(lines) {
  const words = lines.map((line) => wordsOf(line.replaceAll(",", " "))).filter((line) => line.length);
  const all = (count) => words.length > 0 && words.every((line) => line.length === count);
  if (all(IN_3D)) throw new Refused("has 13 numbers a map, as codes in space do; only codes in the plane are read");
  const flat = words.flat(), width = all(6) ? 6 : 7;
  if (!flat.length || flat.length % width) {
    throw new Refused(`has ${flat.length} numbers; a map is a line of 6, a b c d e f, or of 7 with its probability, `
      + "the same for all maps");
  }
  checkCount(flat.length / width);
  const numbers = flat.map((word, i) => numberOf(word, `number ${i + 1}`));
  return Array.from({ length: numbers.length / width }, (_, i) => numbers.slice(width * i, width * (i + 1)));
}

/** An entry, with the probabilities of the chaos game where a code has none, because Fractint needs them. */
export function writeFractint({ rows, probabilities, meta }) {
  const chances = chancesOf(rows, probabilities);
  const name = plain(meta.name).replace(/[^A-Za-z0-9_.+-]+/g, "_").slice(0, LONGEST_NAME).replace(/^_+|_+$/g, "");
  const given = ["title", "source", "comment"].map((key) => meta[key]).filter((note) => typeof note === "string");
  const notes = given.flatMap((note) => note.split(LINES)).map((note) => plain(note)).filter(Boolean);
  const lines = notes.map((note) => `  ; ${note}`);
  rows.forEach((row, i) => {
    const chance = probabilities ? probabilities[i] : Math.fround(chances[i]);
    lines.push(`  ${[...row, chance].map(shortest).join(" ")}`);
  });
  return `${name.toLowerCase() === "comment" ? "comment_" : name || "code"} {\n${lines.join("\n")}\n}\n`;
}
