// Editing: the code as it is now, what hands and keys make of it, and all that shows it.

import { MOST_MAPS, Refused, plainCode } from "./code.mjs";
import {
  Steps, flipped, shareThatContracts, withAdded, withChance, withOwnChances, withRow, withoutChances,
  withoutMap,
} from "./editing.mjs";
import { Exchange } from "./exchange.mjs";
import { boxAtHand, dragged, imageOf, mapAt, places } from "./handles.mjs";
import { boxOf } from "./hull.mjs";
import { Overlay } from "./overlay.mjs";
import { Panel } from "./panel.mjs";
import { homeOf, isNear, windowOf } from "./view.mjs";

const NEW = 0.4; // of the box, the size of a map that is added
const ASIDE = 0.12; // of the box's half sides, how far a copy is set aside
const CLICK = 4; // pixels that a click may move

const $ = (id) => document.getElementById(id);

/**
 * Edits a code. page: look() gives {view, sides}, draw(code) draws another one, open(home, code) is called with a code
 * from elsewhere, where home is null if the view stays, scene() gives what drawings need.
 */
export class Editor {
  constructor(code, home, surface, page) {
    Object.assign(this, { page, selected: 0, on: false, hold: null, asked: 0 });
    this.steps = new Steps({ code, home, box: boxOf(code) });
    this.panel = new Panel(this.doing());
    this.overlay = new Overlay($("maps"), surface, this);
    this.exchange = new Exchange({ take: (read) => this.take(read), given: () => this.given() });
    this.listen(surface);
  }

  get state() {
    return this.steps.state;
  }

  doing() {
    return {
      select: (i) => this.select(i), add: () => this.add(), copy: () => this.copy(), remove: () => this.remove(),
      flip: () => this.flip(), undo: () => this.step("undo"), redo: () => this.step("redo"),
      import: () => this.exchange.import(), export: () => this.exchange.export(),
      number: (k, value) => this.number(k, value), chance: (p) => this.chance(p), byArea: (yes) => this.byArea(yes),
    };
  }

  listen(surface) {
    this.surface = surface;
    let down = null;
    surface.addEventListener("pointerdown", ({ clientX, clientY }) => { down = [clientX, clientY]; });
    surface.addEventListener("click", ({ clientX, clientY }) => {
      if (!this.on || !down || Math.hypot(clientX - down[0], clientY - down[1]) > CLICK) return;
      this.pick(clientX, clientY);
    });
    this.overlay.line.addEventListener("click", ({ clientX, clientY }) => {
      if (!this.moved) this.pick(clientX, clientY);
    });
  }

  toggle() {
    this.on = !this.on;
    document.documentElement.toggleAttribute("data-editing", this.on);
    $("do-edit").setAttribute("aria-pressed", String(this.on));
    $("maps").toggleAttribute("hidden", !this.on);
    $("panel").hidden = !this.on;
    if (this.on) this.show();
  }

  /** What a key does where no text is typed; whether it did anything. */
  key(event) {
    if ((event.ctrlKey || event.metaKey) && !event.altKey) return this.on && this.stepKey(event);
    if (event.altKey) return false;
    const key = event.key.length === 1 ? event.key.toLowerCase() : event.key, turn = event.shiftKey ? -1 : 1;
    if (key === "e") this.toggle();
    const count = this.state.code.rows.length, doing = this.doing();
    const acts = {
      __proto__: null, m: () => this.select((this.selected + turn + count) % count), a: doing.add, d: doing.copy,
      Delete: doing.remove, Backspace: doing.remove, f: () => this.flip(event.shiftKey), o: doing.import,
      x: doing.export,
    };
    this.hold = null;
    if (this.on && acts[key]) this.panel.attempt(acts[key]);
    return key === "e" || (this.on && key in acts);
  }

  stepKey({ key, shiftKey }) {
    const letter = key.toLowerCase();
    if (letter !== "z" && letter !== "y") return false;
    this.panel.attempt(() => this.step(letter === "y" || shiftKey ? "redo" : "undo"));
    return true;
  }

  // What is seen.

  window() {
    const { view, sides: [width, height] } = this.page.look();
    return windowOf(view, width, height);
  }

  /** Show the maps as they are, at the next frame. */
  show() {
    if (!this.on) return;
    this.asked ||= requestAnimationFrame(() => {
      this.asked = 0;
      const { code, box } = this.state, window = this.window();
      const held = this.hold?.box ?? boxAtHand(code.rows[this.selected], box, window);
      this.overlay.show(code.rows, this.selected, box, held, window, this.hold !== null);
      this.panel.show(code, this.selected, this.steps);
    });
  }

  select(i) {
    this.steps.rest();
    this.selected = i;
    this.show();
  }

  /** Select the map under a place on the screen, another one with every click. */
  pick(x, y) {
    const { code, box } = this.state, window = this.window(), { left, top } = this.surface.getBoundingClientRect();
    const found = mapAt([x - left, y - top], code.rows.map((row) => imageOf(row, box, window)), this.selected);
    if (found !== null) this.select(found);
  }

  // What changes.

  /** Throws Refused on a code whose maps do not even contract on average. */
  change(code, label = null) {
    plainCode(code.rows, code.probabilities);
    this.steps.push({ ...this.state, code }, label);
    this.drawn();
  }

