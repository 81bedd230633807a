// Check whether both halves have the same bodies, even on different meshes (docs/proof.md, same bodies).

/** Refuse halves with different bodies. The upper half may have more strength and more friction. */
function compare(lower, upper) {
  const { d } = lower, is = (name) => lower[name].length === upper[name].length &&
    lower[name].every((y, i) => y === upper[name][i]);
  if (d !== upper.d ||
    lower.revolved !== upper.revolved) {
    refuse("the halves have bodies of different dimension, or only one has bodies of revolution");
  }
  const alike = is("x") && is("cells") && is("facets");
  const places = (body, i) => body.ofFacet(i).map(body.point), sizes = (body, i) =>
    norm(body.area[body.outer[i]]);
  const pairs = alike ? range(lower.f).map((i) => [i, i]) : sharedFacets(lower, upper);
  for (const [a, b] of pairs) {
    const own = (name, body, i) => row(body[name], d, i);
    if (lower.onAxis[a] !== upper.onAxis[b]) refuse("a facet is on the axis in only one half");
    if (lower.surface[a] !== upper.surface[b]) refuse("the halves have different surfaces");
    const [g, h] = [["guided", lower, a], ["guided", upper, b]].map((of) => { // their free parts, of length 1
      const free = own(...of).map((y, k) => (own("held", lower, a)[k] ? 0 : y));
      return free.map((y) => y / (norm(free) || 1));
    });
    const far = Math.max(farOff(places(lower, a)), farOff(places(upper, b)));
    const turned = Math.min(...[1, -1].map((sign) => largest(g.map((y, k) => y - sign * h[k]))));
    if (own("held", lower, a).some((y, k) => y !== own("held", upper, b)[k]) || turned > ALIKE * (1 + far)) {
      refuse("the halves have different supports");
    }
    const [small, large] = sizes(lower, a) <= sizes(upper,
      b) ? [[lower, a], [upper, b]] : [[upper, b], [lower, a]];
    lower.loads.forEach((_, kind) => {
      const at = ([body, i]) => range(d).map((j) => row(body.loads[kind].traction, d, i * d + j));
      if (!at(small).flat().some((y) => y) && !at(large).flat().some((y) => y)) return;
      const there = places(...small).map((p) => linear(places(...large), at(large), p));
      const noise = Math.max(...[small, large].map((of) => noiseOf(places(...of), at(of))));
      if (differ(at(small).flat(), there.flat(), noise)) refuse("the halves have different loads");
    });
  }
  compareCells(lower, upper, alike);
  const rows = (body, [tags, normals, c, mu], kept) => range(c.length).map((k) => [
    [...tags.subarray((k * tags.length) / c.length, ((k + 1) * tags.length) / c.length)]
      .sort((p, q) => p - q).concat(kept?.[k] ?? []).join(),
    row(normals, d, k), c[k], mu[k],
  ]).sort((p, q) => (p[0] < q[0] ? -1 : p[0] > q[0] ? 1 : p[2] - q[2] || p[3] - q[3]));
  const rounding = lower.division ? 1e-12 : 0; // of products with the factor
  for (const [g, of] of [(body) => [body.contacts, new Float64Array(0), ...body.rubs[0].slice(0, 2)],
    (body) => [body.obstacles, body.towards, ...body.rubs[1].slice(0, 2)]].entries()) {
    const [one, other] = [lower, upper].map((body) => rows(body, of(body), body.division?.kept[g]));
    if (one.length !== other.length || one.some(([tags, normal, c, mu], k) => tags !== other[k][0] ||
      c > other[k][2] * (1 + rounding) || mu > other[k][3] * (1 + rounding)
      || normal.some((y, i) => y !== other[k][1][i]))) {
      refuse("the halves have different contacts, or the upper half has less friction");
    }
  }
  const order = [lower, upper].map((body) => [...range(body.rigid.length)].sort((i, j) =>
    body.rigid[i] - body.rigid[j]));
  const turns = 2 * d - 3,
    wrong = () => refuse("the halves have different rigid surfaces, or different loads on them");
  if (order[0].length !== order[1].length) wrong();
  order[0].forEach((g, k) => {
    const h = order[1][k];
    if (lower.rigid[g] !== upper.rigid[h] ||
      row(lower.rigidHeld, d, g).some((y, i) => y !== row(upper.rigidHeld, d, h)[i])) wrong();
    const { middle, extent } = middleOf(lower, lower.rigid[g]);
    const about = (turn, force) => minus(turn, cross(middle, force));
    lower.loads.forEach((of, kind) => {
      const other = upper.loads[kind], [pull, there] = [row(of.rigid_force, d, g), row(other.rigid_force, d, h)];
      const [turn, turned] = [row(of.rigid_moment, turns, g), row(other.rigid_moment, turns, h)];
      const off = about(minus(turn, turned), minus(pull, there));
      const size = norm(about(turn, pull)) + extent * norm(pull);
      if (differ(pull, there) || !(largest(off) <= ALIKE * size)) wrong();
    });
  });
}

