// Where the colours of a picture come from: the maps, the addresses of points, their density, or the code itself.

import { toneOf } from "./tone.mjs";

export const BY = { // what can be chosen, and its label
  plain: "plain", own: "the code's own", map: "by map", address: "by address", density: "by density",
};
const HALF = 0.5; // the blend of an address: the last map counts half, the one before a quarter, and so on
/** Palettes: colours of equally spaced places, red, green and blue in hexadecimal. */
export const PALETTES = {
  meadow: ["266ed6", "12a496", "60bc40", "f0b224", "e8623c", "c43c8c"],
  forest: ["4e342e", "6d5a2a", "33691e", "689f38", "aed581", "dce775"],
  fire: ["3a0d5c", "8c1d5f", "d2393f", "f5793a", "fbbf45", "fff3b0"],
  sea: ["0b1f4b", "11508c", "1488a8", "3cbfae", "98e0c0", "eefbe6"],
  autumn: ["5d4037", "8d6e22", "c08a1e", "e0702c", "c6402f", "8e2440"],
  violet: ["2d1a5a", "5b3596", "8f57c4", "c27fd6", "e8aadc", "fbdcee"],
};
export const STOPS = 6; // of a palette
const TONE = { least: 0.25, most: 4 };

export const PLAIN = { by: "plain", palette: "meadow", tone: 1, ground: null };

/** The places of a palette as numbers in [0,1], one array [r, g, b, r, g, b, …]. */
export function stopsOf(palette) {
  return PALETTES[palette].flatMap((stop) => rgbOf(stop));
}

/** The colour [r, g, b] in [0,1] of a text such as "4e342e" or "#4e342e". */
export function rgbOf(text) {
  const digits = text.replace("#", "");
  return [0, 2, 4].map((at) => parseInt(digits.slice(at, at + 2), 16) / 255);
}

/** Whether a code says how it looks: by its colours, or by the tone of the picture that it was found on. */
export function hasOwn(code) {
  return Boolean(code.colours || toneOf(code));
}

/** The ground that a code's colours were found on, "#rrggbb", by the note of it; null without one that is a colour. */
export function ownGround({ colours, meta }) {
  if (!colours || typeof meta.ground !== "string") return null;
  const pen = document.createElement("canvas").getContext("2d");
  pen.fillStyle = "transparent";
  pen.fillStyle = meta.ground; // which does nothing where it is no colour
  return /^#[0-9a-f]{6}$/.test(pen.fillStyle) ? pen.fillStyle : null;
}

/** A colour [r, g, b] of a palette at a place in [0,1]. */
export function colourAt(palette, place) {
  const stops = stopsOf(palette), along = Math.min(Math.max(place, 0), 1) * (STOPS - 1);
  const k = Math.min(Math.floor(along), STOPS - 2), t = along - k;
  return [0, 1, 2].map((channel) => (1 - t) * stops[3 * k + channel] + t * stops[3 * k + 3 + channel]);
}

/**
 * What each map makes of a colour, c <- keep c + gift, for a choice; null where points need no colour. keep: (N), gift:
 * red, green and blue of each map (3N).
 */
export function foldsOf({ rows, colours }, { by, palette }) {
  const count = rows.length, made = { keep: new Float64Array(count), gift: new Float64Array(3 * count) };
  const set = (blendOf, colourOf) => {
    for (let i = 0; i < count; i++) {
      made.keep[i] = 1 - blendOf(i);
      made.gift.set(colourOf(i).map((part) => blendOf(i) * part), 3 * i);
    }
    return made;
  };
  const onPalette = (i) => colourAt(palette, i / Math.max(count - 1, 1));
  const kinds = {
    __proto__: null, map: () => set(() => 1, onPalette), address: () => set(() => HALF, onPalette),
    own: () => colours && set((i) => colours.blends[i], (i) => colours.rgb[i]),
  };
  return kinds[by]?.() ?? null;
}

/** What a word, its letters from the outermost map on, makes of a colour: [keep, r, g, b]. */
export function foldedWord({ keep, gift }, letters) {
  const made = [1, 0, 0, 0];
  for (const i of letters) {
    for (let channel = 0; channel < 3; channel++) made[1 + channel] += made[0] * gift[3 * i + channel];
    made[0] *= keep[i];
    if (made[0] === 0) break;
  }
  return made;
}

/** The mean colour of the points, with which a chaos game begins. */
export function meanColour({ keep, gift }, chances) {
  const sum = [0, 0, 0, 0];
  chances.forEach((chance, i) => {
    sum[3] += chance * (1 - keep[i]);
    for (let channel = 0; channel < 3; channel++) sum[channel] += chance * gift[3 * i + channel];
  });
  return sum[3] > 0 ? sum.slice(0, 3).map((part) => part / sum[3]) : [0.5, 0.5, 0.5];
}

/** The density that becomes the palette's end: one that hardly a pixel with points exceeds. */
export function whiteOf(counts, mean) {
  const lit = Float64Array.from(counts).filter((count) => count > 0).sort();
  return lit.length ? Math.max(lit[Math.floor(0.999 * (lit.length - 1))] / mean, 1e-6) : 1;
}

/** A choice as a part of a link; empty where it is the usual one. */
export function toLink(choice, usual) {
  const changed = Object.keys(PLAIN).filter((key) => choice[key] !== usual[key]);
  return changed.map((key) => `&${key}=${String(choice[key]).replace("#", "")}`).join("");
}

/** The choice of a link, with the usual one for what it does not name or names wrongly. */
export function fromLink(fragment, usual, hasOwn) {
  const given = new URLSearchParams(fragment.replace(/^#/, "")), choice = { ...usual };
  const by = given.get("by"), palette = given.get("palette"), tone = Number(given.get("tone"));
  if (Object.hasOwn(BY, by ?? "") && (by !== "own" || hasOwn)) choice.by = by;
  if (Object.hasOwn(PALETTES, palette ?? "")) choice.palette = palette;
  if (tone >= TONE.least && tone <= TONE.most) choice.tone = tone;
  if (/^[0-9a-f]{6}$/i.test(given.get("ground") ?? "")) choice.ground = `#${given.get("ground").toLowerCase()}`;
  return choice;
}
