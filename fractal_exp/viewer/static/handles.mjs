// The handles of a map: where they stand on the screen, and what a drag of each does to the map.
//
// A map is drawn as the image of a box, a parallelogram, with its centre c and half sides u, v. Where that is larger
// than the window, or aside, handles of a smaller box are taken, which the map sends to the window's middle: a map is
// affine, so it is changed just as well by them. That is how a map is bent at any depth.

import { about } from "./editing.mjs";

export const KINDS = {
  move: "Move", turn: "Turn", scale: "Scale", first: "Stretch and shear the first side",
  second: "Stretch and shear the second side",
};
const NEAREST = 36, FARTHEST = 0.4; // pixels from the centre, at least; share of the window's shorter side, at most
const KNOB = 34; // pixels from the second side to the handle that turns
const SMALL = 0.16; // half sides of the smaller box's image, as a share of the window's shorter side
const FLAT = 1e-3; // ratio of singular values below which a map is taken for one onto a line
const STEEP = Math.sin((20 * Math.PI) / 180); // of the angle between two sides, below which their handles are set apart
const EDGE = 18, TITLE = 44, BAR = 64; // pixels at a window's sides, top and bottom that handles keep free if they can
const OPPOSITE = -0.5; // cosine from which on a handle stands at the other end of its side
const LEAST_SCALE = 0.02; // of one drag
const NOTCH = Math.PI / 12; // between turns with Shift

/** The image of a box about {x, y} with half sides hx, hy: its centre [x, y] and half sides u, v in pixels. */
export function imageOf([a, b, c, d, e, f], { x, y, hx, hy }, { left, top, scale }) {
  return {
    centre: [(a * x + b * y + e - left) * scale, (top - (c * x + d * y + f)) * scale],
    u: [a * hx * scale, -c * hx * scale], v: [b * hy * scale, -d * hy * scale],
  };
}

/** The corners of an image, from that of the lower left one on. */
export function corners({ centre: [x, y], u, v }) {
  return [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([s, t]) => [x + s * u[0] + t * v[0], y + s * u[1] + t * v[1]]);
}

/** The box by whose image a map is held in a window: the given one, or a smaller one where its image is not at hand. */
export function boxAtHand(row, box, window) {
  const { centre: [x, y], u, v } = imageOf(row, box, window), { left, top, scale, width, height } = window;
  const reach = Math.max(Math.abs(u[0]) + Math.abs(v[0]), Math.abs(u[1]) + Math.abs(v[1]));
  const inside = x >= 0 && x <= width && y >= 0 && y <= height;
  if (inside && reach <= Math.max(width, height)) return box;
  const longest = Math.max(Math.hypot(...u), Math.hypot(...v));
  const factor = longest > 0 ? (SMALL * Math.min(width, height)) / longest : 1;
  const at = preimage(row, { x: left + width / 2 / scale, y: top - height / 2 / scale }, box);
  return { ...at, hx: box.hx * factor, hy: box.hy * factor };
}

/** A point that a map sends to `to`, or as near as it can: {x, y}. */
function preimage([a, b, c, d, e, f], to, box) {
  const p = to.x - (a * box.x + b * box.y + e), q = to.y - (c * box.x + d * box.y + f);
  const det = a * d - b * c, norm = a * a + b * b + c * c + d * d;
  if (norm === 0) return { x: box.x, y: box.y };
  const [x, y] = Math.abs(det) > FLAT * norm ? [(d * p - b * q) / det, (a * q - c * p) / det]
    : [(a * p + c * q) / norm, (b * p + d * q) / norm]; // of a matrix of rank 1, its transpose over its norm
  return { x: box.x + x, y: box.y + y };
}

/** Where the handles of an image stand, {kind: [x, y]}: far enough from each other to be taken, near enough to be seen.
 * ends: of both sides, which of the two has the handles, as `endsOf` finds them. */
export function places(image, window, ends = endsOf(image, window)) {
  return standing(image, window)[ends];
}

/** At which ends of its sides an image has more handles in the window: a number for `places`. */
export function endsOf(image, window) {
  const free = ([x, y]) => x >= EDGE && x <= window.width - EDGE && y >= TITLE && y <= window.height - BAR;
  const seen = standing(image, window).map((stands) => Object.values(stands).filter(free).length);
  return seen.indexOf(Math.max(...seen));
}

function standing({ centre: [x, y], u, v }, { width, height }) {
  const most = Math.max(NEAREST, FARTHEST * Math.min(width, height));
  const flatU = Math.hypot(...u) < 1e-6, flatV = Math.hypot(...v) < 1e-6;
  const first = held(flatU ? (flatV ? [1, 0] : [-v[1], v[0]]) : u, most);
  let second = held(flatV ? [first[1], -first[0]] : v, most);
  const lengths = Math.hypot(...first) * Math.hypot(...second);
  if (Math.abs(first[0] * second[1] - first[1] * second[0]) < STEEP * lengths) second = [first[1], -first[0]];
  const above = 1 + KNOB / Math.hypot(...second);
  return [[1, 1], [1, -1], [-1, 1], [-1, -1]].map(([s, t]) => {
    const at = (p, q) => [x + s * p * first[0] + t * q * second[0], y + s * p * first[1] + t * q * second[1]];
    return { move: [x, y], turn: at(0, above), scale: at(1, 1), first: at(1, 0), second: at(0, 1) };
  });
}

