// An upper bound: a velocity, corrected until it is admissible, and its dissipation. The Bernstein
// coefficients at vertices and edges are whole numbers times 2^ev, also after the correction.

const OF_FLOW = { 2: [2.67, 16.3], 3: [4.51, 79.0] }; // docs/proof.md, an upper bound, 4.

/** Return the upper bound that a velocity proves: the smaller one of two corrections. */
function upperBound(body, flow) {
  const rows = contactOf(body), found = [];
  let why = null;
  for (const resting of flow.resting.length ? [true, false] : [false]) {
    try { found.push(boundOf(body, bent(body, flow, rows, resting))); } catch (error) {
      if (!(error instanceof Refused)) throw error;
      why = error;
    }
  }
  if (!found.length) throw why;
  return found.reduce((one, other) => (other.proven < one.proven ? other : one));
}

/** Read the coefficients by point: vertices, then edges. */
function readVelocity(body, A) {
  const { d, w, n, cells, x } = body, count = x.length / d, wide = d === 2 ? 6 : 10;
  const v = A.velocity?.data ?? refuse("there is no velocity"), nodes = A.nodes?.data;
  if (nodes?.length !== n * wide || A.velocity.shape[1] !== d) {
    refuse("nodes or velocity do not fit the cells");
  }
  checkSizes(largest(v.filter(Number.isFinite)), 1e30);
  if (!v.every(Number.isFinite) ||
    !nodes.every((k) => k >= 0 && k < v.length / d)) refuse("some nodes have no velocity");
  const { number, pairs: ends } = body;
  const edges = new Map(), P = new Int32Array(n * wide), pairs = [], nodeAt = [];
  for (let c = 0; c < n; c++) for (let k = 0; k < wide; k++) {
    let place = cells[c * w + k];
    if (k >= w) {
      const pair = ends[k - w].map((a) => cells[c * w + a]).sort((a, b) => a - b),
        key = pair[0] * count + pair[1];
      place = edges.get(key) ?? (pairs.push(pair), count + edges.size);
      edges.set(key, place);
    }
    P[c * wide + k] = place;
    nodeAt[place] ??= nodes[c * wide + k];
    if (nodeAt[place] !== nodes[c * wide + k]) refuse("the velocity is not continuous");
  }
  const top = largest(v), ev = Math.floor(Math.log2(top || 1)) - 260, V = rounded(v, ev + 1);
  const at = (place, i) => V[nodeAt[place] * d + i] ?? 0n;
  const Q = range(count + pairs.length).map((place) => range(d).map((i) => (place < count ? 2n * at(place, i)
    : 4n * at(place, i) - at(pairs[place - count][0], i) - at(pairs[place - count][1], i))));
  const facet = range(body.f).map((i) => {
    const c = Math.floor(body.outer[i] / w), own = body.places[i];
    return [...own.map((a) => [a, a]), ...pairsOf(d).map((pair) => pair.map((a) => own[a]))]
      .map(([a, b]) => P[c * wide + number[a][b]]);
  });
  const held = Q.map(() => new Array(d).fill(false)), guides = new Map();
  const axis = (v) => body.revolved && x[v * d] === 0;
  if (body.revolved) held.forEach((of, p) =>
    { if (p < count ? axis(p) : pairs[p - count].every(axis)) of.fill(true); });
  facet.forEach((places, i) => places.forEach((p) => {
    for (let k = 0; k < d; k++) held[p][k] ||= body.held[i * d + k] === 1;
    const g = row(body.guided, d, i);
    if (norm(g)) guides.set(p, [...(guides.get(p) ?? []), exact(g).v]);
  }));
  const flow = { Q, P, ev, wide, number, facet, held, guides, pairs, count, top,
    v: (p, i) => v[nodeAt[p] * d + i] };
  const placesOf = (some) => [...new Set(some.flatMap((c) => row(P, wide, c)))];
  // Groups of points that move as rigid bodies: elastic cells, rigid surfaces, nearly rigid cells
  flow.groups = sets(body, (c, o) => body.cone[c] < 0 && body.cone[o] < 0)
    .filter((of) => body.cone[of[0]] < 0).map((of) => ({ every: placesOf(of), lock: [] }));
  body.rigid.forEach((tag, g) => flow.groups.push({ plate: g, every: [...new Set(facet.filter(
    (_, i) => body.surface[i] === tag).flat())], lock: row(body.rigidHeld, d, g) }));
  flow.resting = sets(body, (c, o, glued) => glued && body.cone[c] >= 0 && body.cone[c] === body.cone[o])
    .filter((of) => body.cone[of[0]] >= 0).map((of) => ({ every: placesOf(of), lock: [] }))
    .filter((of) => rigid(body, flow, of, true).off <= 1e-5 * top);
  return flow;
}

/** Sets of cells that share vertices or facets and satisfy a test. */
function sets(body, test) {
  const { w, n, cells, across } = body, joined = new Joined(n), first = new Map(), found = new Map();
  for (let c = 0; c < n; c++) for (let k = 0; k < w; k++) {
    const other = across[c * w + k], v = cells[c * w + k], before = first.get(v);
    if (other >= 0 && test(c, Math.floor(other / w), true)) joined.join(c, Math.floor(other / w));
    if (before !== undefined && test(c, before, false)) joined.join(c, before);
    if (before === undefined || (body.cone[before] >= 0 && body.cone[c] < 0)) first.set(v, c);
  }
  for (let c = 0; c < n;
    c++) (found.get(joined.of(c)) ?? found.set(joined.of(c), []).get(joined.of(c))).push(c);
  return [...found.values()];
}

