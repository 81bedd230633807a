// Cones ‖Mσ‖ ≤ c − q·σ, or (1 + s)σ₁ − (1 − s)σ₃ ≤ c and σ₁ ≤ f, or parabolas R² ≤ k(c − σ₁) with
// R = (σ₁ − σ₃)/2 in the plane, and their dissipation.

/** A d × d tensor σ or ε as a vector: normal and hoop components, and √2 times shear components. */
function vector(t, d, hoop) {
  const r = Math.SQRT1_2;
  if (hoop !== undefined) return [t[0], t[3], hoop, r * (t[1] + t[2])];
  return d === 2 ? [t[0], t[3], r * (t[1] + t[2])]
    : [t[0], t[4], t[8], r * (t[5] + t[7]), r * (t[2] + t[6]), r * (t[1] + t[3])];
}

/** Principal values in ascending order; for plane vectors, the two in-plane values and `out`. */
function principal(v, out) {
  if (v.length === 3) {
    const mean = (v[0] + v[1]) / 2, radius = Math.hypot((v[0] - v[1]) / 2, v[2] * Math.SQRT1_2);
    return [mean - radius, out ?? mean, mean + radius];
  }
  if (v.length === 4) return [...principal([v[0], v[1], v[3]], v[2])].sort((y, z) => y - z);
  const [a, b, c] = v.slice(3).map((y) => y * Math.SQRT1_2);
  return eigen([[v[0], c, b], [c, v[1], a], [b, a, v[2]]]).values.sort((y, z) => y - z);
}

/**
 * Cones of a half, with functions: `ratio` of a stress, `short` of a rate, and `power` of its
 * `image`, which is linear.
 */
function conesOf(A, m) {
  const rows = (name) => A[name]?.data ?? refuse(`${name} is missing`);
  const bound = rows("cone_bound"), sine = rows("cone_sine"), cut = A.cone_tension?.data;
  const [slope, matrix] = [rows("cone_slope"), rows("cone_matrix")], bend = A.cone_curvature?.data;
  for (const [of, size] of [[sine, 1], [slope, m], [matrix, m * m], [cut ?? sine, 1], [bend ?? sine, 1]]) {
    if (of.length !== bound.length * size) {
      refuse("the shape of cone_bound, cone_slope or cone_matrix is not valid");
    }
  }
  return range(bound.length).map((k) => {
    const c = bound[k], q = row(slope, m, k);
    const M = range(m).map((i) => row(matrix, m, k * m + i));
    if (![c, ...q, ...M.flat()].every(Number.isFinite)) refuse("a cone is not finite");
    if (!(c >= 0)) refuse("a cone's bound is negative");
    [c, largest(q), largest(M.flat())].forEach((size) => checkSizes(size, 1e30));
    const f = cut ? cut[k] : NaN, curved = !Number.isNaN(bend?.[k] ?? NaN), straight = !Number.isNaN(sine[k]);
    if ((curved || straight) &&
      largest([...q, ...M.flat()])) refuse("a cone of principal stresses has a matrix");
    if (curved && straight) refuse("cone_curvature is given for a cone with a sine");
    if (straight) return principalCone(c, sine[k], f);
    if (!Number.isNaN(f)) refuse("cone_tension is given without cone_sine");
    return curved ? parabola(c, bend[k], m) : roundCone(c, q, M, m);
  });
}

function principalCone(c, s, f) {
  const cut = !Number.isNaN(f), root = Math.sqrt(3);
  if (!(s === 0 || (s > 1e-6 && s < 1 - 1e-9)) || !(c > 0)) refuse("a cone's sine is out of range");
  if (cut && !(f > 0 && f < Infinity && c - 2 * s * f > 0)) refuse("cone_tension is out of range");
  const half = cut ? (c / 2 - s * f) / (1 - s) : s ? 0 : c / 2;
  const mean = cut ? f - half : s ? c / (2 * s) : 0;
  const sums = (v) => {
    const e = principal(v, 0);
    return [e[0] + e[1] + e[2], Math.abs(e[0]) + Math.abs(e[1]) + Math.abs(e[2])];
  };
  const wide = Math.sqrt(2 * (1 + s * s)) / c;
  return {
    c, s, f, digits: 256 * U, grows: s > 0 || cut, linear: s > 0 && !cut, keeps: !(s > 0 || cut),
    takes: false, radius: Math.min(1 / wide, cut ? f : Infinity),
    weak: Math.max(wide, cut ? 1 / f : 0) * UP, alert: root * (1 + s) * UP,
    steep: (s && !cut ? (root * c) / (2 * s) : root * (Math.abs(mean) * (2 + s) + half)) * UP,
    ratio: (v) => {
      const e = principal(v), found = ((1 + s) * e[2] - (1 - s) * e[0]) / c;
      return cut ? Math.max(found, e[2] / f) : found;
    },
    image: (v) => v, short: (v) => { const [trace, size] = sums(v); return s * size - trace; },
    power: (v) => {
      const [trace, size] = sums(v), lacks = Math.max(s * size - trace, 0);
      if (s && !cut) return mean * (trace + lacks);
      return mean * trace + half * size + (cut ? Math.abs(mean) * lacks : 0);
    },
  };
}

/**
 * The set R² ≤ k(c − σ₁). Its gauge is the root g ≥ 0 of kcg² − kσ₁g − R² = 0. A rate of growth v and
 * shear γ = ε₁ − ε₃ dissipates cv + (k/4)(γ − v)₊²/v; it is admissible if v ≥ δγ.
 */
