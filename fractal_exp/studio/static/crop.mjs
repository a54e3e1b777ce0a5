// The part of the picture that is read: dragged over the picture as it was given, or typed in pixels of it.

const LEAST_DRAG = 4; // CSS pixels on each side; less is a click that slipped

const $ = (id) => document.getElementById(id);
const field = (name) => $(`part-${name}`);
const FIELDS = ["left", "top", "width", "height"];

const place = (rect, [x0, y0, x1, y1]) => {
  const sides = { x: x0, y: y0, width: x1 - x0, height: y1 - y0 };
  for (const [name, value] of Object.entries(sides)) rect.setAttribute(name, value);
};

/** part: [left, top, right, bottom] in pixels of the picture, null for all of it; chosen() is called when hands have
    changed it. */
export class Crop {
  constructor(chosen) {
    Object.assign(this, { chosen, part: null, size: [1, 1], from: null });
    const { svg } = this;
    svg.addEventListener("pointerdown", (event) => this.begin(event));
    svg.addEventListener("pointermove", (event) => this.drag(event));
    svg.addEventListener("pointerup", (event) => this.end(event));
    svg.addEventListener("pointercancel", () => this.forget());
    addEventListener("keydown", ({ key }) => key === "Escape" && this.forget());
    $("part-fields").addEventListener("change", () => this.type());
    $("part-all").addEventListener("click", () => this.choose([0, 0, ...this.size]));
  }

  get svg() {
    return $("crop");
  }

  /** Show a picture of `size`, the square of it that fills the canvas, and the part that was read. */
  show(size, square, part) {
    Object.assign(this, { size, part });
    this.svg.setAttribute("viewBox", `0 0 ${size[0]} ${size[1]}`);
    $("frame").style.setProperty("--ratio", size[0] / size[1]);
    place($("square"), square);
    this.forget();
  }

  /** Draw a part, and write its numbers into the fields. */
  draw(part) {
    const [width, height] = this.size, [x0, y0, x1, y1] = part ?? [0, 0, width, height];
    place($("part"), [x0, y0, x1, y1]);
    this.svg.firstElementChild.setAttribute("d", `M0 0H${width}V${height}H0Z M${x0} ${y0}H${x1}V${y1}H${x0}Z`);
    [x0, y0, x1 - x0, y1 - y0].forEach((value, i) => { field(FIELDS[i]).value = value; });
    [width - 1, height - 1, width, height].forEach((most, i) => {
      Object.assign(field(FIELDS[i]), { min: i < 2 ? 0 : 1, max: most });
    });
    $("part-all").disabled = !part;
  }

  choose(part) {
    const [width, height] = this.size, [x0, y0, x1, y1] = part;
    this.part = x0 === 0 && y0 === 0 && x1 === width && y1 === height ? null : part;
    this.draw(this.part);
    this.chosen();
  }

  // By mouse, pen or finger.

  begin(event) {
    if (event.button !== 0 || !event.isPrimary || $("reading").disabled) return;
    event.preventDefault();
    this.svg.setPointerCapture(event.pointerId);
    this.from = event;
  }

  drag(event) {
    const part = this.dragged(event);
    if (part) this.draw(part);
  }

  end(event) {
    const part = this.dragged(event);
    this.forget();
    if (part) this.choose(part);
  }

  /** Draw again what is read, whatever was being dragged. */
  forget() {
    this.from = null;
    this.draw(this.part);
  }

  /** The part between where the pointer went down and where it is, in whole pixels of the picture. */
  dragged({ clientX, clientY }) {
    if (!this.from) return null;
    const ends = [this.from, { clientX, clientY }], box = this.svg.getBoundingClientRect();
    const [across, down] = [clientX - this.from.clientX, clientY - this.from.clientY].map(Math.abs);
    if (Math.min(across, down) < LEAST_DRAG) return null;
    const within = (value, most) => Math.min(Math.max(value, 0), most), [width, height] = this.size;
    const columns = ends.map(({ clientX: x }) => within(((x - box.left) / box.width) * width, width));
    const rows = ends.map(({ clientY: y }) => within(((y - box.top) / box.height) * height, height));
    return [Math.min(...columns), Math.min(...rows), Math.max(...columns), Math.max(...rows)].map(Math.round);
  }

  // By keyboard.

  /** Take the numbers in the fields. A part that would leave the picture is made narrower, or lower. */
  type() {
    if (!FIELDS.every((name) => field(name).reportValidity())) return;
    const [left, top, width, height] = FIELDS.map((name) => field(name).valueAsNumber);
    this.choose([left, top, Math.min(left + width, this.size[0]), Math.min(top + height, this.size[1])]);
  }
}