/**
 * Rigid motions of some points: the components that supports leave free, the motion of a point by
 * each unit component (`columns`), and the motion of a vertex by whole numbers (`at`).
 */
function motionsOf(body, flow, { every, lock = [] }, loose = false) {
  const { d, x, X, revolved } = body, { held, guides, count, pairs } = flow, turns = revolved ? 1 : 2 * d - 3;
  const mine = every.filter((p) => p < count), unit = (m) => range(3).map((i) => (i === m ? 1 : 0)),
    fixed = loose ? [] : mine.filter((v) => held[v].some((y) => y)), first = fixed[0] ?? mine[0];
  // Around an axis, bodies move along it; v = ru contains the radius
  const turned = (a, m) => (revolved ? [0, a[0]] : d === 2 ? [-a[1], a[0]] : cross(unit(m), a));
  const armOf = (v, about) => range(d).map((i) => x[v * d + i] - (revolved ? 0 : x[about[i] * d + i]));
  // A possible hinge takes coordinate j from a vertex. Vertices held along another axis must share it.
  const hinges = range(d).map((j) => [first, ...range(d).flatMap((i) => {
    const there = i === j ? [] : fixed.filter((v) => held[v][i]);
    return there.length && there.every((v) => X[v * d + j] === X[there[0] * d + j]) ? [there[0]] : [];
  })]).reduce((places, some) => places.flatMap((of) => some.map((v) => [...of, v])), [[]]);
  const turnsAbout = (about) => range(turns).map((m) => !fixed.some((v) =>
    turned(armOf(v, about), m).some((y, i) => held[v][i] && y !== 0)));
  const countOf = (about) => turnsAbout(about).filter((is) => is).length;
  const centre = hinges.reduce((best, about) => (countOf(about) > countOf(best) ? about : best));
  const arm = (v) => armOf(v, centre);
  const free = [...range(d).map((i) => !revolved && !fixed.some((v) => held[v][i])), ...turnsAbout(centre)],
    stuck = !loose && mine.some((v) => guides.has(v));
  if (!revolved && lock.some((y) => y)) free.fill(false, d);
  lock.forEach((is, i) => { if (is) free[i] = false; });
  if (stuck) free.fill(false, d);
  const far = Math.max(...mine.map((v) => (revolved ? x[v * d] : norm(arm(v)))));
  const ofVertex = (v) => free.map((is, m) => (!is ? new Array(d).fill(0)
    : m < d ? range(d).map((i) => (i === m ? 1 : 0)) : turned(arm(v), m - d).map((y) => y / far)));
  const columns = (p) => (p < count ? ofVertex(p) : pairs[p - count].map(ofVertex).reduce(
    (one, other) => one.map((row, i) => row.map((y, k) => (y + other[i][k]) / 2))));
  const at = (v, shift, turn) => {
    const a = range(d).map((i) => X[v * d + i] - X[centre[i] * d + i]), [t] = turn;
    const moved = revolved ? [0n, t * X[v * d]] : d === 2 ? [-t * a[1], t * a[0]] : cross(turn, a);
    return shift.map((y, i) => y + moved[i]);
  };
  const whole = (way) => { // even numbers, because velocities of edges are means
    const even = (y, e) => 2n * BigInt(Math.round(y * 2 ** -(e + 1)));
    return [Array.from(way.slice(0, d), (y) => even(y, flow.ev)),
      Array.from(way.slice(d), (y) => even(y / far, flow.ev - body.e))];
  };
  return { every, mine, centre, free, stuck, lock, columns, at, whole };
}

/** The rigid motion nearest to the motion of a group. */
function rigid(body, flow, group, loose = false) {
  const found = motionsOf(body, flow, group, loose), { mine, every, free, columns } = found,
    size = free.length;
  const gram = range(size).map((i) => range(size).map((j) => (i === j && !free[i] ? 1 : 0))),
    right = new Array(size).fill(0);
  for (const v of mine) {
    const parts = columns(v);
    parts.forEach((p, i) =>
      parts.forEach((q, j) => { gram[i][j] += p.reduce((sum, y, k) => sum + y * q[k], 0); }));
    parts.forEach((p, i) => { right[i] += p.reduce((sum, y, k) => sum + y * flow.v(v, k), 0); });
  }
  const inverse = inverted(gram) ?? refuse("a rigid motion is lost to rounding");
  const motion = inverse.map((row) => row.reduce((sum, y, k) => sum + y * right[k], 0));
  const off = loose ? Math.max(...every.map((p) => Math.max(...range(body.d).map((k) => Math.abs(
    columns(p).reduce((sum, column, m) => sum + column[k] * motion[m], 0) - flow.v(p, k)))))) : 0;
  return { ...found, off, motion: found.whole(motion) };
}

