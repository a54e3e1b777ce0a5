// A code as the page reads it: maps and their chances, to the last digit those of the Python package.

export const PROBABILITY_FLOOR = 0.01; // p_i is proportional to |det M_i| + floor where a code has none of its own

/**
 * The code of the package's JSON: {count, maps, chances}. maps: rows a b c d e f of x' = a x + b y + e,
 * y' = c x + d y + f, rounded to float32, in which the package keeps a code. Throws on a code that does not contract.
 */
export function readCode(data) {
  const count = data.linear.length;
  const maps = new Float64Array(6 * count);
  for (let i = 0; i < count; i++) {
    maps.set([...data.linear[i].flat(), ...data.offset[i]].map(Math.fround), 6 * i);
  }
  for (let i = 0; i < count; i++) {
    if (!(largestSingularValue(maps, i) < 1)) throw new RangeError(`map ${i + 1} does not contract`);
  }
  return { count, maps, chances: chancesOf(maps, count, data.probabilities) };
}

/** The larger singular value of map i; NaN where the map holds one. */
export function largestSingularValue(maps, i) {
  const [a, b, c, d] = maps.subarray(6 * i, 6 * i + 4);
  return (Math.hypot(a + d, b - c) + Math.hypot(a - d, b + c)) / 2;
}

function chancesOf(maps, count, given) {
  const chances = new Float64Array(count);
  for (let i = 0; i < count; i++) {
    const [a, b, c, d] = maps.subarray(6 * i, 6 * i + 4);
    chances[i] = given ? Math.fround(given[i]) : Math.abs(a * d - b * c) + PROBABILITY_FLOOR;
  }
  const sum = chances.reduce((total, chance) => total + chance, 0);
  return chances.map((chance) => chance / sum);
}
