// How a code contracts: in a norm, on average only, or neither. fractal_exp/ifs/contraction.py explains it.

const SHORT = 1 - 1e-9;
const PLACES = 9, LOOKS = 60, REACH = 2, LEAST_REACH = 1e-4, GAIN = 1e-2;
const MOST_WORDS = 1 << 11, MOST_LETTERS = 64;
const ANGLES = 256, STEPS = 32, MOST_STEPS = 4096, TINY = 1e-300;
export const LEAST_SHRINKING = 1e-4; // exponents nearer to 0 cannot be told from 0

/**
 * {kind, axes, letters, factor, words, exponent} of rows a b c d e f with their chances. kind: "norm", "average" or
 * "neither"; axes: the matrix [a, b, c, d] whose ellipse is the unit circle of the norm; words: rows of words that
 * contract in it, with one of which every word of so many letters begins. A row of chance 0 does not count.
 */
export function contractionOf(rows, chances) {
  const chosen = rows.filter((_, i) => chances[i] > 0), own = chances.filter((chance) => chance > 0);
  const size = Math.max(...chosen.map(largestSingularValue));
  if (size < 1) return { kind: "norm", axes: [1, 0, 0, 1], letters: 1, factor: size, words: chosen };
  const axes = ellipse(chosen), { words, letters } = wordsOf(chosen, axes);
  const factor = Math.max(...(letters ? words : chosen).map((row) => largestSingularValue(within(axes, row))));
  if (letters) return { kind: "norm", axes, letters, factor, words };
  const exponent = exponentOf(chosen, own, axes);
  return { kind: exponent < -LEAST_SHRINKING ? "average" : "neither", axes, letters, factor, words, exponent };
}

/** The larger singular value of a row's matrix. */
export function largestSingularValue([a, b, c, d]) {
  return (Math.hypot(a + d, b - c) + Math.hypot(a - d, b + c)) / 2;
}

/** The row of one map after another; a matrix alone has no offset. */
function after([a, b, c, d, e = 0, f = 0], [p, q, r, s, t = 0, u = 0]) {
  return [a * p + b * r, a * q + b * s, c * p + d * r, c * q + d * s, a * t + b * u + e, c * t + d * u + f];
}

/** The inverse of a matrix [a, b, c, d]. */
export function inverse([a, b, c, d]) {
  const det = a * d - b * c;
  return [d / det, -b / det, -c / det, a / det];
}

/** A row as it is in the coordinates of other axes. */
export function within(axes, row) {
  return after(after(axes, row), inverse(axes));
}

function ellipse(rows) {
  let axes = [1, 0, 0, 1], size = Math.max(...rows.map(largestSingularValue)), seen = rows, reach = REACH;
  for (let look = 0; look < LOOKS; look++) {
    let best = Infinity, change = null;
    for (let i = 0; i < PLACES; i++) {
      for (let j = 0; j < PLACES; j++) {
        const slant = reach * ((2 * i) / (PLACES - 1) - 1), height = Math.exp(reach * ((2 * j) / (PLACES - 1) - 1));
        const sizes = seen.map(([a, b, c, d]) => largestSingularValue([a - c * slant,
          (b + (a - d - c * slant) * slant) / height, c * height, d + c * slant]));
        const largest = Math.max(...sizes);
        if (largest < best) [best, change] = [largest, [1, -slant, 0, height]];
      }
    }
    if (best < size * (1 - GAIN * reach)) {
      size = best;
      axes = after(change, axes);
      seen = seen.map((row) => within(change, row));
    } else if (reach < LEAST_REACH) break;
    else reach /= 3;
  }
  const root = Math.sqrt(axes[0] * axes[3] - axes[1] * axes[2]);
  return axes.slice(0, 4).map((number) => number / root);
}

function wordsOf(rows, axes) {
  const words = [];
  let open = [[1, 0, 0, 1, 0, 0]];
  for (let letters = 1; letters <= MOST_LETTERS && open.length * rows.length <= MOST_WORDS; letters++) {
    const longer = open.flatMap((word) => rows.map((row) => after(word, row)));
    open = [];
    for (const word of longer) (largestSingularValue(within(axes, word)) < SHORT ? words : open).push(word);
    if (!open.length) return { words, letters };
  }
  return { words: [], letters: 0 };
}

/** The top Lyapunov exponent, or a little more. */
export function exponentOf(rows, chances, axes = [1, 0, 0, 1]) {
  const step = Math.PI / ANGLES, first = [], share = [];
  let growth = new Float64Array(ANGLES);
  rows.forEach((row, i) => {
    const [a, b, c, d] = within(axes, row);
    for (let k = 0; k < ANGLES; k++) {
      const u = Math.cos((k + 0.5) * step), v = Math.sin((k + 0.5) * step), x = a * u + b * v, y = c * u + d * v;
      const place = Math.atan2(y, x) / step - 0.5, before = Math.floor(place);
      growth[k] += chances[i] * Math.log(Math.max(Math.hypot(x, y), TINY));
      first.push((before + 2 * ANGLES) % ANGLES);
      share.push(place - before);
    }
  });
  for (let steps = STEPS; ; steps *= 2) {
    const sum = new Float64Array(ANGLES);
    for (let left = steps; left > 0; left--) {
      const next = new Float64Array(ANGLES);
      for (let n = 0; n < first.length; n++) {
        const at = first[n], beside = at + 1 === ANGLES ? 0 : at + 1;
        next[n % ANGLES] += chances[Math.floor(n / ANGLES)] * ((1 - share[n]) * growth[at] + share[n] * growth[beside]);
      }
      growth = next;
      for (let k = 0; k < ANGLES; k++) sum[k] += next[k];
    }
    const low = Math.min(...sum) / steps, high = Math.max(...sum) / steps;
    if (!(high >= -LEAST_SHRINKING && low < -LEAST_SHRINKING && steps < MOST_STEPS)) return high;
  }
}