/** Coefficients that are admissible except for changes of volume. */
function bent(body, flow, rows, resting) {
  const { d, n, X } = body, { P, wide, held, guides, facet, ev } = flow;
  const Q = flow.Q.map((q, p) => q.map((y, i) => (held[p][i] ? 0n : y))),
    unitOf = new Array(Q.length).fill(-1);
  const moveAcross = (q, fixed, directions) => { // remove the components along directions
    const axes = axesOf(d).filter((_, i) => fixed[i]);
    const ways = [];
    for (const g of directions) {
      if (!g.some((y, i) => y !== 0n && !fixed[i])) continue;
      if (!ways.some((h) => cross(g, h).every((y) => y === 0n))) ways.push(g);
    }
    if (!ways.length) return q;
    const all = [...axes, ...ways], none = q.map(() => 0n);
    if (all.length >= d) return none;
    let along = [[-all[0][1], all[0][0]]];
    if (d === 3 && all.length === 2) along = [cross(all[0], all[1])];
    if (d === 3 && all.length === 1) {
      const k = all[0].reduce((best, y, i) => (y * y < all[0][best] ** 2n ? i : best), 0);
      const first = cross(all[0], range(3).map((i) => (i === k ? 1n : 0n)));
      along = [first, cross(all[0], first)];
    }
    return along.reduce((sum, t) => { // t is not zero; the share is rounded to a whole number
      const square = dot(t, t), share = square ? dot(q, t) / square : 0n;
      return sum.map((y, i) => y + share * t[i]);
    }, none);
  };
  const guidesOf = (every) => every.flatMap((p) => guides.get(p) ?? []);
  const slide = (free, directions) => { // leave only axes across all guides
    if (directions.length) free.forEach((is, i) =>
      { free[i] = is && i < d && directions.every((g) => g[i] === 0n); });
  };
  for (const [p, directions] of guides) Q[p] = moveAcross(Q[p], held[p], directions);
  const groups = [...flow.groups, ...(resting ? flow.resting : [])], joined = new Joined(groups.length),
    owner = new Map();
  groups.forEach(({ every }, g) => every.forEach((p) => {
    if (owner.has(p)) joined.join(g, owner.get(p)); else owner.set(p, g);
  }));
  const merged = new Map(), plateUnit = [];
  groups.forEach(({ every, lock }, g) => {
    const at = merged.get(joined.of(g)) ?? { every: [], lock: range(d).map(() => 0) };
    merged.set(joined.of(g), { every: at.every.concat(every), lock: at.lock.map((y, i) => y || lock[i]) });
  });
  const roots = [...merged.keys()];
  const units = roots.map((g) =>
    rigid(body, flow, { every: [...new Set(merged.get(g).every)], lock: merged.get(g).lock }));
  groups.forEach(({ plate }, g) =>
    { if (plate !== undefined) plateUnit[plate] = units[roots.indexOf(joined.of(g))]; });
  units.forEach((unit, k) => {
    let [shift, turn] = unit.motion;
    unit.every.forEach((p) => { unitOf[p] = k; });
    if (unit.stuck) { // later steps move it only across the guides
      const directions = guidesOf(unit.every);
      shift = moveAcross(shift,
        unit.lock.map((is, i) => is || unit.mine.some((v) => held[v][i])), directions);
      slide(unit.free, directions);
    }
    unit.turn = turn;
    for (const p of unit.mine) Q[p] = unit.at(p, shift, turn);
    for (const p of unit.every) if (p >= flow.count) {
      const [a, b] = flow.pairs[p - flow.count];
      Q[p] = Q[a].map((y, i) => (y + Q[b][i]) / 2n);
    }
  });
  const edges = pairsOf(d);
  const opposite = (order, k) => (k < d ? order[k] : d + edges.findIndex(
    (pair) => edges[k - d].every((i) => pair.includes(order[i]))));
  const jumps = rows.flatMap(({ a, b, order, normal, e, c, mu }) => facet[a].map((p, k) => {
    const size = norm(normal.map((y) => num(y, e)));
    return { p, q: b < 0 ? -1 : facet[b][opposite(order, k)], normal, c, mu, a, factor: exact([mu]),
      unit: normal.map((y) => num(y, e) / size), square: dot(normal, normal) };
  }));
  const jumpOf = ({ p, q }) => Q[p].map((y, i) => y - (q < 0 ? 0n : Q[q][i]));
  /** Penetration of a jump, or lack of opening for its slip: positive unless the jump is admissible. */
  const enters = (row) => {
    const w = jumpOf(row), along = dot(w, row.normal), m = row.factor.v[0],
      one = 1n << BigInt(-2 * row.factor.e);
    const fine = along <= 0n && along * along * (one + m * m) >= m * m * dot(w, w) * row.square;
    const v = w.map((y) => num(y, ev)), height = v.reduce((sum, y, i) => sum + y * row.unit[i], 0);
    const depth = height + row.mu * norm(v.map((y, i) => y - height * row.unit[i]));
    return fine ? Math.min(depth, 0) : Math.max(depth, 1e-30 * flow.top);
  };
  // Whole bodies move away first, then rigid groups, then single points.
  const bodyOf_ = new Array(Q.length).fill(-1);
  for (let c = 0; c < n; c++) P.subarray(c * wide, (c + 1) * wide).forEach((p) =>
    { bodyOf_[p] = body.pieces.of(c); });
  const bound = new Joined(n), byPlace = new Map();
  for (let c = 0; c < n; c++) P.subarray(c * wide, (c + 1) * wide).forEach((p) => {
    if (byPlace.has(p)) bound.join(body.pieces.of(c), body.pieces.of(byPlace.get(p))); else byPlace.set(p, c);
  });
  for (const unit of units) unit.every.forEach((p) => bound.join(body.pieces.of(byPlace.get(p)),
    body.pieces.of(byPlace.get(unit.every[0]))));
  const movers = new Map();
  const moverOf = (p, whole) => {
    const key = whole ? `b${bound.of(bodyOf_[p])}` : unitOf[p] >= 0 ? `u${unitOf[p]}` : `p${p}`;
    if (movers.has(key)) return movers.get(key);
    let mover = units[unitOf[p]] && { ...units[unitOf[p]], parts: [units[unitOf[p]]] };
    if (whole) {
      const every = range(Q.length).filter((k) => bound.of(bodyOf_[k]) === bound.of(bodyOf_[p]));
      const parts = [...new Set(every.map((k) => unitOf[k]))].filter((k) => k >= 0);
      mover = motionsOf(body, flow,
        { every, lock: range(d).map((i) => parts.some((k) => units[k].lock[i])) });
      if (mover.stuck) slide(mover.free, guidesOf(every));
      mover.parts = parts.map((k) => units[k]);
    } else if (!mover) {
      const free = held[p].map((is) => !is), still = range(d).map(() => 0);
      slide(free, guidesOf([p]));
      mover = { every: [p], free,
        columns: () => free.map((is, i) => still.map((_, k) => (is && i === k ? 1 : 0))) };
    }
    movers.set(key, { ...mover, way: new Float64Array(mover.free.length), moves: false });
    return movers.get(key);
  };
  const apply = (mover) => {
    if (!mover.at) { // a single point
      const [p] = mover.every;
      Q[p] = Q[p].map((y, i) => y + 2n * BigInt(Math.round(mover.way[i] * 2 ** -(ev + 1))));
      return;
    }
    const [shift, turn] = mover.whole(mover.way),
      moved = new Map(mover.mine.map((v) => [v, mover.at(v, shift, turn)]));
    for (const p of mover.every) {
      const [a, b] = p < flow.count ? [p, p] : flow.pairs[p - flow.count];
      Q[p] = Q[p].map((y, i) => y + (moved.get(a)[i] + moved.get(b)[i]) / 2n);
    }
    for (const unit of mover.parts) unit.turn = unit.turn.map((y, i) => y + turn[i]);
  };
  for (let round = 0; round < 14; round++) {
    const depth = jumps.map(enters), worst = Math.max(0, ...depth), whole = round < 2;
    if (!(worst > 0)) break;
    movers.clear();
    const near = jumps.flatMap((row, k) => { // jumps that penetrate or nearly penetrate
      if (!(depth[k] > -1e3 * worst)) return [];
      const sides = [row.p, row.q].map((p, m) => (p < 0 ? null : [moverOf(p, whole), m ? -1 : 1, p]));
      if (sides[0][0] === sides[1]?.[0]) return [];
      const both = sides.filter((of) => of).map(([mover, sign, p]) => ({ mover, columns: mover.columns(p).map(
        (column, i) => column.map((y) => (mover.free[i] ? sign * y : 0))) }));
      const gain = both.reduce((sum, { columns }) =>
        sum + columns.reduce((y, of) => y + dots(of, row.unit) ** 2, 0), 0);
      return gain > (body.revolved ? 1e-8 : 0.01) ? [{ row, both, deep: depth[k] }] : [];
    });
    let more = true;
    for (let sweep = 0; sweep < Math.max(100, 3e5 / near.length) && more; sweep++) {
      more = false;
      for (const { row, both, deep } of near) {
        const m = range(d).map((k) => both.reduce((sum, { mover, columns }) => sum + columns.reduce(
          (y, of, i) => y + of[k] * mover.way[i], 0), 0));
        const along = dots(m, row.unit), across = m.map((y, i) => y - along * row.unit[i]),
          slip = norm(across);
        const now = deep + along + row.mu * slip;
        const wanted = whole ? deep - 2 * worst : deep > 0 ? -deep : Math.min(0, deep);
        if (now <= wanted + 0.25 * (whole ? worst : Math.max(deep, 0))) continue;
        more = true;
        const way = row.unit.map((y, i) => y + (slip > 0 ? (row.mu * across[i]) / slip : 0));
        const steps = both.map(({ columns }) => columns.map((of) => dots(of, way)));
        const gain = steps.flat().reduce((sum, y) => sum + y * y, 0);
        if (gain > 0) both.forEach(({ mover }, k) => {
          mover.moves = true;
          steps[k].forEach((y, i) => { mover.way[i] -= ((now - wanted) / gain) * y; });
        });
      }
    }
    for (const mover of movers.values()) if (mover.moves && !(whole && more)) apply(mover);
  }
  const bad = jumps.findIndex((row) => enters(row) > 0);
  if (bad >= 0) refuse("bodies penetrate each other, or separate too little for their slip");
  const slip = jumps.reduce((sum, row) => {
    if (!(row.c > 0)) return sum;
    const v = jumpOf(row).map((y) => num(y, ev)), along = v.reduce((y, z, i) => y + z * row.unit[i], 0);
    const size = norm(v.map((y, i) => y - along * row.unit[i])) + 64 * U * norm(v);
    return sum + (row.c * size * norm(body.area[body.outer[row.a]])) / facet[row.a].length;
  }, 0) * UP ** 0.001;
  const still = range(n).map((c) => unitOf[P[c * wide]] >= 0
    && P.subarray(c * wide, (c + 1) * wide).every((p) => unitOf[p] === unitOf[P[c * wide]]));
  return { Q, still, slip, flow, rows, plateUnit };
}

