// The two dialogs by which codes come in and go out: text and files, in every format that formats.mjs has.

import { Refused } from "./code.mjs";
import { LARGEST, WRITERS, entriesOf, fileName, textOf } from "./formats.mjs";
import { copy, download, isSandboxed } from "./taking.mjs";

const MOST_LISTED = 500; // codes of a file that are offered
const LARGEST_SHOWN = 2e6; // characters

const $ = (id) => document.getElementById(id);

/** Listen to the dialogs; take(code) is called with a code that was read, and given() tells {code, scene} to write. */
export class Exchange {
  constructor({ take, given }) {
    Object.assign(this, { take, given, entries: [], out: "" });
    $("in-read").addEventListener("click", () => this.attempt(() => this.offer(entriesOf($("in-text").value))));
    $("in-take").addEventListener("click", () => this.attempt(() => this.accept(this.entries[$("in-which").value])));
    $("in-text").addEventListener("input", () => this.offer([]));
    $("in-file").addEventListener("change", () => this.opened($("in-file").files[0]));
    for (const [key, { label }] of Object.entries(WRITERS)) $("out-format").append(new Option(label, key));
    $("out-format").addEventListener("change", () => this.write());
    $("out-copy").addEventListener("click", () => this.copy());
    $("out-save").addEventListener("click", () => this.save());
  }

  import() {
    this.offer([]);
    $("in-file").value = "";
    $("in").showModal();
  }

  export() {
    $("out").showModal();
    this.write();
  }

  /** Do what a file may forbid, and say what it was. */
  attempt(doing) {
    $("in-said").textContent = "";
    try {
      doing();
    } catch (error) {
      if (!(error instanceof Refused)) throw error;
      $("in-said").textContent = error.message;
    }
  }

  async opened(file) {
    if (!file) return;
    this.offer([]);
    const head = file.slice(0, LARGEST + 1); // no larger file is read
    const bytes = new Uint8Array(await head.arrayBuffer());
    this.attempt(() => this.offer(entriesOf(textOf(bytes), file.name)));
  }

  /** Take the only code, or let one of several be chosen. */
  offer(entries) {
    this.entries = entries;
    $("in-said").textContent = "";
    $("in-choice").hidden = entries.length < 2;
    if (entries.length === 1) return this.accept(entries[0]);
    const names = entries.slice(0, MOST_LISTED).map(({ name }, i) => new Option(name ?? `#${i + 1}`, i));
    $("in-which").replaceChildren(...names);
    if (entries.length > MOST_LISTED) $("in-said").textContent = `The first ${MOST_LISTED} of ${entries.length} codes`;
    if (entries.length) $("in-which").focus();
    return undefined;
  }

  accept(entry) {
    this.take(entry.read());
    $("in").close();
  }

  write() {
    const { code, scene } = this.given(), key = $("out-format").value, made = WRITERS[key].write(code, scene);
    const shown = typeof made === "string" && made.length <= LARGEST_SHOWN;
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