  /** Draw the present state. */
  drawn() {
    this.selected = Math.min(this.selected, this.state.code.rows.length - 1);
    this.page.draw(this.state.code);
    this.show();
  }

  step(way) {
    const before = this.state;
    this.steps[way]();
    if (this.state === before) return;
    const { home, code } = this.state, moved = home !== before.home;
    if (moved || code.meta !== before.code.meta) this.page.open(moved ? home : null, code);
    this.drawn();
  }

  take(read) {
    const box = boxOf(read), home = homeOf(box);
    this.steps.push({ code: read, box, home });
    this.selected = 0;
    this.page.open(home, read);
    this.drawn();
  }

  /** Show a code from elsewhere: as one more step, or with no way back. The view stays if the code looks like the one
   * before with a change. A step leaves the map in a hand that drags it, and is undone together with the drag. */
  replace(code, { undoable = false } = {}) {
    const box = boxOf(code), home = homeOf(box), count = code.rows.length;
    if (!undoable || this.selected >= count) this.hold = null;
    const near = this.hold !== null || (count === this.state.code.rows.length && isNear(home, this.home()));
    const next = { code, box, home: near ? this.state.home : home };
    if (undoable) this.steps.push(next, this.hold && this.steps.label);
    else this.steps = new Steps(next);
    this.page.open(near ? null : home, code);
    this.drawn();
  }

  /** The view of the whole as it is now. */
  home() {
    const { code, home } = this.state;
    return this.steps.past.length ? homeOf(boxOf(code)) : home;
  }

  given() {
    const { code } = this.state;
    return { code, ...this.page.scene(boxOf(code)) };
  }

  /** Drag a handle of the selected map by some pixels, so far as the maps contract; where it stops, that is said. */
  bend({ kind, row, box, window, place, label }, [dx, dy], straight = false) {
    const { code } = this.state, to = (share) => [share * dx, share * dy];
    const make = (share) => withRow(code, this.selected, dragged(kind, row, box, place, to(share), window, straight));
    const share = shareThatContracts(make), made = make(share);
    this.panel.say(share === 1 ? "" : "Maps must contract on average: this one stops where they hardly do");
    if (made.rows[this.selected].every(Number.isFinite)) this.change(made, label);
  }

  // The overlay's hands.

  begin(kind) {
    const { code, box } = this.state, window = this.window(), row = code.rows[this.selected];
    const held = boxAtHand(row, box, window);
    this.moved = false;
    this.hold = { kind, row, box: held, window, place: places(imageOf(row, held, window), window)[kind], label: {} };
  }

  drag(dx, dy, straight) {
    if (!this.hold) return;
    if (!this.moved && Math.hypot(dx, dy) < CLICK) return;
    this.moved = true;
    this.bend(this.hold, [dx, dy], straight);
  }

  end() {
    this.hold = null;
    this.rest();
    this.show();
  }

  rest() {
    this.steps.rest();
  }

  /** A key moves a handle by some pixels; turning and scaling take only how far. */
  nudge(kind, dx, dy) {
    this.begin(kind);
    const { hold } = this, { row, box, window, place } = hold, middle = imageOf(row, box, window).centre;
    const x = place[0] - middle[0], y = place[1] - middle[1], along = (dx - dy) / Math.hypot(x, y);
    const by = { turn: [-y * along, x * along], scale: [x * along, y * along] }[kind] ?? [dx, dy];
    this.hold = null;
    this.bend({ ...hold, label: this.steps.label ?? hold.label }, by);
  }

  // The panel's.

  number(k, value) {
    const { code } = this.state;
    this.change(withRow(code, this.selected, code.rows[this.selected].with(k, value)));
  }

  chance(p) {
    const { code } = this.state;
    if (!(p >= 0 && p <= 1)) throw new Refused(`a probability is a number from 0 to 1, got ${p}`);
    if (code.rows.length === 1 && p !== 1) throw new Refused("the only map has the probability 1");
    this.change(withChance(code, this.selected, p));
  }

  byArea(yes) {
    this.change((yes ? withoutChances : withOwnChances)(this.state.code));
  }

  add() {
    const { code, box } = this.state;
    this.insert(withAdded(code, code.rows.length - 1, [NEW, 0, 0, NEW, (1 - NEW) * box.x, (1 - NEW) * box.y]),
      code.rows.length);
  }

  copy() {
    const { code, box } = this.state, [a, b, c, d, e, f] = code.rows[this.selected];
    const row = [a, b, c, d, e + ASIDE * box.hx, f - ASIDE * box.hy];
    this.insert(withAdded(code, this.selected, row, code.probabilities?.[this.selected]), this.selected + 1);
  }

  insert(code, at) {
    if (code.rows.length > MOST_MAPS) throw new Refused(`a code has at most ${MOST_MAPS} maps; remove another first`);
    this.change(code);
    this.select(at);
  }

  remove() {
    const { code } = this.state;
    if (code.rows.length === 1) throw new Refused("the last map stays: a code has at least one");
    this.change(withoutMap(code, this.selected));
  }

  flip(second = false) {
    const { code, box } = this.state;
    this.change(withRow(code, this.selected, flipped(code.rows[this.selected], box, second)));
  }
}