/** Parts of a simplex after its edges have been halved three times. */
function halved(d) {
  const children = d === 2 ? "00 01 02,01 11 12,02 12 22,01 02 12"
    : "00 01 02 03,01 11 12 13,02 12 22 23,03 13 23 33,01 02 03 13,01 02 12 13,02 03 13 23,02 12 13 23";
  const middle = (p, q) => p.map((y, i) => (y + q[i]) / 2);
  let parts = [range(d + 1).map((i) => range(d + 1).map((j) => (i === j ? 1 : 0)))];
  for (let times = 0; times < 3; times++) parts = parts.flatMap((part) => children.split(",").map(
    (child) => child.split(" ").map(([a, b]) => middle(part[a], part[b]))));
  return parts;
}

/** Points of these parts with their shares of the volume. */
function halvings(d) {
  const parts = halved(d), found = new Map();
  for (const part of parts) for (const [k, point] of part.entries()) { // ∫ hat × coordinate
    const at = found.get(point.join()) ?? { point, share: point.map(() => 0) };
    found.set(point.join(), at);
    at.share = at.share.map((y, i) => y + (part[k][i] + part.reduce((sum, p) => sum + p[i], 0))
      / ((d + 1) * (d + 2) * parts.length));
  }
  return [...found.values()];
}

