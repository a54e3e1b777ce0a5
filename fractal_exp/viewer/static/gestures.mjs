// What hands do on the picture, as moves: pan(pixels), zoom(factor, column, row, smooth) and keys by their meaning.

const WHEEL = 0.0022; // of a wheel's pixels in the logarithm of the zoom
const LINE = 33, PAGE = 400; // pixels that a wheel's line and page stand for
const PAN_STEP = 0.12; // of the shorter side, for an arrow key
const STEP = 1.5, LEAP = 8, DOUBLE = 3; // zoom factors of + and -, page keys, a double click

/** Listen to mouse, touch and pen on `surface`; `moves` has pan(dx, dy) and zoom(factor, column, row, smooth). */
export function listenToPointers(surface, moves) {
  const down = new Map();
  const at = (event) => {
    const box = surface.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  };
  surface.addEventListener("pointerdown", (event) => {
    if (event.button > 0) return;
    surface.setPointerCapture(event.pointerId);
    down.set(event.pointerId, at(event));
  });
  surface.addEventListener("pointermove", (event) => {
    if (!down.has(event.pointerId)) return;
    const before = gathered(down);
    down.set(event.pointerId, at(event));
    const now = gathered(down);
    moves.pan(now.x - before.x, now.y - before.y);
    if (before.spread > 0 && now.spread > 0) moves.zoom(now.spread / before.spread, now.x, now.y, false);
  });
  for (const end of ["pointerup", "pointercancel", "lostpointercapture"]) {
    surface.addEventListener(end, (event) => down.delete(event.pointerId));
  }
  surface.addEventListener("dblclick", (event) => moves.zoom(event.shiftKey ? 1 / DOUBLE : DOUBLE, ...at(event), true));
  surface.addEventListener("wheel", (event) => {
    event.preventDefault();
    const pixels = event.deltaY * [1, LINE, PAGE][event.deltaMode];
    const gentle = event.ctrlKey ? 4 : 1; // a pinch on a touchpad comes as a wheel with small steps
    moves.zoom(Math.exp(-WHEEL * gentle * pixels), ...at(event), false);
  }, { passive: false });
}

/** The middle of the pointers that are down, and how far they lie from it in the mean. */
function gathered(down) {
  const places = [...down.values()];
  const [x, y] = [0, 1].map((axis) => places.reduce((sum, place) => sum + place[axis], 0) / places.length);
  const spread = places.reduce((sum, place) => sum + Math.hypot(place[0] - x, place[1] - y), 0) / places.length;
  return { x, y, spread };
}

/** What a key does: a function of the moves and of the surface's width and height, or undefined. */
export function keyMove(event) {
  if (event.ctrlKey || event.metaKey || event.altKey) return undefined;
  const closer = (factor) => (moves, width, height) => moves.zoom(factor, width / 2, height / 2, true);
  const pan = (x, y) => (moves, width, height) => {
    const step = PAN_STEP * Math.min(width, height) * (event.shiftKey ? 4 : 1);
    moves.pan(x * step, y * step);
  };
  return {
    __proto__: null,
    ArrowLeft: pan(1, 0), ArrowRight: pan(-1, 0), ArrowUp: pan(0, 1), ArrowDown: pan(0, -1),
    "+": closer(STEP), "=": closer(STEP), "-": closer(1 / STEP), _: closer(1 / STEP),
    PageUp: closer(LEAP), PageDown: closer(1 / LEAP), Home: (moves) => moves.home(), 0: (moves) => moves.home(),
    i: (moves) => moves.swap(), s: (moves) => moves.save(), c: (moves) => moves.link(), "?": (moves) => moves.help(),
    h: (moves) => moves.help(), p: (moves) => moves.colour(),
  }[event.key.length === 1 ? event.key.toLowerCase() : event.key];
}
