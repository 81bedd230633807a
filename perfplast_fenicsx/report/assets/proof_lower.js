// A lower bound: a stress in equilibrium with the loads, within the strength of every cell. Another
// stress balances its residual forces, and its size lowers the bound (docs/proof.md, a lower bound).

/** 1/2π, times 2^226. */
const ROUND = 0xA2F9836E4E441529FC2757D1F534DDC0DB6295993C439041FE5163ABn;

const OF_STRESS = { 2: [2.78, 0.96], 3: [12.2, 3.26], rings: [3.7, 1.56] };

/** Read the stress and the load factors that it balances. */
function readStress(body, A) {
  const { d, n } = body;
  if (body.blocks) return readForces(body, A);
  const stress = A.stress?.data ?? refuse("there is no stress");
  const { bound, factor = bound, any_factor: other = 0 } = A.numbers;
  if (stress.length !== n * body.values * d * d) refuse("the stress does not fit the cells");
  if (largest(stress.filter(Number.isFinite)) > 1e60) refuse("the stress is larger than 1e60");
  if (![factor, other].every(Number.isFinite)) refuse("a factor is not finite");
  return { stress, factors: [factor, 1, other] };
}

/**
 * Residual forces, whole numbers times 2^e. Forces on cells have the unit 1/unit, and moments about
 * the origin 1/((d + 1) d!). Around an axis, only forces along the axis count, divided by 2π.
 */
class Left {
  constructor(body, e) {
    const { d, n } = body;
    Object.assign(this, { body, e, unit: body.revolved || d === 3 ? 6 : 2, factorial: d === 2 ? 2 : 6 });
    this.F = range(n).map(() => new Array(d).fill(0n));
    this.M = range(n).map(() => new Array(2 * d - 3).fill(0n));
    // Tractions times area on sides and forces in cells, both mapped to the regular simplex, and forces
    // known only by their size. Around an axis, nothing is mapped.
    for (const name of ["onSides", "loose", "within"]) this[name] = new Float64Array(n);
    this.acts = new Uint8Array(n * d); // whether loads act along axes
  }

  size(v) { return norm(v.map((y) => sizeOf(y, this.e))) * UP; }

  /** The size of a force on a cell, mapped to the regular simplex. */
  mapped(c, v, off) { return this.body.revolved ? norm(v) * UP + off : this.body.mapped(c, v, off); }

  /** Apply −r to a side, with r at its vertices (or coefficients) and errors up to `off`. */
  act(side, vertices, r, off, bare = null) {
    const { body, F, M } = this, { X, d, w } = body, c = Math.floor(side / w);
    if (bare && vertices.some((v, j) => bare(c, range(w).find((k) => body.cells[c * w + k] === v)) &&
      this.size(r[j]))) refuse("forces act where ground with c = 0 has no stress");
    if (body.revolved) F[c][1] -= 2n * r.reduce((sum, y) => sum + y[1], 0n);
    else {
      const sum = range(d).map((i) => vertices.reduce((y, v) => y + X[v * d + i], 0n));
      vertices.forEach((v, j) => {
        F[c] = F[c].map((y, i) => y - r[j][i]);
        cross(sum.map((y, i) => y + X[v * d + i]), r[j]).forEach((y, i) => { M[c][i] -= y; });
      });
    }
    this.onSides[c] += Math.max(...r.map((v) => this.mapped(c, v.map((y) => num(y, this.e)), off))) / (d - 1);
    this.loose[c] += off / (d - 1);
  }

  /** Apply a force, and a moment about the origin, through a side. */
  carry(side, F, M, off = 0) {
    const c = Math.floor(side / this.body.w);
    if (this.body.bareEnds?.[side]) refuse("a rigid surface ends where ground with c = 0 has no stress");
    F.forEach((y, i) => { this.F[c][i] += y; });
    M.forEach((y, i) => { this.M[c][i] += y; });
    this.onSides[c] += this.onto(c, side, this.traction(side, F, M, off, 2 * off * this.body.reach[c]));
    this.loose[c] += off;
  }

  /**
   * The traction times area with which a side transmits a force and a moment, both with errors: a
   * force, the error of the force, and the traction of the moment, which is normal to a side in 2D.
   */
  traction(side, F, M, off, turn) {
    const { body, e, unit } = this, { d, w, X } = body, force = F.map((y) => num(y, e) / unit);
    if (body.revolved) return [[0, 1.5 * force[1]], 1.5 * off, 0]; // zero on the axis
    const ends = body.ends(side), sum = range(d).map((i) => ends.reduce((y, v) => y + X[v * d + i], 0n));
    const shift = cross(sum.map((y) => BigInt(w) * y), F);
    const moment = norm(M.map((y, i) => sizeOf(BigInt(d) * y - shift[i], e + body.e)));
    return [force, off, (moment / (d * w * this.factorial) + turn) * body.bend(side) * UP];
  }

