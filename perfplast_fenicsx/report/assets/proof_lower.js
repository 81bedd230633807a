// A lower bound: a stress in equilibrium with the loads, within the strength of every cell.
// Forces of cells are in units of 1/d!, moments of 1/((d + 1) d!), both exact, about the origin.

const OF_STRESS = { 2: [2.78, 0.96], 3: [12.2, 3.26] }; // docs/proof.md, a lower bound, 4.

/** The stress on file, and the factors of the loads that it balances. */
function readStress(body, A) {
  const { d, w, n } = body, stress = A.stress?.data ?? refuse("there is no stress");
  const { bound, factor = bound, any_factor: other = 0 } = A.numbers;
  if (stress.length !== n * w * d * d || !stress.every(Number.isFinite)) refuse("the stress fits nothing");
  if (largest(stress) > 1e60) refuse("the stress is larger than 1e60");
  for (let i = 0; i < n * w; i++) for (let j = 0; j < d; j++) for (let k = 0; k < j; k++) {
    const at = i * d * d;
    if (stress[at + j * d + k] !== stress[at + k * d + j]) refuse("the stress is not symmetric");
  }
  if (![factor, other].every(Number.isFinite)) refuse("a factor is not finite");
  return { stress, factors: [factor, 1, other] };
}

/** The lower bound that a stress proves. */
function lowerBound(body, { stress, factors }) {
  const { d, w, n, f, N, D, across, facets, cells } = body, [factor] = factors;
  if (body.cones.some((cone) => !(cone.c > 0))) refuse("this checker does not know cones without a bound");
  const load = (name, size) => combined(body.loads.map((of, k) => ({ factor: factors[k], values: of[name] })), size);
  const [force, traction, pores] = [load("body_force", n * d), load("traction", f * d * d), load("pore_pressure", n * w)];
  const es = Math.min(Math.floor(Math.log2(largest(stress) || 1)) - 160, force.e + body.e, traction.e, pores.e);
  const S = rounded(stress, es), b = finer(force, es - body.e), t = finer(traction, es), u = finer(pores, es);
  const e = es + body.e * (d - 1), factorial = d === 2 ? 2 : 6, s = d - 1;
  const X = (v, i) => body.X[v * d + i];
  const pull = (c, k, side) => range(d).map((i) => {
    let sum = -u[c * w + k] * N[side][i];
    for (let j = 0; j < d; j++) sum += S[(c * w + k) * d * d + i * d + j] * N[side][j];
    return sum;
  });
  const F = new Array(n), M = new Array(n), onSides = new Float64Array(n), loose = new Float64Array(n);
  const pulls = new Float64Array(n), size = (v) => norm(v.map((y) => sizeOf(y, e))) * UP;
  for (let c = 0; c < n; c++) {
    const rest = range(d).map((i) => b[c * d + i] * D[c]);
    const middle = range(d).map((i) => range(w).reduce((sum, k) => sum + X(cells[c * w + k], i), 0n));
    for (let k = 0; k < w; k++) pull(c, k, c * w + k).forEach((y, i) => { rest[i] -= y; });
    F[c] = rest; M[c] = cross(middle, rest); pulls[c] = size(rest) / factorial;
  }
  /** Let −r act at the vertices of a side, d vectors with errors of `off`. */
  const act = (side, vertices, r, off) => {
    const c = Math.floor(side / w), sum = range(d).map((i) => vertices.reduce((y, v) => y + X(v, i), 0n));
    vertices.forEach((v, j) => {
      F[c] = F[c].map((y, i) => y - r[j][i]);
      cross(sum.map((y, i) => y + X(v, i)), r[j]).forEach((y, i) => { M[c][i] -= y; });
    });
    onSides[c] += (Math.max(...r.map(size)) + off) / s;
    loose[c] += off / s;
  };
  for (let side = 0; side < n * w; side++) {
    const other = across[side];
    if (other < side) continue;
    const [c, o] = [side, other].map((y) => Math.floor(y / w));
    const corners = body.corners[side % w], vertices = corners.map((k) => cells[c * w + k]);
    const jumps = corners.map((k, j) => {
      const there = pull(o, range(w).find((i) => cells[o * w + i] === vertices[j]), other);
      return pull(c, k, side).map((y, i) => y + there[i]);
    });
    const bears = (y) => body.radius(y) * (1 + 1e-3 * Math.sign(body.volume[y] - body.volume[c]));
    act(bears(o) > bears(c) ? other : side, vertices, jumps, 0);
  }
  const roots = new Array(f), rest = range(f).map((i) => {
    const side = body.outer[i], c = Math.floor(side / w);
    roots[i] = rootOf(dot(N[side], N[side]));
    return body.places[i].map((k, j) => pull(c, k, side).map((y, a) => y - t[(i * d + j) * d + a] * roots[i]));
  });
  const anchors = [];
  const frees = (i) => range(d).map((a) => (body.held[i * d + a] ? 0 : 1));
  /** What contact presses with: factors of a direction that leave least. */
  const press = (i, j, along, free, ea) => {
    const a = along.map((y, k) => num(y, ea) * free[k]), square = a.reduce((sum, y) => sum + y * y, 0);
    const all = along.reduce((sum, y) => sum + num(y, ea) ** 2, 0);
    if (!(square > 1e-12 * all)) return null;
    return -rest[i][j].reduce((sum, y, k) => sum + num(y, e) * a[k], 0) / square;
  };
  const exert = (i, j, along, q, ea) => { // q times a direction, q a double in units of 2^(e − ea)
    const grid = e - ea, whole = BigInt(Math.round(q * 2 ** -grid));
    rest[i][j] = rest[i][j].map((y, k) => y + whole * along[k]);
  };
  /** Contact that rubs exerts what the stress has, as far as c + μp lets it. */
  const rub = (a, o, j, p, normal, c, mu) => {
    const unit = normal.map((y) => y / norm(normal)), area = norm(body.area[body.outer[a]]) * s * (1 - 8 * U);
    const from = o < 0 || frees(a).every((is) => is) ? rest[a][j] : rest[o][p].map((y) => -y);
    const v = from.map((y) => num(y, e)), along = v.reduce((sum, y, k) => sum + y * unit[k], 0);
    const off = 32 * U * norm(v), across = v.map((y, k) => y - along * unit[k]), slip = norm(across);
    const most = Math.max(0, (c * area + mu * Math.max(-along, 0)) * (1 - 64 * U) - off);
    const share = slip > most ? most / slip : 1, pressed = Math.max(-along, 0) + off;
    const whole = across.map((y, k) => BigInt(Math.round((share * y - pressed * unit[k]) * 2 ** -e)));
    rest[a][j] = rest[a][j].map((y, k) => y - whole[k]);
    if (o >= 0) rest[o][p] = rest[o][p].map((y, k) => y + whole[k]);
    // Of what presses, and of what friction has left, a part each, so that all together neither pull nor slip.
    const room = Math.min(pressed - off, (most - share * slip) / (1 + mu)) / s / (2 * w);
    for (const way of [unit, ...range(d).map((i) => range(d).map((k) => (i === k ? 1 : 0)))]) {
      if (room > 0) anchors.push({ i: a, j, o, p: p ?? 0, along: way, most: room });
    }
  };
  for (const { a, b: other, order, normal, e: ea, c, mu } of contactOf(body)) {
    for (let j = 0; j < d; j++) {
      if (c > 0 || mu > 0) { rub(a, other, j, order?.[j], normal.map((y) => num(y, ea)), c, mu); continue; }
      let q = press(a, j, normal, frees(a), ea);
      const back = normal.map((y) => -y);
      if (q === null && other >= 0) q = press(other, order[j], back, frees(other), ea);
      if (!(q > 0)) continue;
      exert(a, j, normal, q, ea);
      if (other >= 0) exert(other, order[j], back, q, ea);
      const unit = normal.map((y) => num(y, ea)), long = norm(unit);
      anchors.push({ i: a, j, o: other, p: other >= 0 ? order[j] : 0, along: unit.map((y) => -y / long),
        most: (q * long) / s / (2 * w) });
    }
  }
  for (let i = 0; i < f; i++) {
    const guide = [...body.guided.subarray(i * d, i * d + d)], free = frees(i);
    for (let j = 0; j < d; j++) {
      if (norm(guide)) {
        const g = exact(guide), q = press(i, j, g.v, free, g.e);
        if (q !== null) exert(i, j, g.v, q, g.e);
        anchors.push({ i, j, o: -1, along: guide, most: Infinity });
      }
      free.forEach((is, k) => {
        if (!is) anchors.push({ i, j, o: -1, along: free.map((_, a) => (a === k ? 1 : 0)), most: Infinity });
      });
    }
    const vertices = [...facets.subarray(i * d, i * d + d)];
    const off = Math.max(...range(d).map((j) => norm(free.map((is, a) => is * sizeOf(t[(i * d + j) * d + a], es))))) * 2 ** (body.e * (d - 1));
    act(body.outer[i], vertices, rest[i].map((r) => r.map((y, a) => (free[a] ? y : 0n))), off);
  }
  const push = (forces) => anchors.forEach(({ i, j, o, p, along }, k) => {
    const whole = along.map((y) => BigInt(Math.round(y * forces[k] * s * 2 ** -e)));
    for (const [facet, at, sign] of [[i, j, -1n], [o, p, 1n]]) {
      const r = range(d).map((m) => whole.map((y) => (m === at ? sign * y : 0n)));
      if (facet >= 0) act(body.outer[facet], [...facets.subarray(facet * d, facet * d + d)], r, 0);
    }
  });
  const pushes = reactions(body, anchors, F, M, loose, e, push);
  pushes.forEach((p, i) => { const c = Math.floor(body.outer[i] / w); onSides[c] += p; loose[c] += p; });
  passOn(body, F, M, loose, onSides, e);
  const [ofSides, ofForce] = OF_STRESS[d];
  let over = 0;
  for (let c = 0; c < n; c++) {
    if (body.cone[c] < 0) continue;
    const cone = body.cones[body.cone[c]], [large, inverse] = body.stretch[c];
    const regular = body.volume[c] / (d === 2 ? Math.sqrt(3) / 4 : Math.SQRT2 / 12);
    const inside = ofSides * onSides[c] + ofForce * pulls[c];
    const tau = inside > 0 ? (large * large * inverse * inside * UP) / regular : 0;
    for (let k = 0; k < w; k++) {
      const at = (c * w + k) * d * d, v = vector(stress.subarray(at, at + d * d), d);
      const ratio = cone.ratio(v) + (tau + 256 * U * norm(v)) * cone.weak;
      over = Math.max(over, ratio / body.strength[c * w + k]);
      if (!(over < Infinity)) refuse("what the stress leaves cannot be balanced");
    }
  }
  const proven = over <= 1 ? factor : (factor / over) * (1 - 4 * U);
  if (body.loads[1].some && over > 1) refuse(`stresses are ${over} times as large as they may be`);
  return { proven, power: 0 };
}