/** A vector made as long as a handle may be away. */
function held(vector, most) {
  const length = Math.hypot(...vector), factor = Math.min(Math.max(length, NEAREST), most) / length;
  return vector.map((part) => part * factor);
}

/**
 * The row of a map after a handle of it was dragged by [dx, dy] pixels from `place`, where it stood. box: the one by
 * whose image the map is held; straight: with Shift, a turn in steps of 15 degrees and a side that keeps its direction.
 */
export function dragged(kind, row, box, place, [dx, dy], { left, top, scale }, straight = false) {
  const [a, b, c, d, e, f] = row;
  if (kind === "move") return [a, b, c, d, e + dx / scale, f - dy / scale];
  const { centre, u, v } = imageOf(row, box, { left, top, scale });
  const from = [place[0] - centre[0], place[1] - centre[1]], to = [from[0] + dx, from[1] + dy];
  return about(row, box, CHANGES[kind]({ row, from, to, u, v, box, scale, by: [dx, dy], straight }));
}

// What each handle makes of the matrix. from, to: its places about the centre, in pixels with y downwards.
const CHANGES = {
  turn({ row: [a, b, c, d], from, to, straight }) {
    const angle = Math.atan2(from[1], from[0]) - Math.atan2(to[1], to[0]);
    const turn = straight ? Math.round(angle / NOTCH) * NOTCH : angle, x = Math.cos(turn), y = Math.sin(turn);
    return [x * a - y * c, x * b - y * d, y * a + x * c, y * b + x * d];
  },
  scale({ row, from, to }) {
    const along = (from[0] * to[0] + from[1] * to[1]) / (from[0] ** 2 + from[1] ** 2);
    return row.slice(0, 4).map((number) => number * Math.max(along, LEAST_SCALE));
  },
  first({ row: [, b, , d], u, from, by, box, scale, straight }) {
    const [x, y] = moved(u, from, by, straight);
    return [x / scale / box.hx, b, -y / scale / box.hx, d];
  },
  second({ row: [a, , c], v, from, by, box, scale, straight }) {
    const [x, y] = moved(v, from, by, straight);
    return [a, x / scale / box.hy, c, -y / scale / box.hy];
  },
};

/** A side after the end of it where the handle stands was moved, in its own direction alone if it is to stay straight. */
function moved(side, from, by, straight) {
  const dot = (one, other) => one[0] * other[0] + one[1] * other[1], square = dot(side, side);
  const end = dot(from, side) < OPPOSITE * Math.hypot(...from) * Math.sqrt(square) ? -1 : 1;
  if (straight && square > 0) return side.map((part) => part * (1 + (end * dot(side, by)) / square));
  return [side[0] + end * by[0], side[1] + end * by[1]];
}

/** The map whose parallelogram holds a point: the smallest one, or the next larger after the one that is selected. */
export function mapAt([x, y], images, selected) {
  const areaOf = ({ u, v }) => Math.abs(u[0] * v[1] - u[1] * v[0]);
  const held = images.map((image, i) => ({ i, area: areaOf(image), image }))
    .filter(({ image, area }) => holds(image, area, x, y)).sort((one, other) => one.area - other.area);
  const at = held.findIndex(({ i }) => i === selected);
  return held.length ? held[(at + 1) % held.length].i : null;
}

/** Whether a point lies in an image, or within some pixels of one that is flat. */
function holds({ centre, u, v }, area, x, y) {
  const px = x - centre[0], py = y - centre[1], near = 5 * (Math.hypot(...u) + Math.hypot(...v));
  if (area === 0 && near === 0) return Math.hypot(px, py) < 10;
  const across = Math.abs(px * v[1] - py * v[0]), along = Math.abs(px * u[1] - py * u[0]);
  const reach = Math.hypot(Math.abs(u[0]) + Math.abs(v[0]), Math.abs(u[1]) + Math.abs(v[1])) + 5;
  return across <= Math.max(area, near) && along <= Math.max(area, near) && Math.hypot(px, py) <= reach;
}

/** The part of a polygon that lies in a window, a margin around it: for corners that are too far to be drawn. */
export function clipped(polygon, { width, height }, margin = 60) {
  const edges = [[1, 0, margin], [-1, 0, width + margin], [0, 1, margin], [0, -1, height + margin]];
  return edges.reduce((points, [p, q, r]) => points.flatMap((point, i) => {
    const before = points.at(i - 1), inside = p * point[0] + q * point[1] + r, was = p * before[0] + q * before[1] + r;
    const t = was / (was - inside);
    const cross = [before[0] + t * (point[0] - before[0]), before[1] + t * (point[1] - before[1])];
    return [...(inside >= 0 !== was >= 0 ? [cross] : []), ...(inside >= 0 ? [point] : [])];
  }), polygon);
}