  /** The size of such a traction on a cell, mapped to the regular simplex. */
  onto(c, side, [force, off, bend]) {
    const { d, area, revolved } = this.body, along = area[side];
    if (revolved || d === 3) return this.mapped(c, force, off + bend);
    return this.mapped(c, force, off) + bend * this.mapped(c, along.map((y) => y / norm(along)), 8 * U);
  }
}

/** Return the lower bound that forces on joints or a stress prove. */
function lowerBound(body, half) { return body.blocks ? blockBound(body, half) : stressBound(body, half); }

/**
 * Vertices of cells that must have zero stress: with c = 0, those of free surfaces. `body.bareEnds`
 * contains the number of such ends of each side.
 */
function bareOf(body) {
  const { d, w, n, f, cells, across } = body, at = new Set();
  const loose = range(n).map((c) => d === 2 && body.cone[c] >= 0 && !body.cones[body.cone[c]].c);
  const touched = new Set([...body.contacts, ...body.obstacles, ...body.rigid]);
  for (let i = 0; i < f; i++) {
    if (!loose[Math.floor(body.outer[i] / w)] || touched.has(body.surface[i]) ||
      [...row(body.guided, d, i), ...row(body.held, d, i)].some((y) => y)) continue;
    body.ofFacet(i).forEach((v, j) => {
      if (body.loads.every((of) => range(d).every((a) => !of.traction[(i * d + j) * d + a]))) at.add(v);
    });
  }
  for (let k = 0; k < n * w; k++) {
    if (loose[Math.floor(k / w)] && body.loads.some((of) => of.pore_pressure[k])) at.delete(cells[k]);
  }
  body.bareEnds = range(n * w).map((side) => (loose[Math.floor(side / w)] ||
    (across[side] >= 0 && loose[Math.floor(across[side] / w)])
    ? body.ends(side).filter((v) => at.has(v)).length : 0));
  return (c, k) => loose[c] && at.has(cells[c * w + k]);
}

