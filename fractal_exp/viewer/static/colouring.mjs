// The panel that chooses colours.

import { BY, PALETTES } from "./colours.mjs";

const $ = (id) => document.getElementById(id);

/** Listen to the panel; changed(choice) is called with every choice {by, palette, tone, ground}. */
export class Colouring {
  constructor(choice, hasOwn, changed) {
    Object.assign(this, { choice, changed, on: false, hasOwn: null });
    for (const palette of Object.keys(PALETTES)) $("palette").append(new Option(palette, palette));
    $("by").addEventListener("change", () => this.choose({ by: $("by").value }));
    $("palette").addEventListener("change", () => this.choose({ palette: $("palette").value }));
    $("tone").addEventListener("input", () => this.choose({ tone: 2 ** Number($("tone").value) }));
    $("ground").addEventListener("input", () => this.choose({ ground: $("ground").value }));
    $("own-ground").addEventListener("change", () => {
      this.choose({ ground: $("own-ground").checked ? $("ground").value : null });
    });
    $("colours").addEventListener("keydown", (event) => {
      if (event.key !== "Escape") return;
      this.toggle();
      $("do-colour").focus();
    });
    this.offer(hasOwn);
  }

  /** Offer what there is to choose: a code may have no colours of its own. Where another code has some, it is drawn in
   * them instead of plainly. */
  offer(hasOwn) {
    if (hasOwn === this.hasOwn) return;
    const first = this.hasOwn === null, [from, to] = hasOwn ? ["plain", "own"] : ["own", "plain"];
    this.hasOwn = hasOwn;
    const offered = Object.entries(BY).filter(([by]) => by !== "own" || hasOwn);
    $("by").replaceChildren(...offered.map(([by, label]) => new Option(label, by)));
    if (!first && this.choice.by === from) this.choose({ by: to });
    else this.show();
  }

  choose(changes) {
    this.choice = { ...this.choice, ...changes };
    this.show();
    this.changed(this.choice);
  }

  show() {
    const { by, palette, tone, ground } = this.choice;
    $("by").value = by;
    $("palette").value = palette;
    $("palette").disabled = by === "plain" || by === "own";
    $("tone").value = Math.log2(tone);
    $("tone").disabled = by !== "density";
    $("own-ground").checked = ground !== null;
    if (ground !== null) $("ground").value = ground;
    $("ground").disabled = ground === null;
  }

  toggle() {
    this.on = !this.on;
    $("colours").hidden = !this.on;
    $("do-colour").setAttribute("aria-expanded", String(this.on));
    if (this.on) $("by").focus();
  }
}