/** Largest difference between equal numbers of both halves, relative to their size. */
const ALIKE = 2 ** -48;

/** Whether numbers differ by more than rounding errors of terms of size `noise`, which cancel. */
const differ = (one, other, noise = 0) =>
  !(largest(minus(one, other)) <= ALIKE * (Math.max(largest(one), largest(other)) + noise));

const wide = (rows) => Math.max(...rows[0].map((_, i) =>
  Math.max(...rows.map((y) => y[i])) - Math.min(...rows.map((y) => y[i]))));

/** The largest coordinate of a simplex over its extent. */
const farOff = (vertices) => largest(vertices.flat()) / wide(vertices);

/** The size of terms that cancel in loads: of gradients, and of the directions of pressures. */
const noiseOf = (vertices, values) => (largest(values.flat()) + wide(values)) * farOff(vertices);

/** The value of a linear function on a simplex of any dimension, at a point in its plane. */
function linear(vertices, values, place) {
  const edges = vertices.slice(1).map((p) => minus(p, vertices[0])), from = minus(place, vertices[0]);
  const inverse = inverted(edges.map((p) => edges.map((q) => dots(p, q))));
  const shares = inverse.map((row) => row.reduce((sum, y, k) => sum + y * dots(edges[k], from), 0));
  return values[0].map((y, i) => shares.reduce((sum, s, k) => sum + s * (values[k + 1][i] - y), y));
}

/** Pairs of outer facets that overlap; refuse halves in which they do not cover all facets. */
function sharedFacets(lower, upper) {
  const { d } = lower, bodies = [lower, upper], every = bodies.map(outerFacets);
  const reach = 64 * U * largest(every.flat().flatMap((of) => of.x.flat()));
  const boxOf = (of) => boxOfPoints(of.x).map((p, end) => p.map((y) => y + (end ? reach : -reach)));
  const slackOf = ({ height, width }) => Math.min(reach, 1e-6 * height, 1e-3 * width);
  const grid = new Grid(every[1].map(boxOf)), pairs = [];
  every[0].forEach((one, a) => grid.near(boxOf(one), (b) => {
    const other = every[1][b];
    if (!(dots(one.normal, other.normal) > 0.5)) return;
    const [small, large] = one.area >= other.area ? [other, one] : [one, other];
    const slack = Math.min(slackOf(one), slackOf(other));
    if (small.x.some((p) => Math.abs(dots(minus(p, large.x[0]), large.normal)) > slack)) return;
    const common = commonArea(large, small);
    for (const of of [one, other]) { of.covered += common; of.count += common > 0; }
    if (common > 1e-6 * small.area) pairs.push([a, b]);
  }));
  if (every.flat().some((of) => {
    const around = d === 2 ? 2 : of.x.reduce((sum, p, k) => sum + norm(minus(p, of.x[(k + 1) % d])), 0);
    const most = Math.min(slackOf(of) * around * (1 + of.count), 1e-6 * of.area);
    return !(Math.abs(of.covered - of.area) <= most);
  })) refuse("the halves have bodies of different volume or position");
  cut(lower, every[1]);
  cut(upper, every[0]);
  return pairs;
}

