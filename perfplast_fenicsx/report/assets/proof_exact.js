// Exact numbers: a double is a whole number (BigInt) times a power of 2, and so are sums and
// products. Sizes that enter a bound are doubles, enlarged by more than their rounding errors.

const U = 2 ** -53;
const UP = 1 + 1e-9;

/** The reason why a file is not a proof, as a sentence. */
class Refused extends Error {}
const refuse = (words) => { throw new Refused(words); };

/** The number v 2^e, also if it is tiny. */
function num(v, e) {
  const half = e >> 1;
  return Number(v) * 2 ** half * 2 ** (e - half);
}
const sizeOf = (v, e) => (v === 0n ? 0 : Math.abs(num(v, e)) * (1 + 4 * U) + Number.MIN_VALUE);

const words = new Uint32Array(2), double = new Float64Array(words.buffer);
/** The largest e such that x is a whole number times 2^e. */
function lowest(x) {
  double[0] = x;
  const [low, high] = words, power = (high >>> 20) & 0x7ff;
  const upper = (high & 0xfffff) | (power ? 0x100000 : 0);
  const zeros = low ? 31 - Math.clz32(low & -low) : 32 + 31 - Math.clz32(upper & -upper);
  return Math.max(power, 1) - 1075 + zeros;
}

const largest = (values) => values.reduce((a, x) => Math.max(a, Math.abs(x)), 0);

/** Data without rounding errors: { v, e } with the numbers v[i] 2^e, and e at most `most`. */
function exact(values, most = 0) {
  let e = most;
  for (const x of values) if (x !== 0) e = Math.min(e, lowest(x));
  if (e < -700) refuse("numbers are too different in size for this checker");
  const scale = 2 ** -e;
  return { v: Array.from(values, (x) => BigInt(x * scale)), e };
}

/** Numbers rounded to multiples of 2^e; for stresses and velocities, which a proof may choose. */
function rounded(values, e) {
  const scale = 2 ** -e;
  return Array.from(values, (x) => BigInt(Math.round(x * scale)));
}

/** Sum of products of a factor (one number) and data, from { factor, values }. */
function combined(kinds, count) {
  const some = kinds.filter((kind) => kind.factor !== 0 && kind.values.some((x) => x !== 0));
  const parts = some.map((kind) => [exact([kind.factor]), exact(kind.values)]);
  const e = Math.min(0, ...parts.map(([f, of]) => f.e + of.e));
  const v = new Array(count).fill(0n);
  for (const [f, of] of parts) {
    const factor = f.v[0] << BigInt(f.e + of.e - e);
    of.v.forEach((x, i) => { v[i] += factor * x; });
  }
  return { v, e };
}

/** Return a function of a load's name that returns the load with all factors: { v, e }. */
const loadsAt = (body, factors) => (name, size) =>
  combined(body.loads.map((of, k) => ({ factor: factors[k], values: of[name] })), size);

/** The same numbers with a smaller exponent. */
function finer(of, e) {
  const shift = BigInt(of.e - e);
  return shift ? of.v.map((x) => x << shift) : of.v;
}

/** The square root of a whole number, rounded down to a whole number. */
function rootOf(n) {
  if (n < 2n) return n;
  let x = 1n << BigInt((n.toString(16).length * 4 + 1) >> 1);
  for (let y = (x + n / x) >> 1n; y < x; y = (x + n / x) >> 1n) x = y;
  return x;
}

const dot = (a, b) => a.reduce((sum, x, i) => sum + x * b[i], 0n);
const cross = (a, b) => (a.length === 2 ? [a[0] * b[1] - a[1] * b[0]]
  : [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]);
const minus = (a, b) => a.map((x, i) => x - b[i]), add = (a, b) => a + b;
const dots = (a, b) => a.reduce((sum, x, i) => sum + x * b[i], 0); // scalar product of doubles
const row = (values, size, k) => [...values.subarray(k * size, (k + 1) * size)];
const norm = (a) => Math.hypot(...a);
const count = (n) => Array.from({ length: n }, (_, i) => i), few = [];
const axesOf = (d) => range(d).map((i) => range(d).map((k) => (i === k ? 1n : 0n)));
const pairsOf = (d) => range(d).flatMap((i) => range(d).slice(i + 1).map((j) => [i, j]));
const range = (n) => (n < 16 ? (few[n] ??= Object.freeze(count(n))) : count(n));