/** Return the lower bound that a stress proves. */
function stressBound(body, half) {
  const { factors } = half, stress = half.stress.slice();
  const { d, w, n, f, N, D, X, across, facets, cells, revolved } = body, [factor] = factors;
  if (!stress.every(Number.isFinite)) refuse("the stress is not finite");
  for (let at = 0; at < stress.length; at += d * d) for (let j = 0; j < d; j++) for (let k = 0; k < j; k++) {
    if (stress[at + j * d + k] !== stress[at + k * d + j]) refuse("the stress is not symmetric");
  }
  if (revolved && range(n).some((c) => body.timesRadius(c, [1, 1, 1]).some((rho, k) => rho === 0
    && largest(stress.subarray((c * 6 + k) * 4,
      (c * 6 + k + 1) * 4))))) refuse("the stress is not zero on the axis");
  const bare = bareOf(body), load = loadsAt(body, factors);
  for (let c = 0; c < n; c++) for (let k = 0; k < w; k++) {
    if (bare(c, k)) stress.fill(0, (c * w + k) * d * d, (c * w + k + 1) * d * d);
  }
  const [force, traction, pores] =
    [load("body_force", n * d), load("traction", f * d * d), load("pore_pressure", n * w)];
  const ring = revolved ? 1 : 0, es = Math.min(Math.floor(Math.log2(largest(stress) || 1)) - 160,
    force.e + body.e * (1 + ring), traction.e + ring * (body.e - 1), pores.e);
  const S = rounded(stress, es), b = finer(force, es - body.e * (1 + ring));
  const t = finer(traction, es - ring * body.e), u = finer(pores, es);
  const left = new Left(body, es + body.e * (d - 1)), { e } = left;
  const pull = (c, k, side) => range(d).map((i) => {
    let sum = revolved ? 0n : -u[c * w + k] * N[side][i];
    for (let j = 0; j < d; j++) sum += S[(c * body.values + k) * d * d + i * d + j] * N[side][j];
    return sum;
  });
  const hoop = revolved ? range(n).map(() => []) : null;
  for (let c = 0; c < n; c++) {
    for (let i = 0; i < d; i++) if (b[c * d + i] !== 0n) left.acts[c * d + i] = 1;
    if (revolved) for (let a = 0; a < 3; a++) { // 2V(div S + r b); along r it is a hoop stress
      const rest = range(2).map((i) => D[c] * X[cells[c * 3 + a] * 2] * b[c * 2 + i]);
      for (let k = 0; k < 3; k++) pull(c, body.number[a][k], c * 3 + k).forEach(
        (y, i) => { rest[i] -= 2n * y; });
      left.F[c][1] += rest[1];
      left.within[c] = Math.max(left.within[c], sizeOf(rest[1], e) / 2);
      hoop[c].push(num(rest[0], e) / num(D[c], 2 * body.e));
    } else {
      const rest = range(d).map((i) => b[c * d + i] * D[c]);
      for (let k = 0; k < w; k++) pull(c, k, c * w + k).forEach((y, i) => { rest[i] -= y; });
      const middle = range(d).map((i) => range(w).reduce((sum, k) => sum + X[cells[c * w + k] * d + i], 0n));
      Object.assign(left.F, { [c]: rest });
      Object.assign(left.M, { [c]: cross(middle, rest) });
      left.within[c] = left.mapped(c, rest.map((y) => num(y, e)), 0) / left.factorial;
    }
  }
  for (let side = 0; side < n * w; side++) {
    const other = across[side];
    if (other < side) continue;
    const [c, o] = [side, other].map((y) => Math.floor(y / w)), vertices = body.ends(side);
    const there = body.on(o, vertices), jumps = body.on(c, vertices).map((k, j) => {
      const pulled = pull(o, there[j], other);
      return pull(c, k, side).map((y, i) => y + pulled[i]);
    });
    const bears = (y) => body.radius(y) * (1 + 1e-3 * Math.sign(body.volume[y] - body.volume[c]));
    left.act(bears(o) > bears(c) ? other : side, vertices, jumps, 0, bare);
  }
  const rest = range(f).map((i) => {
    const side = body.outer[i], root = rootOf(dot(N[side], N[side])), vertices = body.ofFacet(i);
    const at = range(d).map((j) => range(d).map((a) => t[(i * d + j) * d + a]));
    const [p, q] = vertices.map((v) => X[v * d]), [one, two] = at; // r times tractions are quadratic
    const loads = revolved ? [one.map((y) => p * y), two.map((y) => q * y),
      one.map((y, a) => (q * y + p * two[a]) / 2n)] : at;
    return body.on(Math.floor(side / w), vertices).map((k, j) => pull(Math.floor(side / w), k, side).map(
      (y, a) => y - loads[j][a] * root));
  });
  const anchors = exerted(body, rest, e, bare);
  for (let i = 0; i < f; i++) { // residual forces, and the errors of the roots
    const frees = range(d).map((a) => (body.held[i * d + a] ? 0 : 1)), c = Math.floor(body.outer[i] / w);
    for (let j = 0; j < d * d; j++) if (t[i * d * d + j] !== 0n &&
      !body.glued[i]) left.acts[c * d + (j % d)] = 1;
    const size = Math.max(...range(d).map((j) =>
      norm(frees.map((is, a) => is * sizeOf(t[(i * d + j) * d + a], es)))));
    const off = size * 2 ** (body.e * (d - 1)) * UP;
    const lost = rest[i].map((r) => r.map((y, a) => (frees[a] ? y : 0n)));
    if (!body.glued[i]) left.act(body.outer[i], body.ofFacet(i), lost, off, bare);
    else left.loose[c] += off; // errors on plates: forces known only by their size
  }
  anchors.push(...plates(body, left, rest, factors));
  reactions(body, anchors, left).forEach((p, i) => {
    const c = Math.floor(body.outer[i] / w);
    left.onSides[c] += left.mapped(c, new Array(d).fill(0), p);
    left.loose[c] += p;
  });
  passOn(body, left);
  let over = 0;
  for (let c = 0; c < n; c++) {
    if (body.cone[c] < 0) continue;
    const cone = body.cones[body.cone[c]];
    const tau = revolved ? ofRing(body, left, c) : ofCell(body, left, c);
    const theta = revolved ? body.timesRadius(c, hoop[c]) : [],
      most = revolved ? Math.max(...hoop[c].map(Math.abs)) : 0;
    const rho = revolved ? body.timesRadius(c, [1, 1, 1]) : new Array(w).fill(1);
    const used = new Array(w).fill(0), own = range(w).map((k) => bare(c, k));
    for (let k = 0; k < body.values; k++) {
      if (!(rho[k] > 0)) continue;
      const at = (c * body.values + k) * d * d;
      const v = vector(stress.subarray(at, at + d * d), d, theta[k]).map((y) => y / rho[k]);
      const off = 256 * U * (norm(v) + most) + (d * 2 ** es) / rho[k], size = tau + off; // rounded to 2^es
      if (!cone.c) { used[k] = cone.excess(v) + off * cone.growth; continue; } // scaling does not help
      const ratio = cone.ratio(v) + (size && size * cone.weak);
      over = Math.max(over, ratio / body.strength[c * w + (k < w ? k : 0)]);
      if (!(over < Infinity)) refuse("the forces that the stress leaves unbalanced cannot be balanced");
    }
    if (cone.c) continue;
    const bares = own.some((is) => is); // where σ = 0, τ = 0 too; near there τ is at most twice as steep
    const closest = Math.max(...used.filter((_, k) => !own[k]), ...(bares ? [used.reduce(add, 0) / w] : []));
    if (!(closest + (bares ? 2 : 1) * tau * cone.growth <= 0)) {
      refuse("in ground with c = 0, the stress is too close to the yield surface to balance its residual forces");
    }
  }
  const proven = over <= 1 ? factor : (factor / over) * (1 - 4 * U);
  if (body.loads[1].some && over > 1) refuse(`stresses are ${over} times as large as they may be`);
  return { proven, power: 0 };
}