/** The outer facets of a body. */
const outerFacets = (body) => range(body.f).map((i) => {
  const vector = body.area[body.outer[i]], area = norm(vector), c = Math.floor(body.outer[i] / body.w);
  return { x: body.ofFacet(i).map(body.point), area, normal: vector.map((y) => y / area), covered: 0, count: 0,
    width: widthOf(body, i), height: (body.d * body.volume[c]) / area };
});

/** Refuse outer facets of the other half that extend through cells, or along inner facets, of a body. */
function cut(body, facets) {
  const { d, w, n, across } = body, grid = new Grid(facets.map(({ x }) => boxOfPoints(x)));
  const wrong = () => refuse("one half is connected where the other half has a surface");
  const onCut = new Float64Array(n * w), share = 1e-3; // of heights, and of inner facets
  for (let c = 0; c < n; c++) {
    const x = cornersOf(body, c), sides = range(w).map((k) => norm(body.area[c * w + k]));
    const most = (share * d * body.volume[c]) / Math.max(...sides);
    grid.near(boxOfPoints(x).map((p, end) => p.map((y) => y + (end ? most : -most))), (o) => {
      const heights = x.map((p) => dots(minus(p, facets[o].x[0]), facets[o].normal));
      if (Math.min(Math.max(...heights), -Math.min(...heights)) > most && through(x, facets[o].x, most)) wrong();
      const far = range(w).filter((k) => Math.abs(heights[k]) > most), side = c * w + far[0];
      if (far.length > 1 || across[side] < 0) return;
      onCut[side] += commonArea(facets[o], { x: body.ends(side).map(body.point) }) / sides[far[0]];
    });
  }
  if (onCut.some((y, side) => y > share && onCut[across[side]] > share)) wrong();
}

/** Whether no motion by `most` separates a cell from a facet whose plane it intersects. */
function through(cell, facet, most) {
  const edges = pairsOf(cell.length).map(([i, j]) => minus(cell[j], cell[i]));
  const ends = [...edges, ...facet.map((p, k) => minus(facet[(k + 1) % facet.length], p))];
  const axes = facet.length === 2 ? edges.map(([u, v]) => [v, -u])
    : edges.flatMap((p) => ends.map((q) => cross(p, q)));
  return axes.every((axis) => {
    const size = norm(axis), [u, v] = [cell, facet].map((of) => of.map((p) => dots(minus(p, cell[0]), axis)));
    return !size || Math.min(Math.max(...u) - Math.min(...v), Math.max(...v) - Math.min(...u)) > most * size;
  });
}

/** The common length or area of two facets in a plane: the sides of one facet cut the other facet. */
function commonArea({ x, normal }, small) {
  if (x.length === 2) {
    const [u, v] = [x, small.x].map((of) => of.map((p) => dots(minus(p, x[0]), [-normal[1], normal[0]])));
    return Math.max(0, Math.min(Math.max(...u), Math.max(...v)) - Math.max(Math.min(...u), Math.min(...v)));
  }
  let polygon = small.x;
  x.forEach((p, k) => {
    const side = cross(normal, minus(x[(k + 1) % 3], p)),
      sign = Math.sign(dots(side, minus(x[(k + 2) % 3], p)));
    const depth = polygon.map((q) => sign * dots(side, minus(q, p)));
    polygon = polygon.flatMap((q, i) => {
      const j = (i + 1) % polygon.length, cut = depth[i] / (depth[i] - depth[j]);
      const on = q.map((y, m) => y + cut * (polygon[j][m] - y));
      return [...(depth[i] >= 0 ? [q] : []), ...(depth[i] * depth[j] < 0 ? [on] : [])];
    });
  });
  return polygon.reduce((sum, q, i) => (i < 2 ? sum
    : sum + norm(cross(minus(polygon[i - 1], polygon[0]), minus(q, polygon[0]))) / 2), 0);
}

