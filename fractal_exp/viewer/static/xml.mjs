// XML as a stream of elements, as strict as the package's reader: no document type, no entity of its own, no great
// depth. The browser's own parser builds a whole tree before it can be asked, and follows declarations.

import { Refused } from "./code.mjs";

const DEEPEST = 64;
const NAME = "[\\p{L}_:][\\p{L}\\p{M}\\p{N}_:.\\-\\xb7]*";
const START = new RegExp(`<(${NAME})`, "uy"), END = new RegExp(`</(${NAME})[ \\t\\n]*>`, "uy");
const ATTRIBUTE = new RegExp(`[ \\t\\n]+(${NAME})[ \\t\\n]*=[ \\t\\n]*(?:"([^<"]*)"|'([^<']*)')`, "uy");
const CLOSE = /[ \t\n]*(\/?)>/y;
const TEXT = /[^<]+/y;
const REFERENCE = new RegExp(`&(?:#(\\d+)|#x([\\da-fA-F]+)|(${NAME}));|&`, "gu");
const said = (name, values, group) => `[ \\t\\n]+${name}[ \\t\\n]*=[ \\t\\n]*(["'])${values}\\${group}`;
const DECLARATION = new RegExp(`^<\\?xml${said("version", "[\\w.-]*", 1)}`
  + `(?:${said("encoding", "[A-Za-z][\\w.-]*", 2)})?(?:${said("standalone", "(?:yes|no)", 3)})?[ \\t\\n]*\\?>`);
const TARGET = new RegExp(`<\\?(${NAME})(?=[ \\t\\n]|\\?>)`, "uy");
const FORBIDDEN = /[^\t\n\x20-\ud7ff\ue000-\ufffd\u{10000}-\u{10ffff}]/u;
const ENTITIES = new Map([["lt", "<"], ["gt", ">"], ["amp", "&"], ["quot", '"'], ["apos", "'"]]);

/** Call start(name, attributes) and end() for the elements of a text, attributes being a Map. Throws Refused. */
export function parseXml(text, { start, end }) {
  new Parser(text.replace(/\r\n?/g, "\n"), start, end).run();
}

class Parser {
  constructor(text, start, end) {
    Object.assign(this, { text, start, end, at: 0, open: [], done: false });
  }

  run() {
    const { text } = this, wrong = text.search(FORBIDDEN);
    if (wrong >= 0) this.refuse("it holds a character that XML forbids", wrong);
    this.at = text.startsWith("<?xml") ? DECLARATION.exec(text)?.[0].length ?? 0 : 0;
    while (this.at < text.length) this.step();
    if (this.open.length || !this.done) this.refuse("it ends too early");
  }

  step() {
    const { text, at } = this;
    if (text[at] !== "<") this.characters(this.take(TEXT)[0]);
    else if (text.startsWith("<!--", at)) this.skip("--", 4, ">");
    else if (text.startsWith("<![CDATA[", at) && this.open.length) this.skip("]]>", 9);
    else if (text.startsWith("<?", at)) this.instruction();
    else if (text.startsWith("<!DOCTYPE", at)) {
      throw new Refused("the file declares a document type or an entity, which could make it endless or fetch other "
        + "files; remove the declaration <!…>");
    } else if (text[at + 1] === "/") this.close();
    else this.element();
  }

  take(pattern) {
    pattern.lastIndex = this.at;
    const found = pattern.exec(this.text);
    if (found) this.at = pattern.lastIndex;
    return found;
  }

  skip(end, from, then = "") {
    const found = this.text.indexOf(end, this.at + from);
    if (found < 0 || !this.text.startsWith(then, found + end.length)) this.refuse("something in it does not end");
    this.at = found + end.length + then.length;
  }

  instruction() {
    const target = this.take(TARGET);
    if (!target || target[1].toLowerCase() === "xml") this.refuse("an instruction <?…?> is broken");
    this.skip("?>", 0);
  }

  characters(piece) {
    const inside = this.open.length > 0;
    if (!inside && /[^ \t\n]/.test(piece)) this.refuse("text stands outside of its elements", this.at - piece.length);
    if (piece.includes("]]>")) this.refuse("']]>' stands in its text");
    this.expanded(piece);
  }

  /** A text with its references replaced. */
  expanded(piece) {
    return piece.replace(REFERENCE, (all, decimal, hexadecimal, name) => {
      if (name !== undefined) return ENTITIES.get(name) ?? this.refuse("undefined entity");
      const code = decimal === undefined ? parseInt(hexadecimal, 16) : parseInt(decimal, 10);
      const ok = code <= 0x10ffff && (code === 13 || !FORBIDDEN.test(String.fromCodePoint(code)));
      return ok ? String.fromCodePoint(code) : this.refuse("a reference &…; is broken");
    });
  }

  element() {
    const name = this.take(START)?.[1], attributes = new Map();
    if (!name || this.done) this.refuse("a tag is broken, or follows the last element");
    for (let found; (found = this.take(ATTRIBUTE));) {
      if (attributes.has(found[1])) this.refuse("an attribute is given twice");
      attributes.set(found[1], this.expanded((found[2] ?? found[3]).replace(/[\t\n]/g, " ")));
    }
    const closed = this.take(CLOSE);
    if (!closed) this.refuse("a tag is broken");
    this.open.push(name);
    if (this.open.length > DEEPEST) {
      throw new Refused(`the file's elements are nested more than ${DEEPEST} deep; that is no flame`);
    }
    this.start(name, attributes);
    if (closed[1]) this.leave();
  }

  close() {
    const name = this.take(END)?.[1];
    if (!name || name !== this.open.at(-1)) this.refuse("a tag ends that was not begun");
    this.leave();
  }

  leave() {
    this.end();
    this.open.pop();
    this.done = this.open.length === 0;
  }

  refuse(why, at = this.at) {
    throw new Refused(`the file is not XML: ${why} in line ${this.text.slice(0, at).split("\n").length}`);
  }
}