/**
 * Apply forces of supports and contact that make `rest` least. Return the additional forces that they
 * can exert: { i, j, o, p, way, e, most } at a value j of facet i, and opposite at p of o, along way 2^e.
 */
function exerted(body, rest, e, bare) {
  const { d, w, f } = body, s = d - 1, anchors = [], axes = axesOf(d);
  const frees = (i) => range(d).map((a) => (body.held[i * d + a] ? 0 : 1));
  const radii = (i, j) => (body.revolved ? body.radiiOn(i)[j] : 1);
  const isBare = (i, j) => i >= 0 && j < d && bare(Math.floor(body.outer[i] / w), body.places[i][j]);
  /** The pressure of contact: the factor of a direction that makes the residual least. */
  const press = (i, j, along, free, ea) => {
    const a = along.map((y, k) => num(y, ea) * free[k]), square = a.reduce((sum, y) => sum + y * y, 0);
    const all = along.reduce((sum, y) => sum + num(y, ea) ** 2, 0);
    if (!(square > 1e-12 * all)) return null;
    return -rest[i][j].reduce((sum, y, k) => sum + num(y, e) * a[k], 0) / square;
  };
  const exert = (i, j, along, q, ea) => { // q times a direction, q a double in units of 2^(e − ea)
    const whole = BigInt(Math.round(q * 2 ** (ea - e)));
    rest[i][j] = rest[i][j].map((y, k) => y + whole * along[k]);
  };
  /** Apply the stress's traction on contact with friction, limited to c + μp. */
  const rub = (a, o, j, p, normal, c, mu) => {
    const unit = normal.map((y) => y / norm(normal)), area = norm(body.area[body.outer[a]]) * s * (1 - 8 * U);
    const from = o < 0 || frees(a).every((is) => is) ? rest[a][j] : rest[o][p].map((y) => -y);
    const v = from.map((y) => num(y, e)), along = v.reduce((sum, y, k) => sum + y * unit[k], 0);
    const off = 32 * U * norm(v) + 2 * d * 2 ** e, across = v.map((y, k) => y - along * unit[k]), slip = norm(across);
    const most = Math.max(0, (c * radii(a, j) * area + mu * Math.max(-along, 0)) * (1 - 64 * U) - off);
    const share = slip > most ? most / slip : 1, pressed = Math.max(-along, 0) + off;
    const whole = across.map((y, k) => BigInt(Math.round((share * y - pressed * unit[k]) * 2 ** -e)));
    rest[a][j] = rest[a][j].map((y, k) => y - whole[k]);
    if (o >= 0) rest[o][p] = rest[o][p].map((y, k) => y + whole[k]);
    // Parts of the pressure and of the remaining friction, so that their sum neither pulls nor slips
    const room = Math.min(pressed - off, (most - share * slip) / (1 + mu)) / s / (2 * w);
    for (const way of room > 0 ? axes : []) anchors.push({ i: a, j, o, p, way, e: 0, most: room });
  };
  const rows = contactOf(body), times = new Int32Array(f);
  for (const { a, b, c, mu } of rows) {
    for (const i of b < 0 ? [a] : [a, b]) times[i]++;
    if (b >= 0 && c + mu > 0 &&
      [a, b].every((i) => frees(i).includes(0))) {
      refuse("both sides of facets in contact with friction are supported");
    }
  }
  for (let i = 0; i < f; i++) {
    const touches = times[i] + (norm(row(body.guided, d, i)) > 0);
    if (touches > 1) refuse("a facet is in contact with two others");
    if (body.glued[i] &&
      (touches || frees(i).includes(0))) refuse("a rigid surface is in contact, or held by supports");
  }
  for (const { a, b: o, order, normal, e: ea, c, mu } of rows) for (let j = 0; j < rest[a].length; j++) {
    const p = o < 0 ? 0 : order[j];
    if (isBare(a, j) || isBare(o, p)) continue;
    const back = normal.map((y) => -y), unit = normal.map((y) => num(y, ea));
    if (c > 0 || mu > 0) { rub(a, o, j, p, unit, c, mu); continue; }
    let q = press(a, j, normal, frees(a), ea);
    if (q === null && o >= 0) q = press(o, p, back, frees(o), ea);
    if (!(q > 0)) continue;
    exert(a, j, normal, q, ea);
    if (o >= 0) exert(o, p, back, q, ea);
    const long = norm(unit);
    anchors.push({ i: a, j, o, p, way: normal, e: ea, most: (q * long) / s / (2 * w) });
  }
  for (let i = 0; i < f; i++) for (let j = 0; j < rest[i].length; j++) {
    const guide = row(body.guided, d, i), free = frees(i);
    const ways = axes.filter((_, k) => !free[k]).map((way) => ({ way, e: 0 }));
    if (norm(guide)) {
      const g = exact(guide), q = press(i, j, g.v, free, g.e);
      if (q !== null) exert(i, j, g.v, q, g.e);
      ways.push({ way: g.v, e: g.e });
    }
    const some = radii(i, j) > 0 && !isBare(i, j) ? ways : [];
    for (const of of some) anchors.push({ i, j, o: -1, p: 0, ...of, most: Infinity });
  }
  return anchors;
}