/** Refuse halves whose overlapping cells have different loads, or less strength in the upper half. */
function compareCells(lower, upper, alike) {
  const { d, w } = lower, bodies = [lower, upper], shapes = bodies.map(coneShapes), holds = new Map();
  const wet = bodies.some((body) => body.loads.some((of) => largest(of.pore_pressure)));
  const varies = bodies.some((body) => body.strength.some((y) => y !== 1));
  const force = (body, c, kind) => row(body.loads[kind].body_force, d, c);
  const rows = new Set(bodies.flatMap((body) =>
    range(body.n).map((c) => [body.cone[c], ...range(3).flatMap((k) => force(body, c, k))].join())));
  const stronger = (a, b) => {
    const key = `${lower.cone[a]},${upper.cone[b]}`,
      [one, other] = [shapes[0].at(lower.cone[a]), shapes[1].at(upper.cone[b])];
    if (!holds.has(key)) holds.set(key, isIn(one, other, 1, 1));
    if (!varies) return holds.get(key);
    return overlapEnds(lower, a, upper, b).every((p) => isIn(one, other, ...[[lower, a], [upper, b]].map(
      ([body, c]) => shares(body, c, p).reduce((sum, y, k) => sum + y * body.strength[c * w + k], 0))));
  };
  const loaded = (a, b) => range(3).some((kind) => {
    if (differ(force(lower, a, kind), force(upper, b, kind))) return true;
    const pores = (body, c) => row(body.loads[kind].pore_pressure, w, c);
    const [small, large] =
      lower.volume[a] <= upper.volume[b] ? [[lower, a], [upper, b]] : [[upper, b], [lower, a]];
    if (!wet || ![...pores(...small), ...pores(...large)].some((y) => y)) return false;
    const there = cornersOf(...small).map((p) => shares(...large, p).reduce((sum, y, k) =>
      sum + y * pores(...large)[k], 0));
    return differ(pores(...small), there, noiseOf(cornersOf(...large), pores(...large).map((y) => [y])));
  });
  if (!wet && !varies && rows.size === 1 && stronger(0, 0)) return;
  const visit = (a, b) => {
    const [weak, other] = [!stronger(a, b), loaded(a, b)];
    if (!(weak || other) || (!alike && apart(cornersOf(lower, a), cornersOf(upper, b)))) return;
    refuse(weak ? "the upper half has weaker bodies than the lower one, or cones of other shapes"
      : "the halves have different loads");
  };
  if (alike) { range(lower.n).forEach((c) => visit(c, c)); return; }
  const box = (body, c) => boxOfPoints(cornersOf(body, c)),
    grid = new Grid(range(upper.n).map((c) => box(upper, c)));
  range(lower.n).forEach((a) => grid.near(box(lower, a), (b) => visit(a, b)));
}

const cornersOf = (body, c) => range(body.w).map((k) => body.point(body.cells[c * body.w + k]));

/** Barycentric coordinates of a point in a cell. */
const shares = (body, c, place) => range(body.w).map((k) => {
  const on = body.point(body.ends(c * body.w + k)[0]), area = body.area[c * body.w + k];
  return -area.reduce((sum, y, i) => sum + y * (place[i] - on[i]), 0) / (body.d * body.volume[c]);
});

/** Points whose hull is the overlap of two cells: ends of the parts of edges inside the other cell. */
function overlapEnds(lower, a, upper, b) {
  const small = 1e-9, found = [];
  const both = [[lower, a, upper, b], [upper, b, lower, a]];
  for (const [mine, c, other, o] of both) for (const [i, j] of mine.pairs) {
    const [p, q] = [i, j].map((k) => cornersOf(mine, c)[k]), [s, t] = [p, q].map((x) => shares(other, o, x));
    let first = 0, last = 1, outside = false;
    s.forEach((y, k) => {
      const rate = t[k] - y;
      if (rate > small) first = Math.max(first, -y / rate);
      else if (rate < -small) last = Math.min(last, -y / rate);
      else if (y < -small) outside = true;
    });
    if (!outside && first <= last + small) for (const at of [first, last]) found.push(p.map((y, k) =>
      y + at * (q[k] - y)));
  }
  return found;
}