/** Return the bound that admissible coefficients prove. */
function boundOf(body, { Q, still, slip, flow, rows, plateUnit }) {
  const { d, w, n, f, N, D, e, area, volume, cells } = body, { P, wide, ev, number, facet } = flow;
  const factorial = d === 2 ? 2 : 6, points = halvings(d);
  const eg = ev + e * (d - 1) + 1, changes = new Array(n * w).fill(0n); // −∇v times d! and the volume
  const cone = (c) => body.cones[body.cone[c]], keeps = range(n).map((c) => !still[c] && body.cone[c] >= 0 &&
    cone(c).keeps);
  const takes = range(n).map((c) => !still[c] && body.cone[c] >= 0 && cone(c).takes);
  let total = 0, size = 0, errors = 0;
  const lacks = new Float64Array(n).fill(-Infinity),
    rings = range(n).map(() => ({ reach: 1, rate: 1, radius: 1 }));
  for (let c = 0; c < n; c++) {
    if (still[c]) { // it dilates exactly as it must, but volume that flows into it changes this
      if (body.cone[c] >= 0 && cone(c).grows) lacks[c] = 0;
      continue;
    }
    if (body.cone[c] < 0) refuse("an elastic cell has a strain rate");
    const own = cone(c), gradients = range(w).map((k) => {
      const g = new Array(d * d).fill(0n);
      for (let b = 0; b < w; b++) {
        const q = Q[P[c * wide + number[k][b]]], normal = N[c * w + b];
        for (let i = 0; i < d; i++) for (let j = 0; j < d; j++) g[i * d + j] -= q[i] * normal[j];
      }
      changes[c * w + k] = range(d).reduce((sum, i) => sum + g[i * d + i], 0n);
      return g;
    });
    const rates = body.revolved ? ringRates(body, gradients, range(6).map((k) => Q[P[c * 6 + k]]), c, ev)
      : gradients.map((g) => vector(g.map((y) => num(y, eg) / factorial), d));
    const strength = body.strength.subarray(c * w, c * w + w), most = Math.max(...rates.map(norm));
    const off = 16 * U * most + 2 * own.digits * most;
    const at = (share) => share.reduce((sum, y, k) => sum + y * strength[k], 0);
    const rho = body.revolved ? body.timesRadius(c, [1, 1, 1]) : null;
    if (body.revolved) {
      rings[c] = ofRingCell(body, c);
      if (most > 0) total += ringPower(own, rates, rho.slice(0, 3));
    } else if (own.linear) {
      const powers = rates.map(own.power), sum = powers.reduce((a, b) => a + b, 0);
      total += powers.reduce((y, p, k) => y + (p + sum) * strength[k], 0) / (w * (w + 1));
    } else if (most > 0) {
      const images = rates.map(own.image), y = new Array(images[0].length);
      for (const { point, share } of points) {
        for (let i = 0; i < y.length; i++) {
          y[i] = 0;
          for (let k = 0; k < w; k++) y[i] += point[k] * images[k][i];
        }
        total += own.power(y) * at(share);
      }
    }
    const steep = own.steep * Math.max(...strength) * rings[c].reach;
    size += most * steep;
    errors += off * steep;
    if (own.grows) lacks[c] =
      Math.max(...rates.filter((_, k) => !rho || rho[k] > 0).map(own.short)) + off * own.alert;
    else if (!own.keeps && !own.takes) refuse("a cone does not bound a stress other than the mean stress");
  }
  const left = undone(body, { Q, flow, rows }, changes, eg, keeps, takes);
  let cost = 0;
  for (let c = 0; c < n; c++) {
    if (left.gradients[c] === 0) continue;
    const steep = body.cone[c] >= 0 ? cone(c).steep * Math.max(...body.strength.subarray(c * w,
      c * w + w)) : 0;
    cost += left.gradients[c] * rings[c].rate * steep;
  }
  for (let c = 0; c < n; c++) {
    if (body.cone[c] < 0) continue;
    const more = cone(c).alert * left.gradients[c] * rings[c].rate * rings[c].radius;
    if (!(lacks[c] + more <= 0)) refuse("dilating cells dilate too little for their strain");
  }
  // The relative rounding error of a sum of n numbers is at most n U.
  const dissipation = total + (errors + cost) * UP + slip + (n * (w + 2) + 512) * U * (size + slip);
  const usual = () => works[0][3] && works[0][0] / works[0][3]; // mean velocity, weighted by the loads
  const works = [];
  for (const loads of body.loads) works.push(workOf(body, { Q, flow, changes, eg, plateUnit }, loads, left,
    works.length === 2 ? usual() : 0));
  const [work, off] = works[0], [dead, deadOff] = works[1], [other, otherOff, most] = works[2],
    excess = dissipation - dead + deadOff;
  if (!(work - off > 0) || !Number.isFinite(excess)) {
    refuse("the loads do no work larger than rounding errors");
  }
  // Loads with any factor may do the work that rounding errors of the velocity cause.
  if (body.loads[2].some && !(Math.abs(other) + otherOff <= 1e-6 * most)) refuse("loads with any factor do work");
  const proven = excess === 0 ? 0 : excess / (excess > 0 ? work - off : work + off);
  return { proven: proven + Math.abs(proven) * 4 * U,
    power: Math.max(dissipation, Math.abs(excess)) / (work - off),
    others: body.loads[2].some ? (1e-3 * Math.abs(proven) * (work - off)) / (Math.abs(other) + otherOff)
      : null };
}

