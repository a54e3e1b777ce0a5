// flam3's .flame files, read if all maps are affine, and written with weights, camera, palette and colours.

import { Refused, chancesOf, checkCount } from "./code.mjs";
import { shortest } from "./json.mjs";
import { named, numberOf, numbersOf, plain, weighted, wordsOf } from "./reading.mjs";
import { parseXml } from "./xml.mjs";

const SIZE = 1024, COLOURS = 256;
// Attributes of an xform that leave the points where they are. All others are variations, or their parameters.
const HARMLESS = new Set(["weight", "coefs", "post", "linear", "opacity", "plotmode", "chaos", "color", "color_speed",
  "symmetry", "var_color", "animate", "name"]);
const COLOURING = new Set(["palette", "color", "colors"]);
const LOOK = 'supersample="2" filter="0.1" filter_shape="gaussian" quality="48" background="0 0 0" brightness="4" '
  + 'gamma="4" gamma_threshold="0.01" vibrancy="1" estimator_radius="0" estimator_minimum="0" estimator_curve="0.4" '
  + 'palette_mode="linear" interpolation="linear"';
const ANCHORS = [[38, 110, 214], [18, 164, 150], [96, 188, 64], [240, 178, 36], [232, 98, 60], [196, 60, 140]];

/** The codes of a file, [{name, read}]; see the package's class FlameFile. Throws Refused on what is no XML. */
export function readFlame(text) {
  const flames = [], path = [];
  let depth = 0; // of the flame that is open
  parseXml(text, {
    start(name, attributes) {
      path.push(name);
      if (path.includes("edit")) return; // the history, with all that stands in it
      if (name === "flame") {
        if (depth) throw new Refused("a <flame> stands in another; put them beside each other");
        depth = path.length;
        flames.push({ attributes, xforms: [], final: null, problem: null });
      } else if (depth) take(flames.at(-1), path.slice(depth), attributes);
    },
    end() {
      if (path.length === depth) depth = 0;
      path.pop();
    },
  });
  return flames.map((flame) => ({ name: plain(flame.attributes.get("name")) || null, read: () => codeOf(flame) }));
}

function take(flame, [first, ...rest], attributes) {
  const direct = rest.length === 0;
  if (direct && first === "xform") {
    checkCount(flame.xforms.push(attributes));
  } else if (direct && first === "finalxform" && !flame.final) {
    flame.final = attributes;
  } else if (!(direct && COLOURING.has(first))) {
    const what = `has ${direct && first === "finalxform" ? "a second " : ""}<${plain(rest.at(-1) ?? first, 40)}>`;
    flame.problem ??= `${what}, which a code cannot hold; remove it, or write out the maps that it stands for`;
  }
}

function codeOf({ attributes, xforms, final, problem }) {
  const name = plain(attributes.get("name"));
  return named(name ? `flame '${name}'` : "flame", () => {
    if (problem) throw new Refused(problem);
    const weights = xforms.map((xform) => numberOf(xform.get("weight") ?? "0", "a weight"));
    const affine = xforms.map((xform, i) => affineOf(xform, `xform ${i + 1}`));
    const through = final ? conjugation(affineOf(final, "finalxform")) : (map) => map;
    const rows = affine.map(through).map(upright);
    return weighted(rows, weights.length ? weights : null, { ...(name ? { name } : {}), camera: cameraOf(attributes) });
  });
}

/** A row a b c d e f of an xform, y downwards. Throws Refused that names what is not affine. */
function affineOf(xform, what) {
  for (const key of [...xform.keys()].filter((each) => !HARMLESS.has(each)).sort()) {
    if (isZero(xform.get(key))) continue;
    throw new Refused(`${what} has the variation or parameter '${plain(key, 40)}'; only 'linear' is affine and read, `
      + "so set the others to 0");
  }
  if (wordsOf(xform.get("chaos") ?? "").some((word) => numberOf(word, `chaos of ${what}`) !== 1)) {
    throw new Refused(`${what} has 'chaos' (xaos), which a code cannot hold; remove it`);
  }
  if (isZero(xform.get("opacity") ?? "1") || xform.get("plotmode") === "off") {
    throw new Refused(`${what} is invisible (opacity 0), which a code cannot hold; remove it or set its opacity`);
  }
  if (!xform.has("coefs")) throw new Refused(`${what} has no coefs; give it six numbers`);
  const inner = coefs(xform.get("coefs"), `coefs of ${what}`);
  const strength = numberOf(xform.get("linear") ?? "0", `linear of ${what}`);
  if (strength === 0) throw new Refused(`${what} has no variation; add linear="1"`);
  const outer = coefs(xform.get("post") ?? "1 0 0 1 0 0", `post of ${what}`);
  return composed(outer, inner.map((number) => strength * number));
}