/**
 * Shapes of the cones of a half by number: families that differ in size alone, and the slopes and
 * bounds of each reading.
 */
function coneShapes(body) {
  const m = body.revolved ? 4 : body.d === 2 ? 3 : 6, normals = m === 3 ? 2 : 3,
    unit = (i, j) => (i === j ? 1 : 0), rows = range(m);
  const deviator = rows.map((i) => rows.map((j) => unit(i, j) - (i < normals && j < normals ? 1 / normals : 0)));
  const applied = (M, v) => M.map((row) => row.reduce((sum, y, i) => sum + y * v[i], 0));
  const root = (M) => { // (MᵀM)^½ of M after scaling it to size 1, as singular values times vectors
    const size = norm(M.flat()), { values, along } = singular(M.map((row) => row.map((y) => y / size)));
    return rows.flatMap((i) => rows.map((j) => along.reduce((sum, v, k) => sum + values[k] * v[i] * v[j], 0)));
  };
  const { times, kind, tangents } = body.division ?? {};
  const found = body.cones.map(({ c, q, M, s, f, k }, number) => {
    const isPrincipal = s !== undefined, size = isPrincipal ? 1 : norm(M.flat());
    const steep = isPrincipal ? 0 : norm(q), along = steep ? q.map((y) => y / steep) : new Array(m).fill(0);
    const cosine = isPrincipal ? Math.sqrt((1 - s) * (1 + s)) : 1, cut = isPrincipal && f > 0;
    const slope = isPrincipal ? s / cosine : steep / size, bound = c / size / cosine, by = times?.[number] ?? 1;
    return {
      family: [...root(isPrincipal ? rows.map((i) => rows.map((j) => unit(i, j))) : M), ...along,
        isPrincipal ? (k ? 3 : cut ? 2 : 1) : 0, cut ? Math.log(bound / f) : 0, k ? Math.log(k / c) : 0,
        kind?.[number] ?? 0],
      axial: isPrincipal || norm(applied(M, along)) <= 2e-15 * size,
      // F does not move the apex, where p = c/|q|
      readings: (tangents?.[number] ?? [slope]).map((tangent) =>
        ({ slope: tangent * by, bound: (slope ? (bound / slope) * tangent : bound) * by })),
    };
  });
  const elastic = { family: [...root(deviator), ...new Array(m).fill(0), 0, 0, 0, 0],
    readings: [{ slope: 0, bound: Infinity }], axial: false };
  return { at: (k) => (k < 0 ? elastic : found[k]) };
}

/** Whether a cone is known to lie in another one in some reading, both with their bounds times factors. */
function isIn(one, other, factor, times) {
  const [{ slope, bound }] = other.readings;
  if (bound === Infinity && slope === 0) return true; // an elastic cell contains each cone
  const small = 1e-12, off = one.family.map((y, i) => y - other.family[i]), shape = off.length - 4;
  // A large pressure multiplies differences of M and of q; the lower half pays only for rounding
  if (!(norm(off.slice(0, shape)) <= 3e-15)) return false;
  if (!(largest(off.slice(shape)) <= small)) return false;
  return one.readings.some((less, k) => { // cones of one family have equal numbers of readings
    const more = other.readings[k];
    const [c, most] = [less.bound * factor, more.bound * times * (1 + 1e-12)];
    if (Math.abs(less.slope - more.slope) <= small * Math.min(less.slope, more.slope)) return c <= most;
    return one.axial && less.slope > 0 && less.slope < more.slope && c * more.slope <= most * less.slope;
  });
}

/**
 * The factor that divides strengths of a half, and the cells, contacts and obstacles whose strength
 * it does not divide; null without a factor.
 */
