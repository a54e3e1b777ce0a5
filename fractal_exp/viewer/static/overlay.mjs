// The maps over the picture, as parallelograms, and the handles of the one that is selected.

import { KINDS, clipped, corners, endsOf, imageOf, places } from "./handles.mjs";

export const COLOURS = 6; // of maps, in page.css
const MANY = 12; // maps, beyond which those that are not selected are outlines alone
const STEP = 2, LEAP = 20; // pixels of an arrow key, and with Shift
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
const ALONG = "M-6 0H6M3-3 6 0 3 3M-3-3-6 0-3 3";
const SHAPES = { // about the handle's middle
  move: "M0-9V9M-9 0H9M-3-6 0-9 3-6M-3 6 0 9 3 6M-6-3-9 0-6 3M6-3 9 0 6 3",
  turn: "M5-5A7 7 0 1 0 7 1M7-7V-3H3",
  scale: "M-5-5 5 5M1 5H5V1M-1-5H-5V-1", first: ALONG, second: ALONG,
};

/**
 * Draws maps into an svg element. hands: begin(kind), drag(dx, dy, straight) in pixels from the beginning, end(),
 * nudge(kind, dx, dy) for keys, and rest() when those are done.
 */
export class Overlay {
  constructor(svg, surface, hands) {
    Object.assign(this, { svg, hands, bodies: [], shown: -1 });
    [this.lower, this.upper] = [this.make("g", svg, { class: "bodies" }), this.make("g", svg)];
    this.line = this.make("polygon", this.upper, { class: "held" });
    this.stem = this.make("path", this.upper, { class: "stem" });
    this.handles = Object.fromEntries(Object.keys(KINDS).map((kind) => [kind, this.handle(kind)]));
    this.listen(this.line, "move");
    svg.addEventListener("wheel", (event) => {
      event.preventDefault();
      surface.dispatchEvent(new WheelEvent("wheel", event));
    }, { passive: false });
  }

  make(name, parent, attributes = {}) {
    const made = document.createElementNS(this.svg.namespaceURI, name);
    for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
    parent.append(made);
    return made;
  }

  handle(kind) {
    const handle = this.make("g", this.upper, { class: "handle", id: `handle-${kind}`, tabindex: 0, role: "button" });
    this.make("circle", handle, { class: "reach", r: 16 });
    this.make("circle", handle, { class: "plate", r: 12 });
    this.make("path", handle, { d: SHAPES[kind] });
    this.make("title", handle).textContent = `${KINDS[kind]} (drag, or arrow keys)`;
    handle.addEventListener("keydown", (event) => {
      const arrow = ARROWS[event.key];
      if (!arrow || event.ctrlKey || event.metaKey || event.altKey) return;
      event.preventDefault();
      event.stopPropagation();
      this.hands.nudge(kind, ...arrow.map((part) => part * (event.shiftKey ? LEAP : STEP)));
    });
    handle.addEventListener("blur", () => this.hands.rest());
    this.listen(handle, kind);
    return handle;
  }

  /** Listen to one pointer that drags an element; another one meanwhile is none of its business. */
  listen(element, kind) {
    let held = null;
    element.addEventListener("pointerdown", (event) => {
      if (event.button > 0 || held) return;
      event.preventDefault();
      element.setPointerCapture(event.pointerId);
      held = { pointer: event.pointerId, x: event.clientX, y: event.clientY };
      this.hands.begin(kind);
    });
    element.addEventListener("pointermove", (event) => {
      if (held?.pointer !== event.pointerId) return;
      this.hands.drag(event.clientX - held.x, event.clientY - held.y, event.shiftKey);
    });
    for (const end of ["pointerup", "pointercancel", "lostpointercapture"]) {
      element.addEventListener(end, (event) => {
        if (held?.pointer !== event.pointerId) return;
        held = null;
        this.hands.end();
      });
    }
  }

  /** Show the rows' images of `box` in a window; the selected one with its handles, which hold it by `boxAtHand`. While
   * one of them is held, they stay at the ends where they are. */
  show(rows, selected, box, boxAtHand, window, held) {
    while (this.bodies.length > rows.length) this.bodies.pop().group.remove();
    while (this.bodies.length < rows.length) this.bodies.push(this.body(this.bodies.length));
    rows.forEach((row, i) => this.place(this.bodies[i], imageOf(row, box, window), window, i === selected));
    const image = imageOf(rows[selected], boxAtHand, window);
    if (!held) this.ends = endsOf(image, window);
    const at = places(image, window, this.ends);
    this.line.setAttribute("points", clipped(corners(image), window).map(pair).join(" "));
    this.line.classList.toggle("smaller", boxAtHand !== box);
    this.stem.setAttribute("d", `M${pair(at.move)}L${pair(at.turn)}M${pair(at.first)}L${pair(at.move)}`);
    for (const [kind, handle] of Object.entries(this.handles)) {
      handle.setAttribute("transform", `translate(${pair(at[kind])})${turned(kind, at)}`);
    }
    this.lower.classList.toggle("many", rows.length > MANY);
    if (this.shown === selected) return;
    this.shown = selected;
    this.lower.append(this.bodies[selected].group); // above the others
    this.upper.setAttribute("class", `map map-${selected % COLOURS}`);
    for (const [kind, handle] of Object.entries(this.handles)) {
      handle.setAttribute("aria-label", `${KINDS[kind]}: map ${selected + 1}, arrow keys`);
    }
  }

  body(i) {
    const group = this.make("g", this.lower, { class: `map map-${i % COLOURS}` });
    const parts = {
      group, halo: this.make("polygon", group, { class: "halo" }), area: this.make("polygon", group),
      side: this.make("polyline", group), corner: this.make("circle", group, { r: 5 }),
      number: this.make("text", group),
    };
    parts.number.textContent = i + 1;
    return parts;
  }

  place({ group, halo, area, side, corner, number }, image, window, selected) {
    const all = corners(image), shape = clipped(all, window).map(pair).join(" ");
    group.classList.toggle("selected", selected);
    halo.setAttribute("points", shape);
    area.setAttribute("points", shape);
    side.setAttribute("points", clipped(all.slice(0, 2), window).map(pair).join(" "));
    corner.setAttribute("transform", `translate(${pair(near(all[0]))})`);
    number.setAttribute("transform", `translate(${pair(near(image.centre))})`);
  }
}

/** The arrows of the handles on the sides, and of the one at the corner, along what they stretch. */
function turned(kind, { move, [kind]: [x, y] }) {
  if (kind === "move" || kind === "turn") return "";
  const angle = (Math.atan2(y - move[1], x - move[0]) * 180) / Math.PI;
  return ` rotate(${(angle - (kind === "scale" ? 45 : 0)).toFixed(1)})`;
}

/** A place that is no farther than a browser can draw. */
function near(place) {
  return place.map((part) => Math.max(-1e5, Math.min(1e5, part)));
}

function pair([x, y]) {
  return `${x.toFixed(2)},${y.toFixed(2)}`;
}
