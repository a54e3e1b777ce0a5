// The panel beside the picture: the numbers of the selected map, and what can be done to it.

import { Refused, chancesOf } from "./code.mjs";
import { shortest } from "./json.mjs";
import { COLOURS } from "./overlay.mjs";
import { numberOf } from "./reading.mjs";

const NUMBERS = ["a", "b", "c", "d", "e", "f"]; // in the order of a row
const ACTS = ["add", "copy", "remove", "flip", "undo", "redo", "import", "export"];

const $ = (id) => document.getElementById(id);

/** Listen to the panel. doing: select(i), number(k, value), chance(p), byArea(yes) and one for each of ACTS. */
export class Panel {
  constructor(doing) {
    this.said = 0;
    $("which").addEventListener("change", () => doing.select(Number($("which").value)));
    NUMBERS.forEach((name, k) => this.listen(`number-${name}`, name, (value) => doing.number(k, value)));
    this.listen("chance", "the probability", doing.chance);
    $("by-area").addEventListener("change", () => this.attempt(() => doing.byArea($("by-area").checked)));
    for (const act of ACTS) $(`maps-${act}`).addEventListener("click", () => this.attempt(doing[act]));
  }

  listen(id, name, use) {
    $(id).addEventListener("change", () => this.attempt(() => use(numberOf($(id).value.trim(), name))));
  }

  /** Do what may be refused, say why it was, and show what holds. */
  attempt(doing) {
    this.say("");
    try {
      doing();
    } catch (error) {
      if (!(error instanceof Refused)) throw error;
      this.say(error.message);
      if (this.last) this.show(...this.last);
    }
  }

  say(text) {
    $("maps-said").textContent = text;
  }

  show(code, selected, steps) {
    this.last = [code, selected, steps];
    const { rows, probabilities } = code, which = $("which");
    if (which.length !== rows.length) {
      which.replaceChildren(...rows.map((_, i) => new Option(`${i + 1} of ${rows.length}`, i)));
    }
    which.value = selected;
    $("swatch").setAttribute("class", `map map-${selected % COLOURS}`);
    NUMBERS.forEach((name, k) => { $(`number-${name}`).value = shortest(rows[selected][k]); });
    $("chance").value = Number(chancesOf(rows, probabilities)[selected].toPrecision(6));
    $("by-area").checked = probabilities === null;
    $("maps-undo").disabled = steps.past.length === 0;
    $("maps-redo").disabled = steps.future.length === 0;
    $("maps-remove").disabled = rows.length === 1;
  }
}