/** Refuse numbers so large or so small that products of several may overflow or underflow. */
function checkSizes(size, most = 1e60) {
  const power = Math.round(Math.log10(most));
  if (size !== 0 && !(size >= 1 / most && size <= most)) refuse(`some data are outside the range 1e-${power} to 1e${power}`);
}

/** Eigenvalues of a symmetric matrix, and its eigenvectors in columns, by Jacobi rotations. */
function eigen(matrix) {
  const n = matrix.length, unit = 2 ** Math.floor(Math.log2(largest(matrix.flat()) || 1));
  const a = matrix.map((row) => row.map((y) => y / unit)); // so that squares do not underflow
  const v = range(n).map((i) => range(n).map((j) => (i === j ? 1 : 0)));
  for (let sweep = 0; sweep < 30; sweep++) {
    let off = 0, all = 0;
    for (let i = 0; i < n; i++) for (let j = 0; j < n; j++) {
      all += a[i][j] ** 2;
      if (i !== j) off += a[i][j] ** 2;
    }
    if (!(off > 1e-36 * all)) break;
    for (let p = 0; p < n; p++) for (let q = p + 1; q < n; q++) {
      if (a[p][q] === 0) continue;
      const angle = (a[q][q] - a[p][p]) / (2 * a[p][q]);
      const t = (angle < 0 ? -1 : 1) / (Math.abs(angle) + Math.hypot(angle, 1));
      const c = 1 / Math.hypot(t, 1), s = t * c;
      for (let k = 0; k < n; k++) {
        const x = a[k][p], y = a[k][q];
        a[k][p] = c * x - s * y; a[k][q] = s * x + c * y;
      }
      for (let k = 0; k < n; k++) {
        const x = a[p][k], y = a[q][k];
        a[p][k] = c * x - s * y; a[q][k] = s * x + c * y;
        const f = v[k][p], g = v[k][q];
        v[k][p] = c * f - s * g; v[k][q] = s * f + c * g;
      }
    }
  }
  return { values: a.map((row, i) => unit * row[i]), vectors: v };
}

/**
 * Singular values of a square matrix M, its right singular vectors v (`along`) and the `images` Mv, by
 * Jacobi rotations of its columns, whose rounding errors are those of M.
 */
function singular(M) {
  const n = M.length, unit = 2 ** Math.floor(Math.log2(largest(M.flat()) || 1));
  const images = range(n).map((j) => M.map((row) => row[j] / unit));
  const along = range(n).map((j) => range(n).map((i) => (i === j ? 1 : 0)));
  const most = norm(images.flat());
  for (let sweep = 0, turned = true; turned && sweep < 30; sweep++) {
    turned = false;
    for (let p = 0; p < n; p++) for (let q = p + 1; q < n; q++) {
      const [a, b] = [images[p], images[q]], dot = dots(a, b), [x, y] = [norm(a), norm(b)];
      if (!(Math.abs(dot) > 4 * U * x * y && Math.min(x, y) > 8 * U * most)) continue;
      turned = true;
      const angle = ((y - x) * (y + x)) / (2 * dot);
      const t = (angle < 0 ? -1 : 1) / (Math.abs(angle) + Math.hypot(angle, 1));
      const c = 1 / Math.hypot(t, 1), s = t * c;
      for (const of of [images, along]) {
        [of[p], of[q]] = [of[p].map((u, k) => c * u - s * of[q][k]), of[p].map((u, k) => s * u + c * of[q][k])];
      }
    }
  }
  return { values: images.map((v) => unit * norm(v)), along, images: images.map((v) => v.map((y) => unit * y)) };
}

/** Disjoint sets of the numbers 0 ... n − 1 that can be joined. */
class Joined {
  constructor(n) { this.above = Int32Array.from(range(n)); }
  of(i) {
    while (this.above[i] !== i) i = this.above[i] = this.above[this.above[i]];
    return i;
  }
  join(i, j) { this.above[this.of(i)] = this.of(j); }
}
