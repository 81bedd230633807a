// A lower bound of rigid blocks: forces on joints and supports that balance the loads on each block.
// The forces of the file are decomposed into pressures and shear forces within their limits. Other forces
// balance the residual, but forces at their limits have no spare capacity for them. Therefore a file
// can have a second set of forces inside the limits, so that a weighted mean of both sets has spare
// capacity; the bound is the mean of both factors with the same weights.

/** Read the forces on joints at the vertices of facets, and the load factors that they balance. */
function readForces(body, A) {
  const { d, f } = body, { bound, factor = bound, any_factor: other = 0 } = A.numbers;
  const { inner_factor: less, inner_any_factor: beside = 0 } = A.numbers;
  const set = (prefix, factors) => {
    const force = A[`${prefix}_force`]?.data ?? refuse(`${prefix}_force is missing`);
    const traction = A[`${prefix}_traction`]?.data ?? new Float64Array(f * d * d);
    if (force.length !== f * d * d ||
      traction.length !== f * d * d) refuse("forces on joints do not fit the facets");
    if (![force, traction].every((of) =>
      of.every(Number.isFinite))) refuse("forces on joints are not finite");
    if (!factors.every(Number.isFinite)) refuse("a factor is missing or not finite");
    return { force, traction, factors };
  };
  return { best: set("joint", [factor, 1, other]),
    inner: A.inner_force ? set("inner", [less, 1, beside]) : null };
}

/** Points of joints: vertices of facets in contact, with exact normals and tangents. */
function spotsOf(body) {
  const { d, X } = body, times = new Int32Array(body.f), spots = [];
  for (const { a, b, order, normal, e, c, mu } of contactOf(body)) {
    const vertices = body.ofFacet(a),
      small = [...range(d)].sort((i, k) => Math.abs(num(normal[i], e)) - Math.abs(num(normal[k], e)));
    let ways = range(d - 1).map((k) =>
      range(d).map((i) => X[vertices[k + 1] * d + i] - X[vertices[0] * d + i]));
    if (b < 0) ways = d === 2 ? [[-normal[1], normal[0]]] : [0, 1].map((k) =>
      cross(normal, range(3).map((i) => (i === small[k] ? 1n : 0n))));
    for (const i of b < 0 ? [a] : [a, b]) times[i]++;
    const long = (v) => norm(v.map((y) => num(y, 0))), sizes = ways.map(long), size = long(normal);
    const area = norm(body.area[body.outer[a]]) * (d - 1);
    for (let j = 0; j < d; j++) spots.push({ a, j, o: b, p: b < 0 ? 0 : order[j], normal, size, ways,
      sizes, area, c, mu,
      unit: normal.map((y) => num(y, 0) / size),
        units: ways.map((v, k) => v.map((y) => num(y, 0) / sizes[k])) });
  }
  const held = (i) => body.held.subarray(i * d, i * d + d).some((y) => y) ||
    norm(body.guided.subarray(i * d, i * d + d)) > 0;
  if (body.rigid.length) refuse("rigid blocks are combined with rigid surfaces of plates");
  times.forEach((number, i) => {
    if (number > 1) refuse("a facet is in contact with two others");
    if (number && held(i)) refuse("facets in contact are also supported");
  });
  return spots;
}