/**
 * Pass the loads' resultants on rigid surfaces, minus those of their tractions, on through the largest
 * facet of each. Return additional forces along axes k < d, or moments, that they can exert through
 * facets i, and with opposite sign through o: where they are supported, or joined to more pieces.
 */
function plates(body, left, rest, factors) {
  const { d, X } = body, { e, unit } = left, turns = 2 * d - 3, anchors = [],
    high = d + (body.revolved ? 0 : turns);
  const load = loadsAt(body, factors);
  const [force, moment] =
    [load("rigid_force", d * body.rigid.length), load("rigid_moment", turns * body.rigid.length)];
  /** times y 2^ey in units of 2^to, rounded by less than one unit. */
  const inUnits = (y, ey, to, times) =>
    (ey >= to ? (times * y) << BigInt(ey - to) : (times * y) >> BigInt(to - ey));
  body.rigid.forEach((tag, g) => {
    const facets = range(body.f).filter((i) => body.surface[i] === tag),
      held = body.rigidHeld.subarray(g * d, g * d + d);
    const area = (i) => norm(body.area[body.outer[i]]), still = held.some((y) => y);
    const F = range(d).map((k) => { // around an axis, divided by 2π, a number of 224 bits
      const [y, ey] = [force.v[g * d + k], force.e];
      return body.revolved ? inUnits(y * ROUND, ey - 226, e, BigInt(unit)) : inUnits(y, ey, e, BigInt(unit));
    });
    const M = range(turns).map((k) => inUnits(moment.v[g * turns + k], moment.e, e + body.e,
      BigInt(body.w * left.factorial)));
    for (const i of facets) {
      const vertices = body.ofFacet(i),
        sum = range(d).map((a) => vertices.reduce((y, v) => y + X[v * d + a], 0n));
      rest[i].forEach((r, j) => {
        r.forEach((y, a) => { F[a] -= body.revolved ? 2n * y : y; });
        if (!body.revolved) cross(sum.map((y, a) => y + X[vertices[j] * d + a]), r).forEach(
          (y, a) => { M[a] -= y; });
      });
    }
    const pieceOf = (i) => body.pieces.of(Math.floor(body.outer[i] / body.w)), on = new Map();
    for (const i of facets) if (!on.has(pieceOf(i)) ||
      area(i) > area(on.get(pieceOf(i)))) on.set(pieceOf(i), i);
    const [through, ...joined] = [...on.values()].sort((i, k) => area(k) - area(i));
    const centre = body.ofFacet(through)[0], p = range(d).map((a) => X[centre * d + a]);
    const about = cross(p.map((y) => BigInt(body.w) * y), F).map((y, i) => M[i] - y); // about the centre
    held.forEach((is, k) => { if (is || (body.revolved && k === 0)) F[k] = 0n; });
    const turned = still || body.revolved ? about.map(() => 0n) : about;
    const arms = cross(p.map((y) => BigInt(body.w) * y), F), none = body.revolved ? M.map(() => 0n) : null;
    const extent = Math.max(...facets.flatMap((i) => body.ofFacet(i).map((v) => norm(
      p.map((y, a) => num(X[v * d + a] - y, body.e))))));
    const at = Math.floor(body.outer[through] / body.w), pushed = range(d).filter((k) => body.loads.some(
      (of) => of.rigid_force[g * d + k] ||
        facets.some((i) => range(d).some((j) => of.traction[(i * d + j) * d + k]))));
    const off = (facets.reduce((sum, i) => sum + left.loose[Math.floor(body.outer[i] / body.w)], 0)
      + 4 * 2 ** e) * (1 + extent / body.reach[at]);
    for (const k of pushed) left.acts[at * d + k] = 1;
    left.carry(body.outer[through], F, none ?? arms.map((y, i) => y + turned[i]), off);
    const every = range(high).filter((k) => (k < d ? !(body.revolved && k === 0) : true));
    const besides = (i, o, ks) =>
      ks.forEach((k) => anchors.push({ i, o, k, centre, extent, most: Infinity }));
    if (still && !body.revolved) {
      for (const i of [through, ...joined]) besides(i, -1, every.filter((k) => k >= d || held[k]));
    }
    for (const i of joined) besides(i, through, every.filter((k) => (k < d ? !held[k] : !still)));
  });
  return anchors;
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
 * Largest additional forces of supports, contact and plates on facets, so that the pieces balance.
 * Forces computed in doubles are applied first, so that only small forces remain.
 */
function reactions(body, anchors, left) {
  const { d, w, n, cells, revolved } = body, { F, M, loose, e, unit } = left, sums = new Map();
  const turns = 2 * d - 3, high = revolved ? 1 : d + turns, held = new Float64Array(body.f);
  for (let c = 0; c < n; c++) {
    const p = body.pieces.of(c), x = range(d).map((i) => body.X[cells[c * w] * d + i]);
    if (!sums.has(p)) sums.set(p, { x, far: 0, row: sums.size * high });
    const at = sums.get(p);
    for (let k = 0; k < w; k++) {
      at.far = Math.max(at.far, norm(at.x.map((y, i) => num(body.X[cells[c * w + k] * d + i] - y, body.e))));
    }
  }
  /** Residual forces on the pieces, residual moments divided by extents, and their errors. */
  const rest = () => {
    for (const at of sums.values()) Object.assign(at,
      { F: new Array(d).fill(0n), M: new Array(turns).fill(0n), off: 0 });
    for (let c = 0; c < n; c++) {
      const at = sums.get(body.pieces.of(c));
      F[c].forEach((y, i) => { at.F[i] += y; });
      M[c].forEach((y, i) => { at.M[i] += y; });
      at.off += loose[c];
    }
    const missing = [], errors = [];
    for (const at of sums.values()) {
      const shift = cross(at.x.map((y) => BigInt(w) * y), at.F), parts = at.F.map((y) => num(y, e) / unit);
      at.M.forEach((y, i) => parts.push(num(y - shift[i], e + body.e) / (left.factorial * w * at.far)));
      for (const y of revolved ? [parts[1]] : parts) {
        missing.push(y);
        errors.push((2 * at.off + 8 * U * Math.abs(y)) * UP);
      }
    }
    return [missing, errors];
  };
  const radii = range(n).map((c) => body.radius(c)).filter(Number.isFinite);
  const cellOf = (i) => Math.floor(body.outer[i] / w), unitOf = (k) => range(d).map((i) => (i === k ? 1 : 0));
  const weight = anchors.map((of) => {
    if (of.weight !== undefined) return of.weight;
    const radius = body.radius(cellOf(of.i));
    return Math.min(of.most, norm(body.area[body.outer[of.i]]) * (radius > 0 && radius < Infinity ? radius
      : Math.max(...radii) || 1)); // c = 0 has no radius
  });
  for (const of of anchors) if (of.way) { // an exact direction, and a unit vector
    const along = of.way.map((y) => num(y, 0));
    of.size = norm(along);
    of.along = along.map((y) => y / of.size);
  }
  /** The unit force of an anchor on the piece of a facet, and its moment divided by the extent. */
  const wrench = (of, i, j) => {
    const at = sums.get(body.pieces.of(cellOf(i))), vertices = body.ofFacet(i);
    const from = (v) => range(d).map((m) => num(body.X[v * d + m] - at.x[m], body.e) / at.far);
    if (of.point) return [...of.along, ...cross(from(vertices[j]), of.along)];
    if (of.k === undefined) {
      const many = revolved ? 3 : d, force = of.along.map((y) => y / many);
      if (revolved) return [force[1]];
      const x = from(vertices[j]).map((y, m) => vertices.reduce((sum, v) => sum + from(v)[m], y) / (d * w));
      return [...force, ...cross(x, of.along)];
    }
    if (revolved) return [1];
    const turn = range(turns).map((m) => (of.k === d + m ? of.extent / at.far : 0));
    return of.k < d ? [...unitOf(of.k), ...cross(from(of.centre), unitOf(of.k))] : [...unitOf(-1), ...turn];
  };
  const columns = anchors.map((of, k) =>
    [[of.i, of.j, 1], [of.o, of.p, -1]].flatMap(([i, j, sign]) => (i < 0 ? []
    : wrench(of, i, j).map((y, m) => [sums.get(body.pieces.of(cellOf(i))).row + m, sign * y * weight[k]]))));
  let [missing, errors] = rest();
  // forces cancel along axes along which no load acts
  const idle = errors.map((_, i) => !revolved && i % high < d && missing[i] === 0);
  left.acts.forEach((is, i) =>
    { if (is) idle[sums.get(body.pieces.of(Math.floor(i / d))).row + (i % d)] = false; });
  for (const column of columns) for (const [i, y] of column) if (y !== 0) idle[i] = false;
  const some = errors.map((y, i) => !idle[i] && (y > 0 || missing[i] !== 0));
  if (!some.includes(true)) return held;
  for (let more = true; more;) { // add the rows that share forces with active rows
    more = false;
    for (const column of columns) {
      const there = column.filter(([, y]) => y !== 0);
      if (there.some(([i]) => some[i])) for (const [i] of there) more = more || !some[i], some[i] = true;
    }
  }
  const rows = range(missing.length).filter((i) => some[i]), place = new Map(rows.map((i, k) => [i, k]));
  const lost = () => refuse("neither supports nor contact carry the residual force of a body");
  if (rows.length > 1200) refuse("there are too many bodies for this checker");
  const gram = rows.map(() => new Array(rows.length).fill(0)), least = rows.map(() => 0);
  for (const column of columns) for (const [i, y] of column) if (place.has(i)) least[place.get(i)] += y * y;
  const scale = least.map((y) => 2 ** -Math.round(Math.log2(Math.sqrt(y || 1)))),
    sized = gram.map((row) => [...row]);
  for (const column of columns) for (const [i, y] of column) for (const [j, z] of column) {
    if (!place.has(i)) continue;
    const [a, b] = [place.get(i), place.get(j)], part = y * z * scale[a] * scale[b];
    gram[a][b] += part; sized[a][b] += Math.abs(part);
  }
  const inverse = inverted(gram) ?? lost();
  // If the inverse is accurate enough, the matrix without rounding errors is regular.
  const rounding = (4 * columns.length + 256) * U;
  const off = Math.max(...inverse.map((row, i) => {
    const product = new Float64Array(rows.length), size = new Float64Array(rows.length);
    product[i] = -1;
    row.forEach((y, k) =>
      { for (let j = 0; j < rows.length; j++) { product[j] += y * gram[k][j];
      size[j] += Math.abs(y) * sized[k][j]; } });
    return product.reduce((sum, y, j) => sum + Math.abs(y) + size[j] * rounding, 0);
  }));
  if (!(off < 0.5)) lost();
  const first = inverse.map((row) => row.reduce((sum, y, k) => sum - y * scale[k] * missing[rows[k]], 0));
  const pushed = columns.map((column, k) => weight[k] * column.reduce((sum, [i, y]) => (place.has(i)
    ? sum + y * scale[place.get(i)] * first[place.get(i)] : sum), 0));
  /** F and M of an anchor of a plate with size q. */
  const whole = (of, q, round = Math.round) => {
    const size = BigInt(round(q * unit * 2 ** -e)), p = range(d).map((m) => body.X[of.centre * d + m]);
    const force = unitOf(of.k).map((y) => BigInt(y) * size), arm = revolved ? [0n] : cross(p, force);
    const turn = round(q * of.extent * w * left.factorial * 2 ** -(e + body.e));
    return [force, of.k < d ? arm.map((y) => BigInt(w) * y) : range(turns).map((m) =>
      (of.k === d + m ? BigInt(turn) : 0n))];
  };
  anchors.forEach((of, k) => {
    for (const [i, j, sign] of [[of.i, of.j, 1], [of.o, of.p, -1]]) {
      if (i < 0) continue;
      if (of.k !== undefined) { left.carry(body.outer[i], ...whole(of, sign * pushed[k])); continue; }
      const times = BigInt(Math.round(((-sign * pushed[k] * (of.point ? unit : d - 1)) / of.size) * 2 ** -e));
      const force = of.way.map((y) => y * times);
      if (of.point) {
        const p = range(d).map((m) => body.X[body.ofFacet(i)[j] * d + m]);
        left.carry(body.outer[i], force.map((y) => -y), cross(p, force).map((y) => -BigInt(w) * y));
        continue;
      }
      left.act(body.outer[i], body.ofFacet(i),
        range(revolved ? 3 : d).map((m) => (m === j ? force : force.map(() => 0n))), 0);
    }
  });
  [missing, errors] = rest();
  const needed = inverse.map((row) => row.reduce((sum, y, k) => sum
    + Math.abs(y) * scale[k] * (Math.abs(missing[rows[k]]) + errors[rows[k]]), 0) * UP);
  const worst = 2 * off * Math.max(...needed);
  columns.forEach((column, k) => {
    const of = anchors[k], force = weight[k] * UP * column.reduce((sum, [i, y]) => (place.has(i)
      ? sum + Math.abs(y) * scale[place.get(i)] * (needed[place.get(i)] + worst) : sum), 0);
    if (!(force + Math.abs(pushed[k]) * UP <= of.most)) lost();
    for (const i of [of.i, of.o]) if (i >= 0) {
      if (of.k === undefined) { held[i] += force; continue; }
      const [most, off, bend] = left.traction(body.outer[i], ...whole(of, force, Math.ceil), 0, 0);
      held[i] += (norm(most) + off + bend) * UP;
    }
  });
  return held;
}

/** Pass the forces on each cell of a tree, and on all cells beyond it, on through one facet. */
function passOn(body, left) {
  const { d, w, n, cells, across } = body, { F, M, loose, onSides } = left,
    towards = new Int32Array(n).fill(-1);
  const order = [], seen = new Uint8Array(n), rooted = new Set(),
    roots = [...range(n)].sort((a, b) => body.volume[b] - body.volume[a]);
  for (const root of roots) {
    if (seen[root]) continue;
    seen[root] = 1;
    const piece = body.pieces.of(root);
    if (rooted.has(piece)) {
      refuse("cells are connected to others only where ground with c = 0 has no stress");
    }
    rooted.add(piece);
    for (let at = order.push(root) - 1; at < order.length; at++) for (let k = 0; k < w; k++) {
      const other = across[order[at] * w + k], c = Math.floor(other / w);
      if (other < 0 || seen[c] || body.bareEnds[other] > 1) continue;
      seen[c] = 1; towards[c] = other; order.push(c);
    }
  }
  const centre = (c) =>
    range(d).map((i) => body.ends(towards[c]).reduce((sum, v) => sum + body.x[v * d + i], 0) / d);
  const all = Float64Array.from(loose), bent = loose.map((y, c) => 2 * y * body.reach[c]);
  for (const c of order.reverse()) {
    if (towards[c] < 0) continue;
    const there = Math.floor(across[towards[c]] / w);
    const times = body.bareEnds[towards[c]] ? 3 : 1; // quadratic tractions are zero at one end
    const passed = left.traction(towards[c], F[c], M[c], all[c], bent[c]);
    for (const one of [c, there]) onSides[one] += times * left.onto(one, towards[c], passed);
    F[c].forEach((y, i) => { F[there][i] += y; });
    M[c].forEach((y, i) => { M[there][i] += y; });
    all[there] += all[c];
    if (towards[there] < 0) continue;
    const next = centre(there);
    bent[there] += bent[c] + all[c] * norm(centre(c).map((y, i) => y - next[i]));
  }
}

/** The size of a stress that balances the forces on a cell. */
function ofCell(body, left, c) {
  const curved = range(body.w).some((k) => body.bareEnds[c * body.w + k]);
  const [ofSides, ofForce] = OF_STRESS[curved ? "rings" : body.d], [large] = body.stretch[c];
  const regular = body.volume[c] / (body.d === 2 ? Math.sqrt(3) / 4 : Math.SQRT2 / 12);
  const inside = ofSides * left.onSides[c] + ofForce * left.within[c];
  return inside === 0 ? 0 : (large * large * inside * UP) / regular;
}

/** The same around an axis, where radial forces in the cell balance it as a plane body. */
function ofRing(body, left, c) {
  const x = range(3).map((k) => body.point(body.cells[c * 3 + k])), r = x.map((p) => p[0]);
  const mean = (of) => of.reduce(add, 0) / 3, middle = mean(x.map((p) => p[1]));
  const heights = x.map((p) => p[1] - middle), spread = heights.reduce((sum, y) => sum + y * y, 0) / 12;
  const extent = norm(range(2).map((i) => Math.max(...x.map((p) => p[i])) - Math.min(...x.map((p) => p[i]))));
  const sides = left.onSides[c], within = left.within[c], [ofSides, ofForce] = OF_STRESS.rings;
  const turn = ((sides + within) * extent) / spread,
    radial = sides + turn * Math.max(...heights.map(Math.abs));
  const inside = ofSides * sides + ofForce * (within + radial), [large, inverse] = body.stretch[c];
  if (inside === 0) return 0;
  const some = Math.min(...r.filter((y) => y > 0)), near = r.includes(0) ? Math.min(some, mean(r)) / 2 : some;
  const section = (large * large * inverse * inside) / (body.volume[c] / (Math.sqrt(3) / 4));
  return (section / near + radial / body.volume[c]) * UP;
}
