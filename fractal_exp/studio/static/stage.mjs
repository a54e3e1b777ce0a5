// The stage: the picture below, what the code draws over it, and the maps; they move together.

import { plainCode, ready } from "./code.mjs";
import { Editor } from "./editor.mjs";
import { keyMove, listenToPointers } from "./gestures.mjs";
import { Picture } from "./picture.mjs";
import { homeOf, panned, windowOf, zoomed } from "./view.mjs";
import { boxOf } from "./hull.mjs";

const CANVAS = { x: 0, y: 0, zoom: 1 }; // the square that the picture fills
const LEAST = 1 / 4, MOST = 4096; // of the zoom: beyond, the picture is a few pixels and tells nothing
const GROUND = [0, 0, 0], INK = [1, 0.4, 0]; // with the tint of the picture, the ink makes white
const EDITED = 200; // ms after the last change of a map, until it is told

const $ = (id) => document.getElementById(id);

/** edited(code) is called, with the package's plain data, when hands have changed the code; said(text) with errors;
    foreign(meta) says, before an import, of which other picture a code is, or nothing. */
export class Stage {
  constructor(edited, said, foreign) {
    Object.assign(this, { edited, said, foreign, view: CANVAS, picture: null, editor: null, from: null, timer: 0,
      untold: null });
    this.surface = $("picture");
    new ResizeObserver(() => this.fit()).observe($("stage"));
    listenToPointers(this.surface, this.moves());
    document.addEventListener("keydown", (event) => this.onKey(event));
    $("do-edit").addEventListener("click", () => this.editor?.toggle());
    for (const id of ["in", "out"]) {
      $(id).querySelector("form button").addEventListener("click", () => $(id).close());
    }
  }

  /** Show the picture that an address names, or none. */
  showPicture(address) {
    $("target").hidden = !address;
    if (address) $("target").src = address;
    this.go(CANVAS);
  }

  /** Show a code that the studio tells of; null: none. */
  showCode(given) {
    this.forget();
    this.surface.hidden = !given;
    if (!given) return this.editor?.on && this.editor.toggle();
    const rows = given.linear.map((matrix, i) => [...matrix.flat(), ...given.offset[i]]);
    const code = plainCode(rows, given.probabilities);
    try {
      if (!this.editor) this.begin(code);
      else {
        this.from = "studio";
        this.editor.replace(code);
        this.from = null;
      }
    } catch (error) {
      this.said(`The code is not drawn: ${error.message}`);
    }
  }

  begin(code) {
    this.picture = new Picture(this.surface, ready(code), ({ drawing }) => {
      $("stage").dataset.state = drawing ? "drawing" : "done";
    }, new URLSearchParams(location.search).get("thrower"));
    this.picture.paint(GROUND, INK);
    this.editor = new Editor(code, homeOf(boxOf(code)), this.surface, {
      look: () => ({ view: this.view, sides: this.sides() }),
      draw: (changed) => this.draw(changed),
      open: () => {},
      scene: (box) => {
        const [width, height] = this.sides(), seen = () => {
          this.picture.showAgain();
          return this.surface.toDataURL("image/png");
        };
        const namespace = $("maps").namespaceURI;
        return { file: "code", scene: { view: this.view, width, height, box, namespace, picture: seen } };
      },
    });
    const take = this.editor.exchange.take;
    this.editor.exchange.take = (read) => {
      const other = this.foreign(read.meta);
      if (!other || confirm(`This code was found on ${other}. Lay it over this picture all the same?`)) take(read);
    };
    this.fit();
  }

  draw(code) {
    this.picture.follow(ready(code));
    if (this.from) return;
    clearTimeout(this.timer);
    this.untold = {
      format: "fractal-exp/ifs", version: 1,
      linear: code.rows.map(([a, b, c, d]) => [[a, b], [c, d]]), offset: code.rows.map((row) => row.slice(4)),
      probabilities: code.probabilities,
    };
    this.timer = setTimeout(() => this.flush(), EDITED);
  }

  /** Tell at once what hands have changed, as before something is asked for. */
  flush() {
    const code = this.untold;
    this.forget();
    if (code) this.edited(code);
  }

  forget() {
    clearTimeout(this.timer);
    this.untold = null;
  }

  /** Whether hands may change the code; the maps are put away if not. */
  allow(yes) {
    $("do-edit").disabled = !yes;
    if (!yes && this.editor?.on) this.editor.toggle();
  }

  sides() {
    const box = $("stage").getBoundingClientRect();
    return [box.width, box.height];
  }

  go(view) {
    this.view = view;
    const { left, top, scale } = windowOf(view, ...this.sides()), { style } = $("target");
    Object.assign(style, { left: `${(-1 - left) * scale}px`, top: `${(top - 1) * scale}px`, width: `${2 * scale}px`,
      height: `${2 * scale}px` });
    this.picture?.look(view);
    this.editor?.show();
  }

  fit() {
    const [width, height] = this.sides(), ratio = window.devicePixelRatio || 1;
    this.picture?.resize(Math.max(1, Math.round(width * ratio)), Math.max(1, Math.round(height * ratio)));
    this.go(this.view);
  }

  moves() {
    const nothing = () => {};
    return {
      pan: (dx, dy) => this.go(panned(this.view, dx, dy, ...this.sides())),
      zoom: (factor, column, row) => {
        const most = Math.min(factor, MOST / this.view.zoom);
        this.go(zoomed(this.view, most, column, row, ...this.sides(), LEAST));
      },
      home: () => this.go(CANVAS), swap: nothing, save: nothing, link: nothing, help: nothing,
    };
  }

  onKey(event) {
    if (!this.editor || document.querySelector("dialog[open]") || $("do-edit").disabled) return;
    const busy = event.target.closest?.("input, select, textarea, button, summary");
    if (busy && !(event.ctrlKey || event.metaKey) && !event.target.closest("#panel button, #do-edit")) return;
    if (event.target.closest?.("button") && [" ", "Enter"].includes(event.key)) return;
    if (this.editor.key(event)) return event.preventDefault();
    if (event.target !== this.surface) return;
    const move = keyMove(event);
    if (!move) return;
    event.preventDefault();
    move(this.moves(), ...this.sides());
  }
}
