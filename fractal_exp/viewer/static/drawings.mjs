// What is written to be looked at, not read back: a drawing of the maps, and points.

import { chancesOf } from "./code.mjs";
import { foldsOf, meanColour } from "./colours.mjs";
import { escaped, hexadecimal, ramp } from "./flame.mjs";
import { plain } from "./reading.mjs";

export const POINTS = 200_000; // of a PLY file
const WARM_UP = 256, VERTEX = 15; // steps of a chaos game; bytes of a point
const PIXELS = 768; // the shorter side of a drawing

/**
 * An SVG of what is seen with the images of the box under the maps over it: a dot marks the image of the box's lower
 * left corner, and a thick side that of its lower side. scene: {view, width, height, picture, box, namespace},
 * picture() being an address of its data.
 */
export function writeSvg({ rows, probabilities, meta }, { view, width, height, picture, box, namespace }) {
  const chances = chancesOf(rows, probabilities), half = 1 / view.zoom, shorter = Math.min(width, height);
  const [w, h] = [width / shorter, height / shorter].map((side) => 2 * half * side);
  const frame = `x="${nine(view.x - w / 2)}" y="${nine(-view.y - h / 2)}" width="${nine(w)}" height="${nine(h)}"`;
  const maps = rows.map((row, i) => {
    const [first, second, ...rest] = cornersOf(row, box).map(([x, y]) => `${nine(x)},${nine(0 - y)}`);
    const colour = `#${hexadecimal(ramp(i / Math.max(rows.length - 1, 1)))}`, [x, y] = first.split(",");
    return `<g stroke="${colour}" fill="${colour}"><title>map ${i + 1}: probability ${nine(chances[i])}</title>`
      + `<polygon points="${[first, second, ...rest].join(" ")}" fill-opacity="0.15"/>`
      + `<polyline points="${first} ${second}" stroke-width="${nine(half / 80)}"/>`
      + `<circle cx="${x}" cy="${y}" r="${nine(half / 60)}"/></g>`;
  });
  return `<?xml version="1.0" encoding="UTF-8"?>
<svg xmlns="${namespace}" viewBox="${[view.x - w / 2, -view.y - h / 2, w, h].map(nine).join(" ")}" width="${
  Math.round((PIXELS * width) / shorter)}" height="${Math.round((PIXELS * height) / shorter)}">
<title>${escaped(plain(meta.title) || plain(meta.name) || "a code")}</title>
<image ${frame} href="${picture()}"/>
<g stroke-linejoin="round" stroke-width="${nine(half / 160)}">
${maps.join("\n")}
</g>
</svg>
`;
}

/** The corners [x, y] of the box's image under a map, from the lower left one on. */
export function cornersOf([a, b, c, d, e, f], { x, y, hx, hy }) {
  return [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([s, t]) => {
    const p = x + s * hx, q = y + t * hy;
    return [a * p + b * q + e, c * p + d * q + f];
  });
}

function nine(number) {
  return Number(number.toPrecision(9));
}

/**
 * Binary PLY, as bytes: points of the chaos game at z = 0, in the code's own colours, or else in those of the maps that
 * led to them.
 */
export function writePly({ rows, probabilities, meta, colours = null }, { random }, count = POINTS) {
  const name = plain(meta.name).replace(/[^ -~]/g, "?");
  const header = new TextEncoder().encode(["ply", "format binary_little_endian 1.0",
    `comment ${name || "attractor"}, by fractal-exp`, `element vertex ${count}`,
    ...["x", "y", "z"].map((axis) => `property float ${axis}`),
    ...["red", "green", "blue"].map((channel) => `property uchar ${channel}`), "end_header", ""].join("\n"));
  const bytes = new Uint8Array(header.length + VERTEX * count), data = new DataView(bytes.buffer, header.length);
  bytes.set(header);
  const chances = chancesOf(rows, probabilities), own = foldsOf({ rows, colours }, { by: "own" });
  const byMap = rows.map((_, i) => ramp(i / Math.max(rows.length - 1, 1)));
  const colour = own && meanColour(own, chances);
  for (let k = -WARM_UP, x = 0, y = 0; k < count; k++) {
    const i = drawn(chances, random()), [a, b, c, d, e, f] = rows[i];
    [x, y] = [a * x + b * y + e, c * x + d * y + f];
    colour?.forEach((value, channel) => { colour[channel] = own.keep[i] * value + own.gift[3 * i + channel]; });
    if (k < 0) continue;
    data.setFloat32(VERTEX * k, x, true);
    data.setFloat32(VERTEX * k + 4, y, true);
    const shown = colour?.map((value) => Math.round(255 * value)) ?? byMap[i];
    shown.forEach((value, channel) => data.setUint8(VERTEX * k + 12 + channel, value));
  }
  return bytes;
}

/** A map by lot; the last that can be drawn where rounding leaves the lot beyond all. */
function drawn(chances, lot) {
  let last = 0;
  for (let i = 0; i < chances.length; i++) {
    if (chances[i] === 0) continue;
    last = i;
    if (lot < chances[i]) break;
    lot -= chances[i];
  }
  return last;
}
