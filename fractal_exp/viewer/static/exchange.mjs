// The two dialogs by which codes come in and go out: as JSON, a text or a file, and out also as a drawing.

import { Refused } from "./code.mjs";
import { writeSvg } from "./drawings.mjs";
import { readJson, writeJson } from "./json.mjs";
import { plain } from "./reading.mjs";
import { copy, download, isSandboxed } from "./taking.mjs";

const LARGEST = 4 * 2 ** 20; // bytes that are read; a code of the most maps has a tenth of them
const LARGEST_SHOWN = 2e6; // characters
/** What can be written: label, the end of a file's name, and write(code, scene), which gives a text. */
const WRITERS = {
  json: { label: "JSON", ending: "json", write: writeJson },
  svg: { label: "SVG drawing", ending: "svg", write: writeSvg },
};

const $ = (id) => document.getElementById(id);

/** Listen to the dialogs; take(code) is called with a code that was read, and given() tells {code, scene} to write. */
export class Exchange {
  constructor({ take, given }) {
    Object.assign(this, { take, given, out: "" });
    $("in-read").addEventListener("click", () => this.read($("in-text").value));
    $("in-text").addEventListener("input", () => { $("in-said").textContent = ""; });
    $("in-file").addEventListener("change", () => this.opened($("in-file").files[0]));
    for (const [key, { label }] of Object.entries(WRITERS)) $("out-format").append(new Option(label, key));
    $("out-format").addEventListener("change", () => this.write());
    $("out-copy").addEventListener("click", () => this.copy());
    $("out-save").addEventListener("click", () => this.save());
  }

  import() {
    $("in-said").textContent = "";
    $("in-file").value = "";
    $("in").showModal();
  }

  export() {
    $("out").showModal();
    this.write();
  }

  async opened(file) {
    if (!file) return;
    this.read(await file.slice(0, LARGEST).text(), file.size);
  }

  /** Take the code of a text, or say why not. */
  read(text, size = text.length) {
    $("in-said").textContent = "";
    try {
      if (size > LARGEST) throw new Refused(`the code has ${size} bytes, at most ${LARGEST} are read`);
      this.take(readJson(text));
      $("in").close();
    } catch (error) {
      if (!(error instanceof Refused)) throw error;
      $("in-said").textContent = error.message;
    }
  }

  write() {
    const { code, scene } = this.given(), key = $("out-format").value, made = WRITERS[key].write(code, scene);
    const shown = made.length <= LARGEST_SHOWN;
    this.out = made;
    $("out-text").value = shown ? made : "";
    $("out-text").hidden = !shown;
    $("out-copy").hidden = !shown;
    $("out-save").hidden = isSandboxed();
    const refused = "This frame lets no page save files. ";
    const text = shown ? "Copy the text below." : "Nor can this file be copied as text; open the page by itself.";
    $("out-said").textContent = isSandboxed() ? refused + text : "";
  }

  async copy() {
    const copied = await copy(this.out);
    if (!copied) $("out-text").select();
    $("out-said").textContent = copied ? "Copied." : "The clipboard is refused here. Copy the selected text.";
  }

  save() {
    const { code: { meta }, file } = this.given(), { ending } = WRITERS[$("out-format").value];
    const title = [meta.title, meta.name].find((each) => typeof each === "string" && each.trim());
    download(new Blob([this.out], { type: "application/octet-stream" }), `${title ? fileName(title) : file}.${ending}`);
    $("out-said").textContent = "Saved.";
  }
}

/** A file name without an ending, of plain letters. */
export function fileName(title) {
  return plain(title).toLowerCase().replace(/[^a-z0-9]+/g, "-").replace(/^-+|-+$/g, "").slice(0, 40) || "fractal";
}