/** Return the lower bound that forces on joints prove. */
function blockBound(body, { best, inner }) {
  const { d, w, n, f, N, D, X, cells } = body, spots = spotsOf(body);
  const at = (of, i, j) => of.subarray((i * d + j) * d, (i * d + j + 1) * d), less = 1 - 1e-11;
  const sized = (units, y) => norm(range(d).map((i) => units.reduce((sum, of, k) => sum + of[i] * y[k], 0)));
  /** Components of a vector's tangential part in the basis of tangents. */
  const across = ({ units }, v) => inverted(units.map((p) => units.map((q) => dots(p, q)))).map(
    (row) => row.reduce((sum, y, k) => sum + y * dots(units[k], v), 0));
  const partsOf = ({ force, traction }) =>
    spots.map((spot) => ({ pressure: Math.max(-dots(at(force, spot.a, spot.j), spot.unit), 0),
    shear: across(spot, at(force, spot.a, spot.j)), adhesion: across(spot, at(traction, spot.a, spot.j)) }));
  const [one, two] = [best, inner ?? best].map(partsOf),
    axes = axesOf(d);
  const mixed = (a, b, share) => a.map((y, k) => (1 - share) * y + share * b[k]);
  /** Forces reduced to their limits, and the spare capacity that remains. */
  const within = ({ pressure, shear, adhesion }, { units, mu, c }) => {
    const cut = (y, limit) =>
      (sized(units, y) > limit ? y.map((z) => (z * limit * less) / sized(units, y)) : y);
    const own = { pressure, shear: cut(shear, mu * pressure * less), adhesion: cut(adhesion, c * less) };
    own.room = mu > 0 ? Math.max(mu * pressure * less - sized(units, own.shear), 0) / (1 + mu) : pressure;
    own.rest = Math.max(c * less - sized(units, own.adhesion), 0);
    return own;
  };
  const inside = spots.map((spot, k) => within(two[k], spot));
  const attempt = (share) => {
    const factors = mixed(best.factors, (inner ?? best).factors, share);
    const load = loadsAt(body, factors);
    const [force, traction] = [load("body_force", n * d), load("traction", f * d * d)];
    const top = Math.floor(Math.log2(Math.max(largest(best.force), largest(best.traction)) || 1)) - 160;
    const es = Math.min(top - body.e * (d - 1), force.e + body.e, traction.e),
      left = new Left(body, es + body.e * (d - 1));
    const b = finer(force, es - body.e), t = finer(traction, es), { e, unit, factorial } = left;
    for (let c = 0; c < n; c++) {
      const pull = range(d).map((i) => b[c * d + i] * D[c]);
      const middle = range(d).map((i) => range(w).reduce((sum, k) => sum + X[cells[c * w + k] * d + i], 0n));
      left.F[c] = pull;
      left.M[c] = cross(middle, pull);
      pull.forEach((y, i) => { if (y !== 0n) left.acts[c * d + i] = 1; });
    }
    const act = (i, r, off) => left.act(body.outer[i], body.ofFacet(i), r, off), none = axes[0].map(() => 0n);
    for (let i = 0; i < f; i++) {
      const root = rootOf(dot(N[body.outer[i]], N[body.outer[i]])),
        own = range(d).map((j) => [...t.slice((i * d + j) * d, (i * d + j + 1) * d)]);
      if (!own.flat().some((y) => y !== 0n)) continue;
      const off = Math.max(...own.map((y) =>
        norm(y.map((z) => sizeOf(z, es))))) * 2 ** (body.e * (d - 1)) * UP;
      act(i, own.map((y) => y.map((z) => -z * root)), off);
      own.flat().forEach((y, k) =>
        { if (y !== 0n) left.acts[Math.floor(body.outer[i] / w) * d + (k % d)] = 1; });
    }
    /** Apply forces at a vertex of a facet, and opposite forces at the vertex of the opposite facet. */
    const push = (i, j, o, p, F) => [[i, j, 1n], [o, p, -1n]].forEach(([facet, vertex, sign]) => {
      if (facet < 0) return;
      const c = Math.floor(body.outer[facet] / w), v = body.ofFacet(facet)[vertex],
        x = range(d).map((m) => X[v * d + m]);
      F.forEach((y, m) => { left.F[c][m] += sign * y; });
      cross(x, F).forEach((y, m) => { left.M[c][m] += sign * BigInt(w) * y; });
    });
    const times = (v, size, y) => v.map((z) => z * BigInt(Math.round((y / size) * 2 ** -e)));
    const sum = (vectors) => vectors.reduce((u, v) => u.map((y, i) => y + v[i]), none), anchors = [];
    const touched = new Set(spots.flatMap(({ a, o }) => [a, o]));
    spots.forEach((spot, k) => {
      const { a, j, o, p, normal, size, ways, sizes, area, mu, c } = spot;
      const own = within({ pressure: (1 - share) * one[k].pressure + share * two[k].pressure,
        shear: mixed(one[k].shear, two[k].shear, share), 
        adhesion: mixed(one[k].adhesion, two[k].adhesion, share) }, spot);
      const pressed = times(normal, size, -own.pressure * unit),
        sheared = sum(ways.map((v, m) => times(v, sizes[m], own.shear[m] * unit)));
      const [press, shear] = [pressed, sheared].map((v) => norm(v.map((y) => num(y, e))) / unit);
      // the numbers are rounded
      push(a, j, o, p, shear <= mu * press * (1 - 1e-12) ? sum([pressed, sheared]) : pressed);
      const besides = (way, most, weight, point) =>
        { if (most > 0) anchors.push({ i: a, j, o, p, way, e: 0, most,
        weight: Math.min(weight, most), point }); };
      const [part, small] = [0.99 / Math.sqrt(d), 0.99 / (d - 1)];
      const spare = mu ? (mu * press * (1 - 1e-12) - shear) / (1 + mu) : press; // of the rounded forces
      const room = Math.min(own.room, Math.max(spare, 0));
      if (mu > 0) for (const way of axes) besides(way, part * room, share * part * inside[k].room, true);
      else besides(normal, 0.99 * room, share * 0.99 * inside[k].room, true);
      if (!(c > 0)) return;
      const sticks = sum(ways.map((v, m) => times(v, sizes[m], own.adhesion[m] * area))),
        holds = norm(sticks.map((y) => num(y, e)));
      if (holds <= c * area * (1 - 1e-12)) for (const [i, q, way] of [[a, j, -1n], [o, p, 1n]]) {
        if (i >= 0) act(i, range(d).map((m) => (m === q ? sticks.map((y) => way * y) : none)), 0);
      }
      const hat = area / (d - 1), held = c - (holds <= c * area * (1 - 1e-12) ? holds / area : 0);
      for (const way of ways) besides(way, small * Math.min(own.rest, held) * hat,
        share * small * inside[k].rest * hat, false);
    });
    for (let i = 0; i < f; i++) if (!touched.has(i)) {
      const guide = row(body.guided, d, i), ways = axes.filter((_, k) => body.held[i * d + k]);
      if (norm(guide)) ways.push(exact(guide).v);
      for (let j = 0; j < d; j++) for (const way of ways) {
        const size = norm(way.map((y) => num(y, 0))),
          [p, q] = [best, inner ?? best].map(({ force: of }) =>
          dots(at(of, i, j), way.map((y) => num(y, 0) / size)));
        push(i, j, -1, 0, times(way, size, ((1 - share) * p + share * q) * unit));
        anchors.push({ i, j, o: -1, p: 0, way, e: 0, most: Infinity, point: true });
      }
    }
    const strong = Math.max(0, ...anchors.map((of) => of.weight ?? 0)) || 2 ** (top + 160);
    for (const of of anchors) of.weight ??= strong;
    reactions(body, anchors, left);
    return { proven: factors[0] - Math.abs(factors[0]) * 4 * U, power: 0 };
  };
  let why = null; // start with the smallest share that leaves spare capacity
  for (let share = 1e-14; ; share = share < 1 / 8 ? 8 * share : 1) {
    try { return attempt(share); } catch (error) {
      if (!(error instanceof Refused)) throw error;
      why = error;
    }
    if (share === 1 || !inner) throw why;
  }
}