function reductionOf(body, A) {
  const names = ["cell_kept", "contact_kept", "obstacle_kept"], factor = A.numbers.strength_factor;
  if (factor === undefined) {
    if (names.some((name) => A[name])) refuse("strength_factor is missing");
    return null;
  }
  if (!(factor > 0)) refuse("strength_factor is not positive");
  const counts = [body.n, ...body.rubs.map((of) => of[0].length)];
  const kept = names.map((name, k) => A[name]?.data ?? new Uint8Array(counts[k]));
  if (kept.some((of, k) => of.length !== counts[k])) {
    refuse("the shape of cell_kept, contact_kept or obstacle_kept does not fit the bodies");
  }
  kept.forEach((of, k) => {
    if (!of.every((y) => y === 0 || y === 1)) refuse(`${names[k]} does not consist of flags, 0 or 1`);
  });
  const cones = [0, 1].map((is) => new Set(body.cone.filter((c, i) => c >= 0 && kept[0][i] === is)));
  if ([...cones[1]].some((c) =>
    cones[0].has(c))) refuse("cell_kept divides a strength in some cells but not in others");
  if ([...cones[0]].some((c) => body.cones[c].k)) {
    refuse("strength_factor divides a strength with cone_curvature");
  }
  return { factor, kept, divided: cones[0] };
}

/** tan φ of Drucker–Prager cones with ‖dev σ‖/√2 + ηp ≤ k for each match; NaN if they are too steep. */
const MATCHES = [(eta) => (3 * eta) / Math.sqrt(9 - 12 * eta ** 2), ...[-1, 1].map((sign) => (eta) => {
  const sine = (3 * Math.sqrt(3) * eta) / (6 - sign * Math.sqrt(3) * eta);
  return sine > 0 ? sine / Math.sqrt(1 - sine ** 2) : NaN;
})];

/**
 * How the factor divides the strengths of bodies, and their undivided friction. Cones have kind 0 if
 * it does not divide them, 1 if it divides c and q or bounds principal stresses, 2 and 3 if they are
 * Drucker–Prager cones of in-plane stresses and of all stresses; then tan φ follows for each match.
 */
function whole(body, { factor, kept, divided }) {
  const near = (y, z) => Math.abs(y - z) <= 1e-9;
  const tangents = [], kind = body.cones.map(({ s, q, M }, number) => {
    if (!divided.has(number)) return 0;
    if (s !== undefined) return 1;
    const m = q.length, n = m === 3 ? 2 : 3;
    const slope = (directions) => { // α of ‖dev σ‖ ≤ γ − α tr σ/directions after scaling; NaN for other shapes
      const radius = norm(M.flat()) / Math.sqrt(m - n / directions), share = (i) => (i < n ? 1 / directions : 0);
      const along = (q.slice(0, n).reduce((sum, y) => sum + y, 0) / radius) * (directions / n);
      const square = (i, j) => M.reduce((sum, row) => sum + row[i] * row[j], 0) / radius ** 2;
      const is = q.every((y, i) => near(y / radius, along * share(i))) && range(m).every((i) =>
        range(m).every((j) => near(square(i, j), (i === j ? 1 : 0) - (i < n && j < n ? 1 / directions : 0))));
      return is ? along / Math.SQRT2 : NaN;
    };
    const sine = m === 3 ? slope(2) : NaN, eta = sine > 0 ? sine / Math.sqrt(1 + sine ** 2 / 3) : slope(3);
    if (!(eta > 0)) return 1;
    tangents[number] = MATCHES.map((tangent) => (tangent(eta) <= 1e3 ? tangent(eta) : NaN)); // as in Python
    return sine > 0 ? 2 : 3;
  });
  const times = kind.map((of) => (of ? factor : 1));
  const rubs = body.rubs.map((of, k) =>
    of.map((values) => values.map((y, i) => (kept[k + 1][i] ? y : factor * y))));
  return { ...body, rubs, division: { times, kind, tangents, kept: kept.slice(1) } };
}