/** The inverse of a matrix of doubles, or null. */
function inverted(matrix) {
  const n = matrix.length, a = matrix.map((row, i) => [...row, ...range(n).map((j) => (i === j ? 1 : 0))]);
  for (let k = 0; k < n; k++) {
    let p = k;
    for (let i = k; i < n; i++) if (Math.abs(a[i][k]) > Math.abs(a[p][k])) p = i;
    if (!(Math.abs(a[p][k]) > 0)) return null;
    [a[k], a[p]] = [a[p], a[k]];
    const pivot = a[k][k];
    for (let j = 0; j < 2 * n; j++) a[k][j] /= pivot;
    for (let i = 0; i < n; i++) {
      const times = i === k ? 0 : a[i][k];
      if (times) for (let j = k; j < 2 * n; j++) a[i][j] -= times * a[k][j];
    }
  }
  return a.map((row) => row.slice(n));
}

/**
 * Largest forces that supports and contact exert besides on facets, so that pieces balance. First
 * `push` lets them exert what is found in doubles; with that they have little left to exert.
 */
function reactions(body, anchors, F, M, loose, e, push) {
  const { d, w, n, cells } = body, sums = new Map(), turns = 2 * d - 3, high = d + turns;
  const factorial = d === 2 ? 2 : 6, held = new Float64Array(body.f);
  for (let c = 0; c < n; c++) {
    const p = body.pieces.of(c), x = range(d).map((i) => body.X[cells[c * w] * d + i]);
    if (!sums.has(p)) sums.set(p, { x, far: 0, row: sums.size * high });
    const at = sums.get(p);
    for (let k = 0; k < w; k++) {
      at.far = Math.max(at.far, norm(at.x.map((y, i) => num(body.X[cells[c * w + k] * d + i] - y, body.e))));
    }
  }
  const rest = () => {
    for (const at of sums.values()) Object.assign(at, { F: new Array(d).fill(0n), M: new Array(turns).fill(0n), off: 0 });
    for (let c = 0; c < n; c++) {
      const at = sums.get(body.pieces.of(c));
      F[c].forEach((y, i) => { at.F[i] += y; });
      M[c].forEach((y, i) => { at.M[i] += y; });
      at.off += loose[c];
    }
    const missing = [], errors = [];
    for (const at of sums.values()) {
      const shift = cross(at.x.map((y) => BigInt(w) * y), at.F), parts = at.F.map((y) => [y, e, factorial]);
      at.M.forEach((y, i) => parts.push([y - shift[i], e + body.e, factorial * w * at.far]));
      for (const [y, ey, over] of parts) {
        missing.push(num(y, ey) / over);
        errors.push((2 * at.off + 8 * U * Math.abs(num(y, ey) / over)) * UP);
      }
    }
    return [missing, errors];
  };
  let [missing, errors] = rest();
  const some = errors.map((y, i) => y > 0 || missing[i] !== 0);
  if (!some.includes(true)) return held;
  const radii = range(n).map((c) => body.radius(c)).filter(Number.isFinite);
  const weight = anchors.map((of) => {
    const side = body.outer[of.i], radius = body.radius(Math.floor(side / w));
    return Math.min(of.most, norm(body.area[side]) * (Number.isFinite(radius) ? radius : Math.max(...radii)));
  });
  const columns = anchors.map((of, k) => [[of.i, of.j, 1], [of.o, of.p, -1]].flatMap(([i, j, sign]) => {
    if (i < 0) return [];
    const at = sums.get(body.pieces.of(Math.floor(body.outer[i] / w)));
    const x = range(d).map((m) => body.places[i].concat(body.places[i][j]).map(
      (q) => body.X[cells[Math.floor(body.outer[i] / w) * w + q] * d + m] - at.x[m])
      .reduce((sum, y) => sum + num(y, body.e), 0) / (d * w * at.far));
    return [...of.along.map((y) => y / d), ...cross(x, of.along)].map((y, m) => [at.row + m, sign * y * weight[k]]);
  }));
  for (let more = true; more;) { // rows that forces of active ones reach
    more = false;
    for (const column of columns) {
      const there = column.filter(([, y]) => y !== 0);
      if (there.some(([i]) => some[i])) for (const [i] of there) more = more || !some[i], some[i] = true;
    }
  }
  const rows = range(missing.length).filter((i) => some[i]), place = new Map(rows.map((i, k) => [i, k]));
  const lost = () => refuse("neither supports nor contact hold a body against what is left of its balance");
  if (rows.length > 400) refuse("there are too many bodies for this checker");
  const gram = rows.map(() => new Array(rows.length).fill(0)), least = rows.map(() => 0);
  for (const column of columns) for (const [i, y] of column) if (place.has(i)) least[place.get(i)] += y * y;
  const scale = least.map((y) => 2 ** -Math.round(Math.log2(Math.sqrt(y || 1)))), sized = gram.map((row) => [...row]);
  for (const column of columns) for (const [i, y] of column) for (const [j, z] of column) {
    if (!place.has(i)) continue;
    const [a, b] = [place.get(i), place.get(j)], part = y * z * scale[a] * scale[b];
    gram[a][b] += part; sized[a][b] += Math.abs(part);
  }
  const inverse = inverted(gram) ?? lost();
  // That the inverse is near enough makes the matrix without rounding a regular one.
  const rounding = (4 * columns.length + 256) * U;
  const off = Math.max(...inverse.map((row, i) => range(rows.length).reduce((sum, j) => {
    const product = row.reduce((y, z, k) => y + z * gram[k][j], 0) - (i === j ? 1 : 0);
    return sum + Math.abs(product) + row.reduce((y, z, k) => y + Math.abs(z) * sized[k][j], 0) * rounding;
  }, 0)));
  if (!(off < 0.5)) lost();
  const first = inverse.map((row) => row.reduce((sum, y, k) => sum - y * scale[k] * missing[rows[k]], 0));
  const pushed = columns.map((column, k) => weight[k] * column.reduce((sum, [i, y]) => (place.has(i)
    ? sum + y * scale[place.get(i)] * first[place.get(i)] : sum), 0));
  push(pushed);
  [missing, errors] = rest();
  const needed = inverse.map((row) => row.reduce((sum, y, k) => sum
    + Math.abs(y) * scale[k] * (Math.abs(missing[rows[k]]) + errors[rows[k]]), 0) * UP);
  const worst = 2 * off * Math.max(...needed);
  columns.forEach((column, k) => {
    const force = weight[k] * UP * column.reduce((sum, [i, y]) => (place.has(i)
      ? sum + Math.abs(y) * scale[place.get(i)] * (needed[place.get(i)] + worst) : sum), 0);
    if (!(force + Math.abs(pushed[k]) * UP <= anchors[k].most)) lost();
    held[anchors[k].i] += force;
    if (anchors[k].o >= 0) held[anchors[k].o] += force;
  });
  return held;
}