/** Coefficients of r²ε times the volume, from those of v = ru and its gradients; rounded once. */
function ringRates(body, gradients, Q, c, ev) {
  const { e, D, X, cells, pairs } = body, r = range(3).map((k) => X[cells[c * 3 + k] * 2]);
  return range(6).map((k) => {
    const [a, b] = k < 3 ? [k, k] : pairs[k - 3],
      g = range(4).map((i) => r[a] * gradients[b][i] + r[b] * gradients[a][i]);
    const u = Q[k].map((y) => D[c] * y);
    return vector([g[0] - u[0], g[1], g[2] - u[1], g[3]].map((y) => num(y, ev + 2 * e) / 2), 2,
      num(u[0], ev + 2 * e) / 2);
  });
}

/** ∫ of a unit rate over r, its change by ‖∇w‖ = 1, and the largest radius. */
function ofRingCell(body, c) {
  const x = range(3).map((k) => body.point(body.cells[c * 3 + k])), r = x.map((p) => p[0]);
  const near = Math.min(...r.filter((y) => y > 0)), touches = r.includes(0);
  const far = range(3).flatMap((a) => range(3).map((b) => (touches && (r[a] > 0 || r[b] === 0) ? 0
    : norm(x[a].map((y, i) => y - x[b][i])))));
  return { reach: overRadius(r).reduce(add, 0) * UP,
    rate: (1 + Math.SQRT2 * Math.max(...far) / near) * UP, radius: Math.max(...r) };
}

/** Upper bounds on ∫ B/r over a triangle of area 1 for Bernstein polynomials B; 0 where r²ε = 0. */
function overRadius(r) {
  const axis = range(3).filter((k) => r[k] === 0), away = range(3).filter((k) => r[k] > 0);
  const found = new Array(6).fill(0), edge = (a, b) => (a + b) + 2; // numbers of edges 01, 02, 12
  if (!axis.length) for (let k = 0; k < 3; k++) { // 1/r is at most linear between vertices
    for (let j = 0; j < 3; j++) found[j] += (j === k ? 3 : 1) / 30 / r[k];
    for (const [a, b] of [[0, 1], [0, 2], [1, 2]]) found[edge(a, b)] += (a === k ||
      b === k ? 2 : 1) / 30 / r[k];
  } else if (axis.length === 1) { // the same on the opposite edge, over the distance from the axis
    const [b, c] = away, [s, t] = [1 / r[b], 1 / r[c]];
    found[b] = s / 6 + t / 18; found[c] = s / 18 + t / 6; found[edge(b, c)] = (s + t) / 9;
    found[edge(axis[0], b)] = (2 * s + t) / 9; found[edge(axis[0], c)] = (s + 2 * t) / 9;
  } else {
    const [a] = away;
    found[a] = 1 / r[a] / 3;
    for (const b of axis) found[edge(a, b)] = 2 / r[a] / 3;
  }
  return found;
}

/** ∫ of the dissipation of r²ε over r, bounded by its coefficients on parts of the triangle. */
function ringPower(own, rates, r) {
  const { parts, images } = ringParts();
  const q = rates.map(own.image), y = new Array(q[0].length);
  let total = 0;
  parts.forEach((part, p) => {
    const shares = overRadius(part.map((at) => at[0] * r[0] + at[1] * r[1] + at[2] * r[2]));
    shares.forEach((share, k) => {
      if (share === 0) return;
      const of = images[p][k];
      for (let i = 0; i < y.length; i++) {
        y[i] = 0;
        for (let j = 0; j < 6; j++) y[i] += of[j] * q[j][i];
      }
      total += (share * own.power(y)) / parts.length;
    });
  });
  return total;
}

let ringTable = null;
/** Parts of a triangle, and the coefficients of quadratics there from those on the whole one. */
function ringParts() {
  if (ringTable) return ringTable;
  const parts = halved(2), pairs = [[0, 0], [1, 1], [2, 2], [0, 1], [0, 2], [1, 2]];
  const images = parts.map((part) => pairs.map(([u, v]) => pairs.map(([a, b]) => part[u][a] * part[v][b]
    + (a === b ? 0 : part[u][b] * part[v][a]))));
  return (ringTable = { parts, images });
}

