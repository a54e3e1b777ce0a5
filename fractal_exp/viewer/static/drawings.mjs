// A drawing of the maps, to be looked at, not read back.

import { chancesOf } from "./code.mjs";
import { colourAt } from "./colours.mjs";
import { plain } from "./reading.mjs";

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
    const colour = colourOf(i, rows.length), [x, y] = first.split(",");
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

/** A map's colour: its place among all maps on the palette of the package's drawings. */
function colourOf(i, count) {
  const colour = colourAt("meadow", i / Math.max(count - 1, 1)).map((part) => Math.round(255 * part));
  return `#${colour.map((value) => value.toString(16).padStart(2, "0")).join("")}`;
}

/** A text in XML. */
function escaped(text) {
  return text.replace(/[&<>"']/g, (letter) => `&#${letter.charCodeAt(0)};`);
}