function parabola(c, k, m) {
  const gentlest = 0.01;
  if (m !== 3) refuse("cone_curvature is given for bodies that are not in plane strain");
  if (!(k > 0 && k < Infinity && c > 0)) refuse("cone_curvature or its bound is not positive and finite");
  checkSizes(k);
  if (!(k <= 1e12 * c && c <= 1e12 * k)) refuse("cone_curvature differs too much from the tensile strength");
  const weak = ((k + Math.sqrt(k * k + 2 * k * c)) / (2 * k * c)) * UP; // for ‖σ‖ = 1, σ₁ ≤ 1 and R² ≤ 1/2
  const sizes = (v) => { const e = principal(v, 0); return [e[0] + e[2], e[2] - e[0]]; };
  return {
    c, s: 0, f: NaN, k, digits: 256 * U, grows: true, linear: false, keeps: false, takes: false,
    radius: 1 / weak, weak, alert: Math.SQRT2 * (1 + gentlest) * UP,
    steep: Math.SQRT2 * (c * (1 + gentlest) + (k / 4) * (1 / gentlest ** 2 + 2 / gentlest)) * UP,
    ratio: (v) => {
      const e = principal(v, 0), along = k * e[2], square = (e[2] - e[0]) ** 2;
      const root = Math.sqrt(along * along + k * c * square);
      return along < 0 ? square / 2 / (root - along) : (along + root) / (2 * k * c);
    },
    image: (v) => v, short: (v) => { const [grown, shear] = sizes(v); return gentlest * shear - grown; },
    power: (v) => {
      const [own, shear] = sizes(v), grown = Math.max(own, gentlest * shear);
      const over = Math.max(shear - grown, 0);
      return c * grown + (over > 0 ? ((k / 4) * over * over) / grown : 0);
    },
  };
}

function roundCone(c, q, M, m) {
  const { values, along, images } = singular(M), most = Math.max(...values), n = m === 3 ? 2 : 3;
  const times = (matrix, v) => matrix.map((row) => row.reduce((sum, y, i) => sum + y * v[i], 0));
  const least = values.indexOf(Math.min(...values)), free = along[least], rounded = 2e-15; // as in Python
  if (values.filter((y) => !(y > 1e-6 * most)).length > 1) {
    refuse("a cone's matrix leaves more than one stress free");
  }
  const gone = values[least] <= rounded * most;
  if (!gone && !(values[least] > 1e-6 * most)) refuse("a cone's matrix is nearly singular");
  const pull = gone ? dots(q, free) : 0, grows = Math.abs(pull) > 1e-6 * norm(q);
  if (gone && !grows && !(Math.abs(pull) <= rounded * norm(q))) {
    refuse("a cone's slope along its matrix's null vector is nearly zero");
  }
  if (!grows && !(c > 0)) refuse("a cone's bound is not positive, and no slope closes it");
  // M⁺ᵀ, without the stress that the matrix leaves free: images M v over squares of their sizes, times v
  const scale = values.map((y, k) => (gone && k === least ? 0 : 1 / y));
  const back = range(m).map((i) => range(m).map(
    (j) => scale.reduce((sum, y, k) => sum + (images[k][i] * y) * (along[k][j] * y), 0)));
  const r = times(back, q), rest = 1 - dots(r, r), size = norm(back.flat());
  // The dissipation contains 1/rest, or 1/pull with an error of ν
  const digits = 256 * U * size * most * (grows ? norm(q) / Math.abs(pull) : 1 / rest);
  if (!(grows || rest > 1e-9) || !(digits <= 1e-3)) refuse("a cone is too steep for its rates to be supported");
  const mean = free.map((_, i) => (i < n ? 1 / Math.sqrt(n) : 0)); // the axis of mean stress
  const isMean = norm(times(M, mean)) <= rounded * most && Math.abs(dots(q, mean)) <= rounded * norm(q);
  const alert = (1 / Math.abs(pull) + size * (1 + norm(q) / Math.abs(pull))) * UP;
  const head = (v) => dots(free, v) / pull;
  const lacks = (v, z) => norm(times(back, v.map((y, i) => y - z * q[i])));
  return {
    c, q, M, digits, grows, linear: grows, keeps: gone && !grows && isMean, takes: !gone && !grows,
    alert: grows ? alert : 0, radius: c / most,
    weak: ((most + norm(q)) / c) * UP,
    steep: c * (grows ? alert : (size * (1 + norm(r))) / rest) * UP * (1 + digits),
    steepest: most, growth: (most + norm(q)) * UP,
    excess: (v) => norm(times(M, v)) + dots(q, v),
    ratio: (v) => { // for c = 0, relative to the strength that the pressure gives
      if (c > 0) return (norm(times(M, v)) + dots(q, v)) / c;
      return dots(q, v) < 0 ? norm(times(M, v)) / -dots(q, v) : v.some((y) => y) ? Infinity : 0;
    },
    short: (v) => { const z = head(v); return lacks(v, z) - z; },
    image: (v) => (grows ? v : times(back, v)),
    power: (y) => {
      if (grows) { const z = head(y); return c * Math.max(z, lacks(y, z)); }
      const a = dots(y, r);
      return (c * (Math.hypot(a, Math.sqrt(rest) * norm(y)) - a)) / rest;
    },
  };
}