/** The work of loads, exact up to the error returned with it. */
function workOf(body, { Q, flow, changes, eg, plateUnit }, loads, left, usual) {
  const { d, w, n, f, D, N, e, x, cells } = body, { P, wide, facet, ev } = flow, factorial = d === 2 ? 2 : 6;
  if (!loads.some) return [0, 0, 0, 0];
  let found = 0, off = 0, most = 0, forces = 0; // the work, its error, and the most that loads could do
  const extent = Math.max(...range(d).map((i) => {
    let [low, high] = [Infinity, -Infinity];
    for (let k = i; k < x.length; k += d) [low, high] = [Math.min(low, x[k]), Math.max(high, x[k])];
    return high - low;
  }));
  const fastest = usual > 0 ? 1000 * usual : Infinity; // one fast body must not hide the work of free loads
  const speed = (places) =>
    Math.min(Math.max(usual, ...places.map((p) => norm(Q[p].map((y) => num(y, ev))))), fastest);
  const b = exact(loads.body_force), t = exact(loads.traction), u = exact(loads.pore_pressure);
  let sum = 0n;
  for (let c = 0; c < n; c++) {
    const force = range(d).map((i) => b.v[c * d + i]);
    if (!force.some((y) => y)) continue;
    const all = range(d).map((i) => range(wide).reduce((y, k) => y + Q[P[c * wide + k]][i], 0n));
    sum += dot(force, all) * D[c];
    const reach = norm(range(d).map((i) =>
      range(w).reduce((y, k) =>
      Math.max(y, Math.abs(x[cells[c * w + k] * d + i] - x[cells[c * w] * d + i])), 0))) * 2;
    forces += norm(force.map((y) => num(y, b.e))) * body.volume[c];
    most += norm(force.map((y) => num(y, b.e))) * body.volume[c] * speed(row(P, wide, c));
    off += norm(force.map((y) => num(y, b.e))) * reach * left.gradients[c];
  }
  found += num(sum, b.e + ev + e * d) / (factorial * wide);
  sum = 0n;
  const groups = [...range(d).map((i) => [i, i]), ...pairsOf(d)];
  for (let i = 0; i < f; i++) {
    const force = range(d).map((j) => range(d).map((k) => t.v[(i * d + j) * d + k]));
    if (!force.flat().some((y) => y)) continue;
    // (d + 2)!/(d − 1)! times the means of products
    const part = force.reduce((y, of, a) => y + groups.reduce((z, [j, k], m) => {
      const times = [a, j, k], alike = new Set(times).size, own = j === k ? 1n : 2n;
      return z + own * (alike === 1 ? 6n : alike === 2 ? 2n : 1n) * dot(of, Q[facet[i][m]]);
    }, 0n), 0n);
    sum += part * rootOf(dot(N[body.outer[i]], N[body.outer[i]]));
    forces += norm(body.area[body.outer[i]]) * Math.max(...force.map((of) =>
      norm(of.map((y, k) => (body.held[i * d + k] ? 0 : num(y, t.e))))));
    most += Math.max(...force.map((of) => norm(of.map((y, k) =>
      (body.held[i * d + k] ? 0 : num(y, t.e)))))) * norm(body.area[body.outer[i]]) * speed(facet[i]);
    off += sizeOf(part,
      t.e + ev + e * (d - 1)) + Math.max(...force.map((of) =>
      norm(of.map((y) => num(y, t.e))))) * left.through[i];
  }
  found += num(sum, t.e + ev + e * (d - 1)) / ((d - 1) * (d === 2 ? 24 : 60));
  sum = 0n;
  for (let c = 0; c < n; c++) {
    const own = range(w).map((k) => u.v[c * w + k]), grow = range(w).map((k) => changes[c * w + k]);
    if (!own.some((y) => y)) continue;
    sum += own.reduce((y, z) => y + z, 0n) * grow.reduce((y, z) => y + z, 0n) + dot(own, grow);
    const worst = Math.max(...own.map((y) => Math.abs(num(y, u.e))));
    most += (worst * Math.max(...grow.map((y) => sizeOf(y, eg)))) / factorial;
    off += worst * left.change[c];
    forces += (worst * body.volume[c] * Math.sqrt(d)) / extent; // times a velocity, as the other loads
  }
  found += num(sum, u.e + eg) / (factorial * w * (w + 1));
  if (body.rigid.length) {
    const F = exact(loads.rigid_force), M = exact(loads.rigid_moment), turns = 2 * d - 3;
    plateUnit.forEach(({ mine, turn }, g) => {
      const force = range(d).map((k) => F.v[g * d + k]), p = range(d).map((k) => body.X[mine[0] * d + k]);
      const v = mine.find((k) => body.X[k * d] !== 0n); // around an axis v = ru
      let part;
      if (body.revolved) part = num(force[1] * (Q[v][1] / body.X[v * d]), F.e + ev - e) / (2 * Math.PI);
      else {
        const parts = [[dot(force, Q[mine[0]]), F.e + ev], [-dot(cross(p, force), turn), F.e + ev],
          [dot(range(turns).map((m) => M.v[g * turns + m]), turn), M.e + ev - e]];
        const grid = Math.min(...parts.map((of) => of[1]));
        part = num(parts.reduce((y, [z, ez]) => y + (z << BigInt(ez - grid)), 0n), grid);
      }
      found += part;
      off += 8 * U * Math.abs(part);
    });
    body.rigid.forEach((tag, g) => { // largest work at speed 1; moments about the middle
      const { middle, extent: reach } = middleOf(body, tag);
      const held = row(body.rigidHeld, d, g), force = row(loads.rigid_force, d, g);
      let own = norm(force.map((y, k) => (held[k] ? 0 : y)));
      if (!body.revolved && !held.some((y) => y)) {
        const about = minus(row(loads.rigid_moment, turns, g), cross(middle, force));
        own += norm(about) / reach;
      }
      if (body.revolved) own /= 2 * Math.PI; // as the work
      forces += own;
      most += own * Math.min(flow.top, fastest);
    });
  }
  return [found, (off + 8 * U * Math.abs(found)) * UP, most, forces];
}