function isZero(text) {
  try {
    return numberOf(text.trim(), "") === 0;
  } catch {
    return false;
  }
}

/** flam3 writes the columns of the matrix, then the offset. */
function coefs(text, what) {
  const [a, c, b, d, e, f] = numbersOf(text, 6, what);
  return [a, b, c, d, e, f];
}

/** The row of the first map after the second. */
function composed([a, b, c, d, e, f], [p, q, r, s, t, u]) {
  return [a * p + b * r, a * q + b * s, c * p + d * r, c * q + d * s, a * t + b * u + e, c * t + d * u + f];
}

/** G f G⁻¹: the attractor of all these is the final map G of the attractor. */
function conjugation(final) {
  const [a, b, c, d, e, f] = final, det = a * d - b * c;
  if (Math.abs(det) < 1e-12) throw new Refused("finalxform flattens the picture, which a code cannot hold; remove it");
  const back = [d / det, -b / det, -c / det, a / det];
  const inverse = [...back, -(back[0] * e + back[1] * f), -(back[2] * e + back[3] * f)];
  return (map) => composed(composed(final, map), inverse);
}

/** The same map with y upwards, or downwards again; 0 - x has no minus zero. */
function upright([a, b, c, d, e, f]) {
  return [a, 0 - b, 0 - c, d, e, 0 - f];
}

function cameraOf(attributes) {
  const [width, height] = numbersOf(attributes.get("size") ?? "100 100", 2, "size");
  const [x, y] = numbersOf(attributes.get("center") ?? "0 0", 2, "center");
  const scale = numberOf(attributes.get("scale") ?? "50", "scale");
  const more = numberOf(attributes.get("zoom") ?? "0", "zoom");
  if (!(Math.min(width, height) > 0 && scale > 0 && Math.abs(more) < 100)) {
    throw new Refused(`the camera needs a size and a scale above 0 and a zoom below 100, got size ${width} ${height}, `
      + `scale ${scale}, zoom ${more}`);
  }
  return { center: [x, 0 - y], zoom: (2 * scale * 2 ** more) / Math.max(width, height) };
}

/** A flame whose camera shows `view`, {x, y, zoom}. */
export function writeFlame({ rows, probabilities, meta }, view) {
  const chances = probabilities ?? [...chancesOf(rows, null)].map(Math.fround);
  const xforms = rows.map((row, i) => {
    const [a, b, c, d, e, f] = upright(row);
    const colour = Number((i / Math.max(rows.length - 1, 1)).toPrecision(6));
    return `  <xform weight="${shortest(chances[i])}" color="${colour}" `
      + `color_speed="0.5" opacity="1" linear="1" coefs="${[a, c, b, d, e, f].map(shortest).join(" ")}"/>`;
  });
  const palette = Array.from({ length: COLOURS }, (_, k) => hexadecimal(ramp(k / (COLOURS - 1))).toUpperCase());
  const lines = Array.from({ length: COLOURS / 8 }, (_, k) => palette.slice(8 * k, 8 * k + 8).join(""));
  return `<?xml version="1.0" encoding="utf-8"?>
<flame version="fractal-exp" name="${escaped(plain(meta.name) || "code")}" time="0" size="${SIZE} ${SIZE}" center="${
  view.x} ${0 - view.y}" scale="${(SIZE / 2) * view.zoom}" zoom="0" rotate="0" ${LOOK}>
${xforms.join("\n")}
  <palette count="${COLOURS}" format="RGB">
${lines.join("\n")}
  </palette>
</flame>
`;
}

/** The colour [r, g, b] of a place in [0,1] on the palette, each 0 to 255. */
export function ramp(place) {
  const at = place * (ANCHORS.length - 1), k = Math.min(Math.floor(at), ANCHORS.length - 2);
  return ANCHORS[k].map((low, channel) => Math.round(low + (at - k) * (ANCHORS[k + 1][channel] - low)));
}

export function hexadecimal(colour) {
  return colour.map((value) => value.toString(16).padStart(2, "0")).join("");
}

/** A text in XML. */
export function escaped(text) {
  return text.replace(/[&<>"']/g, (letter) => `&#${letter.charCodeAt(0)};`);
}
