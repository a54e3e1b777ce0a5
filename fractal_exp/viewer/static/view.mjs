// Views and what moves them. A view is {x, y, zoom}: its shorter side reaches from -1/zoom to 1/zoom about (x, y), as a
// View of the Python package does. All of it is done in doubles.

const FRAME_SIDE = 1.5; // of the canvas, the longer side of what is framed
export const MOST_ZOOM = 1e12; // beyond, a pixel is no longer large against the rounding of a double

/** The window of a view on a picture of width × height pixels: the upper left corner, and pixels to a unit. */
export function windowOf(view, width, height) {
  const scale = (Math.min(width, height) * view.zoom) / 2;
  return { left: view.x - width / 2 / scale, top: view.y + height / 2 / scale, scale, width, height };
}

/** The view after the picture was dragged by so many pixels. */
export function panned(view, byX, byY, width, height) {
  const { scale } = windowOf(view, width, height);
  return { ...view, x: view.x - byX / scale, y: view.y + byY / scale };
}

/** The view that is `factor` times closer, with the point under the pixel (column, row) left where it is. */
export function zoomed(view, factor, column, row, width, height, least) {
  const zoom = Math.min(Math.max(view.zoom * factor, least), MOST_ZOOM);
  const half = Math.min(width, height) / 2, gain = 1 / view.zoom - 1 / zoom;
  return { x: view.x + ((column - width / 2) / half) * gain, y: view.y - ((row - height / 2) / half) * gain, zoom };
}

/** The view a share t in [0,1] of the way from one to another: the zoom by its logarithm, and the middle so that the
 * point that both views show at one place stays there. */
export function between(from, to, t) {
  const zoom = from.zoom * (to.zoom / from.zoom) ** t;
  const whole = 1 / to.zoom - 1 / from.zoom;
  const share = Math.abs(whole) * Math.min(from.zoom, to.zoom) < 1e-9 ? t : (1 / zoom - 1 / from.zoom) / whole;
  return t >= 1 ? to : { x: from.x + (to.x - from.x) * share, y: from.y + (to.y - from.y) * share, zoom };
}

/** The fragment of a link to a view. */
export function toFragment({ x, y, zoom }) {
  return `#x=${x}&y=${y}&zoom=${zoom}`;
}

/** The view of a fragment, or null where it names none. */
export function fromFragment(fragment, least) {
  const given = new URLSearchParams(fragment.replace(/^#/, ""));
  const [x, y, zoom] = ["x", "y", "zoom"].map((name) => (given.get(name)?.trim() ? Number(given.get(name)) : NaN));
  if (![x, y, zoom].every(Number.isFinite) || zoom <= 0 || Math.max(Math.abs(x), Math.abs(y)) > 1e30) return null;
  return { x, y, zoom: Math.min(Math.max(zoom, least), MOST_ZOOM) };
}

/** A zoom in few characters: 1, 3.5, 64, 12 300, 1.2 million. */
export function shownZoom(zoom) {
  const units = [[1e12, " trillion"], [1e9, " billion"], [1e6, " million"]];
  const [size, unit] = units.find(([least]) => zoom >= least * 0.9995) ?? [1, ""];
  const value = zoom / size;
  const digits = value >= 100 ? 0 : value >= 10 ? 1 : 2;
  const text = value < 0.01 ? value.toPrecision(2) : String(Number(value.toFixed(digits)));
  return text.replace(/\B(?=(\d{3})+$)/g, "\u202f") + unit;
}

/** Letters of an address as text, maps counted from 1, runs shortened: 2¹² 3 1. */
export function shownAddress(letters) {
  const parts = [];
  for (let k = 0, run; k < letters.length; k += run) {
    for (run = 1; letters[k + run] === letters[k]; ) run += 1;
    const power = String(run).replace(/\d/g, (digit) => "⁰¹²³⁴⁵⁶⁷⁸⁹"[digit]);
    parts.push(run > 2 ? `${letters[k] + 1}${power}` : Array(run).fill(letters[k] + 1).join(" "));
  }
  return parts.join(" ");
}

/** The view in which the longer side of a box {x, y, hx, hy} spans three quarters; the canvas itself if it is that. */
export function homeOf({ x, y, hx, hy }) {
  const zoom = FRAME_SIDE / 2 / Math.max(hx, hy);
  const isCanvas = Math.abs(zoom - 1) < 1e-3 && Math.max(Math.abs(x), Math.abs(y)) < 1e-3;
  return isCanvas ? { x: 0, y: 0, zoom: 1 } : { x, y, zoom };
}

/** Whether two views show about the same place: neither is twice as large, and each holds the other's middle. */
export function isNear(one, other) {
  const apart = Math.max(Math.abs(one.x - other.x), Math.abs(one.y - other.y));
  const [far, close] = [one.zoom, other.zoom].sort((a, b) => a - b);
  return close < 2 * far && apart * close < 1;
}