/** The size of a velocity that cancels changes of volume, by cell and outer facet. */
function undone(body, { Q, flow, rows }, changes, eg, keeps, takes) {
  const { d, w, n, f, N, across, area, volume, stretch } = body, factorial = d === 2 ? 2 : 6;
  const gradients = new Float64Array(n), change = new Float64Array(n), through = new Float64Array(f);
  const flux = new Array(n).fill(0n); // −∫div v times (d + 1) d!
  for (let c = 0; c < n; c++) {
    if (!keeps[c]) continue;
    const own = range(w).map((k) => changes[c * w + k]), all = own.reduce((y, z) => y + z, 0n);
    const uneven = Math.max(...own.map((y) => sizeOf(BigInt(w) * y - all, eg))) / (w * factorial);
    gradients[c] = OF_FLOW[d][0] * stretch[c][0] * stretch[c][1] * uneven * UP;
    change[c] = Math.max(...own.map((y) => sizeOf(y, eg))) / factorial;
    flux[c] = -all;
  }
  if (!flux.some((y) => y !== 0n)) return { gradients, change, through };
  const free = (side) => { // the part of an area vector along unsupported directions
    const i = body.facetAt[side];
    return i < 0 ? norm(area[side]) : norm(area[side].map((y, k) => (body.held[i * d + k] ? 0 : y)));
  };
  const meets = new Map(); // all contacts and obstacles of a facet
  const meet = (i, own) => (meets.get(i) ?? meets.set(i, []).get(i)).push(own);
  for (const { a, b, normal, c, mu } of rows) {
    meet(a, { b, c, mu, along: dot(normal, N[body.outer[a]]) });
    if (b >= 0) meet(b, { b: a, c, mu, along: 1n });
  }
  const touched = new Set([...body.contacts, ...body.obstacles]);
  const kindOf = (side) => { // 0 free surface, 1 dilating cell, 2 contact that opens, 9 no outlet
    const c = Math.floor(across[side] / w), i = body.facetAt[side];
    if (i < 0) return takes[c] ? 0 : !keeps[c] && body.cone[c] >= 0 && body.cones[body.cone[c]].grows ? 1 : 9;
    if (body.glued[i] || body.onAxis[i] || norm(body.guided.subarray(i * d, i * d + d)) ||
      !(free(side) > 0.1 * norm(area[side]))) return 9;
    if (!touched.has(body.surface[i])) return 0;
    const all = meets.get(i);
    if (!all) return 0;
    const opens = all.every(({ c, mu, along }) => !(c > 0) && !(mu > 0) && along > 0n);
    return opens && free(side) === norm(area[side]) ? 2 : 9;
  };
  const out = new Int32Array(n).fill(-1), parent = new Int32Array(n).fill(-1), order = [],
    seen = new Uint8Array(n);
  const over = (side) => { // the opposite side, also across contact with nothing else
    if (across[side] >= 0) return across[side];
    const [own, more] = meets.get(body.facetAt[side]) ?? [];
    return own && !more && own.b >= 0 && meets.get(own.b).length === 1 && kindOf(side) === 2 &&
      kindOf(body.outer[own.b]) === 2 ? body.outer[own.b] : -1;
  };
  const grow = (first) => {
    for (let at = first; at < order.length; at++) for (let k = 0; k < w; k++) {
      const side = order[at] * w + k, other = over(side), c = Math.floor(other / w);
      if (other < 0 || !keeps[c] || seen[c]) continue;
      seen[c] = 1; out[c] = other; parent[c] = order[at]; order.push(c);
    }
  };
  for (const kind of [0, 1, 2]) {
    const first = order.length;
    for (let c = 0; c < n; c++) for (let k = 0; k < w && keeps[c] && !seen[c]; k++) {
      const side = c * w + k;
      if (kindOf(side) === kind &&
        (kind < 2 || over(side) < 0 || !keeps[Math.floor(over(side) / w)])) { seen[c] = 1; out[c] = side;
      order.push(c); }
    }
    grow(first);
  }
  for (let c = 0; c < n; c++) { // no outlet: the remaining volume change must be zero
    if (!keeps[c] || seen[c]) continue;
    seen[c] = 1;
    const first = order.push(c) - 1;
    grow(first);
  }
  const onSides = new Float64Array(n), unlike = new Float64Array(n);
  const lost = () => refuse("the volume change of incompressible cells cannot be removed");
  for (const c of order.reverse()) {
    const side = out[c], own = sizeOf(flux[c], eg) / (w * factorial) + unlike[c];
    if (side < 0) { if (own !== 0) lost(); continue; }
    const share = own / free(side), i = body.facetAt[side];
    onSides[c] += share;
    if (parent[c] >= 0) {
      flux[parent[c]] += flux[c];
      onSides[parent[c]] += share;
      unlike[parent[c]] += unlike[c] + (i >= 0 ? own * 1e-5 : 0);
      if (i >= 0) for (const at of [i, body.facetAt[over(side)]]) { // both sides of contact
        through[at] += (own * norm(area[side])) / free(side) * UP;
      }
    } else if (i >= 0) {
      if (touched.has(body.surface[i]) && meets.has(i) && (flux[c] > 0n || unlike[c] !== 0)) lost();
      through[i] += (own * norm(area[side])) / free(side) * UP;
    } else onSides[Math.floor(across[side] / w)] += share;
  }
  for (let c = 0; c < n; c++) if (onSides[c] !== 0) {
    gradients[c] += OF_FLOW[d][1] * volume[c] * stretch[c][0] * stretch[c][1] ** 2 * onSides[c] * UP;
  }
  for (let c = 0; c < n; c++) if (!keeps[c]) change[c] = Math.sqrt(d) * gradients[c];
  return { gradients, change, through };
}