/** Let each cell of a tree pass on what acts on it and all beyond, through one of its facets. */
function passOn(body, F, M, loose, onSides, e) {
  const { d, w, n, cells, across } = body, towards = new Int32Array(n).fill(-1), order = [];
  const factorial = d === 2 ? 2 : 6, seen = new Uint8Array(n);
  const roots = [...range(n)].sort((a, b) => body.volume[b] - body.volume[a]);
  for (const root of roots) {
    if (seen[root]) continue;
    seen[root] = 1;
    for (let at = order.push(root) - 1; at < order.length; at++) for (let k = 0; k < w; k++) {
      const other = across[order[at] * w + k], c = Math.floor(other / w);
      if (other < 0 || seen[c]) continue;
      seen[c] = 1; towards[c] = other; order.push(c);
    }
  }
  const point = (v) => range(d).map((i) => body.x[v * d + i]);
  const ends = (c) => body.corners[towards[c] % w].map((k) => cells[c * w + k]);
  const centre = (c) => range(d).map((i) => ends(c).reduce((sum, v) => sum + body.x[v * d + i], 0) / d);
  const apart = (p, q) => norm(p.map((y, i) => y - q[i]));
  const all = Float64Array.from(loose), bent = Float64Array.from(loose, (y, c) => {
    const first = point(cells[c * w]);
    return y ? 2 * y * Math.max(...range(d).map((k) => apart(point(cells[c * w + k + 1]), first))) : 0;
  });
  for (const c of order.reverse()) {
    if (towards[c] < 0) continue;
    const there = Math.floor(across[towards[c]] / w), middle = centre(c);
    const sum = range(d).map((i) => ends(c).reduce((y, v) => y + body.X[v * d + i], 0n));
    const shift = cross(sum.map((y) => BigInt(w) * y), F[c]);
    const moment = norm(M[c].map((y, i) => sizeOf(BigInt(d) * y - shift[i], e + body.e))) / (d * w * factorial);
    const arms = ends(c).map((v) => apart(point(v), middle)), area = norm(body.area[towards[c]]);
    const bend = d === 2 ? 6 / area
      : (9 * Math.max(...arms) * arms.reduce((y, a) => y + a * a, 0)) / area ** 2;
    const force = norm(F[c].map((y) => sizeOf(y, e))) / factorial + all[c];
    const passed = (force + (moment + bent[c]) * bend) * UP;
    onSides[c] += passed; onSides[there] += passed;
    F[c].forEach((y, i) => { F[there][i] += y; });
    M[c].forEach((y, i) => { M[there][i] += y; });
    all[there] += all[c];
    bent[there] += bent[c] + (towards[there] < 0 ? 0 : all[c] * apart(middle, centre(there)));
  }
}
