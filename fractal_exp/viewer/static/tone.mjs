// The tone of a code that was found on a density, as the package's rendering/tone.py has it.

const FAINT = 0.05; // grey level that counts half as light
const OVER = 40; // exposure times density from which a pixel is white under every curve
const HALVINGS = { least: 100, last: 12 };
const LEAST = { light: 1e-3, gamma: 1 / 20, cover: 1e-3 }, MOST = { light: 1, gamma: 20, cover: 1 };

/** The tone {light, gamma, linear}, perhaps with a cover, in the notes of a plain code; null without one that can be drawn. A code with
 * colours has the light `cover` of its cover. */
export function toneOf({ meta }) {
  const { light, gamma = 1, linear = false, cover, ...others } = Object(meta?.tone);
  const tone = cover == null ? { light, gamma } : { light, gamma, cover };
  const fits = Object.entries(tone).every(([name, number]) => number >= LEAST[name] && number <= MOST[name]
    && typeof number === "number");
  return fits && typeof linear === "boolean" && !Object.keys(others).length ? { ...tone, linear } : null;
}

/** The exposure of counts, whose mean over a whole picture is given: with it they have the tone's light. */
export function exposureOf(counts, mean, { light, gamma, linear }) {
  const lit = Float64Array.from(counts).filter((count) => count > 0).map((count) => count / mean);
  if (!lit.length) return 1;
  const isDarker = (exposure) => {
    let sum = 0, weights = 0;
    for (const density of lit) {
      const ink = exposure * density, grey = (linear ? Math.min(ink, 1) : -Math.expm1(-ink)) ** (1 / gamma);
      const weight = grey / (grey + FAINT);
      sum += weight * grey;
      weights += weight;
    }
    return sum < light * weights || weights === 0;
  };
  let high = OVER / lit.reduce((a, b) => Math.min(a, b));
  for (let k = 0; k < HALVINGS.least && !isDarker(high / 2); k++) high /= 2;
  let low = high / 2;
  for (let k = 0; k < HALVINGS.last; k++) {
    const middle = Math.sqrt(low * high);
    if (isDarker(middle)) low = middle;
    else high = middle;
  }
  return high;
}
