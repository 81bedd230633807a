// The bodies of a proof: cells, facets, supports, loads and contact, as docs/proof.md describes them.

const LOADS = ["body_force", "traction", "pore_pressure", "rigid_force", "rigid_moment"];
const KINDS = ["", "constant_", "any_"];

const KNOWN = new Set([...KINDS.flatMap((kind) => LOADS.map((name) => kind + name)),
  ..."vertices cells cone cone_bound cone_slope cone_matrix cone_sine cone_tension".split(" "),
  ..."cone_curvature cell_strength facets surface held guided contacts contact_adhesion".split(" "),
  ..."contact_friction obstacles obstacle_normals obstacle_adhesion obstacle_friction rigid".split(" "),
  ..."rigid_held cell_kept contact_kept obstacle_kept stress velocity nodes".split(" "),
  ..."joint_force joint_traction inner_force inner_traction numbers".split(" ")]);

/** Read bodies from the arrays of a half; refuse arrays that are not valid or not supported here. */
function bodyOf(A) {
  for (const name of Object.keys(A)) if (!KNOWN.has(name)) refuse(`this checker does not know ${name}`);
  const of = (name) => A[name] ?? refuse(`${name} is missing`);
  const x = of("vertices"), d = x.shape[1], w = d + 1;
  if (d !== 2 && d !== 3) refuse("vertices have neither two nor three coordinates");
  const cells = of("cells"), n = cells.shape[0], facets = of("facets"), f = facets.shape[0];
  if (!n) refuse("there are no cells");
  if (![undefined, 0, 1].includes(A.numbers.revolved)) refuse("revolved does not consist of flags, 0 or 1");
  const revolved = !!A.numbers.revolved, turns = 2 * d - 3, plates = A.rigid?.shape[0] ?? 0;
  const data = (name, shape, fill = 0) => {
    const size = shape.reduce((a, b) => a * b, 1);
    if (!A[name]) return new Float64Array(size).fill(fill);
    if (A[name].shape.join() !== shape.join()) refuse(`the shape of ${name} does not fit the bodies`);
    return A[name].data;
  };
  const own = (name, shape) => of(name) && data(name, shape);
  const pairs = A.contacts?.shape[0] ?? 0, planes = A.obstacles?.shape[0] ?? 0;
  const body = {
    d, w, n, f, revolved, values: revolved ? 6 : w, x: data("vertices", [x.shape[0], d]),
      cells: data("cells", [n, w]),
    cone: own("cone", [n]), strength: data("cell_strength", [n, w], 1),
    facets: data("facets", [f, d]), surface: own("surface", [f]), held: own("held", [f, d]),
    guided: data("guided", [f, d]), contacts: data("contacts", [pairs, 2]),
    obstacles: data("obstacles", [planes]), towards: data("obstacle_normals", [planes, d]),
    rubs: ["contact", "obstacle"].map((of, i) => ["adhesion", "friction"].map(
      (name) => data(`${of}_${name}`, [i ? planes : pairs]))),
    rigid: data("rigid", [plates]), rigidHeld: data("rigid_held", [plates, d]),
    loads: KINDS.map((kind) => Object.fromEntries(LOADS.map((name, k) => [name, data(
      kind + name, [[n, d], [f, d, d], [n, w], [plates, d], [plates, turns]][k])]))),
  };
  const numbers = [body.x, body.strength, body.guided, body.towards, ...body.rubs.flat(),
    ...body.loads.flatMap((kind) => LOADS.map((name) => kind[name]))];
  for (const values of numbers) {
    if (!values.every(Number.isFinite)) refuse("some data are not finite");
    checkSizes(largest(values));
  }
  checkSizes(largest(body.x), 1e30);
  Object.values(A.numbers).forEach((y) => checkSizes(Math.abs(y)));
  const all = (values, test, words) => { if (!values.every(test)) refuse(words); };
  const count = x.shape[0];
  for (const of of [body.cells, body.facets]) {
    all(of, (v) => v >= 0 && v < count, "cells or facets name vertices that do not exist");
  }
  all(body.strength, (s) => s > 0, "cell_strength is not positive");
  all(range(n), (c) => { // rounding of larger numbers would hide the smaller ones
    const own = body.strength.subarray(c * w, c * w + w);
    return Math.max(...own) <= 1e6 * Math.min(...own);
  }, "cell_strength varies by a factor of more than 1e6 in a cell");
  body.rubs.flat().forEach((of) => all(of, (r) => r >= 0, "friction is negative"));
  all(body.surface, (tag) => tag >= 0, "surface has negative tags");
  const tags = new Set(body.surface);
  for (const of of [body.contacts, body.obstacles, body.rigid]) {
    all(of, (tag) => tag > 0 && tags.has(tag), "contacts, obstacles or rigid name a surface that does not exist");
  }
  for (let k = 0; k < planes; k++) {
    if (!norm(row(body.towards, d, k))) refuse("a normal of an obstacle is zero");
  }
  for (const flags of [body.held, body.rigidHeld]) all(flags, (y) => y === 0 || y === 1, "a flag is not 0 or 1");
  for (const of of [body.cells, body.facets, body.surface, body.cone, body.contacts, body.obstacles, body.rigid]) {
    all(of, Number.isInteger, "a number of a vertex, a surface or a cone is not whole");
    all(of, (y) => Math.abs(y) < 2 ** 53, "a number of a vertex, a surface or a cone is too large");
  }
  for (const of of [body.guided, body.towards]) for (let i = 0; i < of.length; i += d) {
    const size = norm(of.subarray(i, i + d));
    if (size !== 0 && !(Math.abs(size - 1) <= 1e-12)) {
      refuse("a normal of an obstacle or a guide is not a unit vector");
    }
  }
  if (plates && !A.rigid_held) refuse("rigid_held is missing");
  if (new Set(body.rigid).size < plates) refuse("rigid contains a surface twice");
  if (revolved) checkSections(body);
  const glued = new Set(body.rigid), onAxis = (i) => revolved &&
    range(d).every((k) => !body.x[body.facets[i * d + k] * d]);
  body.glued = range(f).map((i) => glued.has(body.surface[i]));
  body.onAxis = range(f).map(onAxis);
  body.cones = conesOf(A, revolved ? 4 : d === 2 ? 3 : 6);
  all(body.cone, (c) => c >= -1 && c < body.cones.length, "cone contains numbers of cones that do not exist");
  body.cone.forEach((k, c) => {
    const fixed = revolved || (k >= 0 && (body.cones[k].k || body.cones[k].f > 0));
    if (fixed && body.strength.subarray(c * w, c * w + w).some((y) => y !== 1)) {
      refuse("cell_strength is given for bodies of revolution, or for cones with a tensile strength");
    }
  });
  body.blocks = body.cone.every((c) => c < 0); // no cell can yield
  if (body.blocks && (revolved ||
    !(pairs || planes))) refuse("no cell can yield, so nothing limits the load");
  if (revolved && body.cone.some((c) => c >= 0 &&
    !body.cones[c].c)) refuse("a cone has no bound, which is not supported for bodies of revolution");
  body.radius = (c) => (body.cone[c] < 0 ? Infinity
    : body.cones[body.cone[c]].radius * Math.min(...body.strength.subarray(c * w, c * w + w)));
  for (const kind of body.loads) kind.some = LOADS.some((name) => kind[name].some((y) => y !== 0));
  const named = range(pairs).map((k) => [...body.contacts.subarray(2 * k, 2 * k + 2)].sort().join());
  if (new Set(named).size < pairs) refuse("contacts contains two surfaces twice");
  shape(body);
  glue(body);
  checkLoaded(body);
  overlap(body);
  return body;
}

/** Refuse sections of bodies of revolution that are not valid or not supported here. */
function checkSections(body) {
  if (body.d !== 2 ||
    !body.x.every((y, i) => i % 2 || y >= 0)) refuse("a body of revolution has negative radii");
  if (!body.rigidHeld.every((y, i) =>
    y === 1 - (i % 2))) {
    refuse("a rigid surface of a body of revolution is not limited to motion along the axis");
  }
  if (body.loads.some((of) =>
    largest(of.pore_pressure))) refuse("pore pressures are not supported for bodies of revolution");
  if (!body.strength.every((y) => y === 1)) {
    refuse("strengths that vary in space are not supported for bodies of revolution");
  }
}

/** Refuse loads that act only on supports. Only resultants load rigid surfaces. */
function checkLoaded(body) {
  const { d, f } = body,
    [{ body_force: pull, traction: push, pore_pressure: pores, rigid_force: force,
    rigid_moment: turn }] = body.loads;
  if (largest(pull) || largest(pores)) return;
  const moves = (of, facet) => {
    const free = of.map((y, k) => (body.held[facet * d + k] ? 0 : y)), guide = row(body.guided, d, facet);
    return free.some((y) => y) && (!norm(guide) || norm(cross(free, guide)) > 1e-9 * norm(free));
  };
  const at = (facet, j) => row(push, d, facet * d + j);
  if (range(f).some((i) => !body.glued[i] && !body.onAxis[i] &&
    range(d).some((j) => moves(at(i, j), i)))) return;
  const loaded = range(body.rigid.length).some((g) => {
    const held = body.rigidHeld.subarray(g * d, g * d + d), still = held.some((y) => y),
      facets = range(f).filter((i) => body.surface[i] === body.rigid[g]);
    const centre = body.point(body.facets[facets[0] * d]), sums = new Array(3 * d - 3).fill(0);
    let size = 0, far = 0;
    for (const i of facets) range(d).forEach((j) => {
      const own = body.radiiOn(i)[j],
        part = at(i, j).map((y) => (y * own * norm(body.area[body.outer[i]])) / d);
      const corner = body.point(body.facets[i * d + j]), middle = range(d).map((a) => range(d).reduce(
        (sum, k) => sum + body.x[body.facets[i * d + k] * d + a], corner[a]) / body.w - centre[a]);
      [...part, ...cross(middle, part)].forEach((y, k) => { sums[k] += y; });
      far = Math.max(far, norm(middle));
      size += norm(part);
    });
    const own = force.subarray(g * d, g * d + d),
      about = cross(centre, [...own]).map((y, m) => turn[g * (2 * d - 3) + m] - y);
    return sums.some((y, k) => (k < d ? !held[k] && (Math.abs(y) > 1e-12 * size || own[k])
      : !still && !body.revolved && (Math.abs(y) > 1e-12 * size * far || about[k - d])));
  });
  if (!loaded) refuse("only supports are loaded, so every load factor would be a bound");
}

/** Compute (d − 1)! times outward area vectors N and d! times volumes D, exactly and as doubles. */
function shape(body) {
  const { d, w, n, x, cells } = body, size = largest(x);
  const X = exact(x, Math.floor(Math.log2(size || 1)) - 110);
  const vertex = (c, k) => range(d).map((i) => X.v[cells[c * w + k] * d + i]);
  const N = new Array(n * w), D = new Array(n);
  for (let c = 0; c < n; c++) {
    const at = range(w).map((k) => vertex(c, k));
    for (let k = 0; k < w; k++) {
      const [a, ...others] = at.filter((_, j) => j !== k);
      const edges = others.map((b) => b.map((y, i) => y - a[i]));
      let normal = d === 2 ? [edges[0][1], -edges[0][0]] : cross(edges[0], edges[1]);
      const height = dot(normal, a.map((y, i) => y - at[k][i]));
      if (height === 0n) refuse("a cell has no volume");
      if (height < 0n) normal = normal.map((y) => -y);
      N[c * w + k] = normal;
      D[c] = height < 0n ? -height : height;
    }
  }
  const factor = d === 2 ? 1 : 2, e = X.e;
  Object.assign(body, { X: X.v, e, N, D,
    area: N.map((v) => v.map((y) => num(y, e * (d - 1)) / factor)),
    volume: Float64Array.from(D, (y) => num(y, e * d) / (d === 2 ? 2 : 6)) });
  const sizes = range(n).map((c) => Math.max(...range(d).map((i) => {
    const at = range(w).map((k) => body.x[cells[c * w + k] * d + i]);
    return Math.max(...at) - Math.min(...at);
  })));
  if (!body.volume.every((v, c) => v > 0 && sizes[c] >= 1e-20 && sizes[c] <= 1e20)) {
    refuse("a cell is too small or too large for the computation");
  }
  // Sizes of the map from the regular simplex with edges 1 to a cell, and of its inverse.
  const regular = d === 2 ? [[1, 0], [0.5, Math.sqrt(0.75)]] : [[1, 0, 0],
    [0.5, Math.sqrt(0.75), 0], [0.5, Math.sqrt(1 / 12), Math.sqrt(2 / 3)]];
  const back = d === 2 ? [[1, 0], [-Math.sqrt(1 / 3), Math.sqrt(4 / 3)]] : [[1, 0, 0],
    [-Math.sqrt(1 / 3), Math.sqrt(4 / 3), 0], [-Math.sqrt(1 / 6), -Math.sqrt(1 / 6), Math.sqrt(1.5)]];
  body.maps = [];
  body.stretch = range(n).map((c) => {
    const edges = range(d).map((k) => range(d).map(
      (i) => num(X.v[cells[c * w + k + 1] * d + i] - X.v[cells[c * w] * d + i], e)));
    const product = (rows, columns) => norm(rows.flatMap((row) => range(d).map(
      (i) => row.reduce((sum, r, k) => sum + r * columns[k][i], 0))));
    const slopes = range(d).map((k) => body.area[c * w + k + 1].map((y) => y / (d * body.volume[c])));
    const turned = range(d).map((i) => range(d).map((k) => regular[k][i]));
    body.maps[c] = turned.map((row) => range(d).map((i) => row.reduce((sum, r, k) => sum + r * slopes[k][i], 0)));
    return [product(back, edges) * UP, product(turned, slopes) * UP];
  });
  /** The size of a force with an error, mapped to the regular simplex like the tractions of a cell. */
  body.mapped = (c, v, off) => (norm(body.maps[c].map((row) => dots(row, v)))
    + body.stretch[c][1] * (off + 64 * U * norm(v))) * UP;
}

/** Find the opposite side of each inner side, and the side of each outer facet. */
function glue(body) {
  const { d, w, n, f, x, cells, facets, N } = body, sides = new Map();
  const pairs = pairsOf(w);
  // Numbers of the coefficients of quadratic functions in a cell: vertices, then edges
  body.number = range(w).map((a) => range(w).map((b) => (a === b ? a
    : w + pairs.findIndex(([i, j]) => i === Math.min(a, b) && j === Math.max(a, b)))));
  body.pairs = pairs;
  body.point = (v) => range(d).map((i) => x[v * d + i]);
  const along = (r, of) => r.map((y, a) => y * of[a]).concat((r.length === 2 ? [[0, 1]] : pairs).map(
    ([a, b]) => (r[a] * of[b] + r[b] * of[a]) / 2));
  /** Coefficients of r times a linear function in a cell, and of r on a facet, around an axis. */
  body.timesRadius = (c, of) => along(range(w).map((k) => x[cells[c * w + k] * d]), of);
  body.radiiOn = (i) =>
    (body.revolved ? along(body.ofFacet(i).map((v) => x[v * d]), [1, 1]) : new Array(d).fill(1));
  body.ends = (side) => body.corners[side % w].map((k) => cells[Math.floor(side / w) * w + k]);
  body.ofFacet = (i) => row(facets, d, i);
  /** Numbers in a cell of the stress values on a facet with these vertices. */
  body.on = (c, vertices) => {
    const at = vertices.map((v) => range(w).find((k) => cells[c * w + k] === v));
    return body.revolved ? [...at, body.number[at[0]][at[1]]] : at;
  };
  /** The traction times area that a moment of 1 causes on a side. */
  body.bend = (side) => {
    const ends = body.ends(side).map(body.point), area = norm(body.area[side]) * (1 - 1e-12);
    if (d === 2) return 6 / area;
    const arms = ends.map((p) => norm(p.map((y, i) => y - ends.reduce((sum, q) => sum + q[i], 0) / d)));
    return (9 * Math.max(...arms) * arms.reduce((sum, y) => sum + y * y, 0) * UP) / area ** 2;
  };
  body.reach = range(n).map((c) => Math.max(...range(d).map((k) => norm(body.point(cells[c * w + k + 1]).map(
    (y, i) => y - x[cells[c * w] * d + i])))));
  const key = (vertices) => vertices.sort((a, b) => a - b).join();
  body.corners = range(w).map((k) => range(w).filter((j) => j !== k));
  body.across = new Int32Array(n * w).fill(-1);
  for (let c = 0; c < n; c++) for (let k = 0; k < w; k++) {
    const name = key(body.corners[k].map((j) => cells[c * w + j])), side = c * w + k;
    const other = sides.get(name);
    if (other === undefined) { sides.set(name, side); continue; }
    if (body.across[other] >= 0) refuse("more than two cells share a facet");
    if (!N[side].every((y, i) => y === -N[other][i])) {
      refuse("two cells lie on one side of a facet: cells are folded");
    }
    body.across[side] = other; body.across[other] = side;
  }
  const outer = new Map([...sides].filter(([, side]) => body.across[side] < 0));
  body.outer = new Int32Array(f);
  body.places = [];
  for (let i = 0; i < f; i++) {
    const mine = row(facets, d, i), name = key([...mine]);
    if (!outer.has(name)) refuse("facets are not the outer facets of the cells");
    body.outer[i] = outer.get(name);
    outer.delete(name);
    const c = Math.floor(body.outer[i] / w);
    body.places.push(mine.map((v) => range(w).find((k) => cells[c * w + k] === v)));
  }
  if (outer.size) refuse("facets are not the outer facets of the cells");
  body.pieces = new Joined(n);
  body.across.forEach((o, s) => {
    if (o >= 0) body.pieces.join(Math.floor(s / w), Math.floor(o / w));
  });
  body.facetAt = new Int32Array(n * w).fill(-1);
  body.outer.forEach((side, i) => { body.facetAt[side] = i; });
}

/** The length of a facet in 2D; in 3D its least width. */
function widthOf(body, i) {
  const x = body.ofFacet(i).map(body.point), area = norm(body.area[body.outer[i]]);
  return body.d === 2 ? area : (2 * area) / Math.max(...x.map((p, k) => norm(minus(p, x[(k + 1) % 3]))));
}

/** The centre of a surface's vertices, and their largest distance from it. */
function middleOf(body, tag) {
  const x = range(body.f).filter((i) => body.surface[i] === tag).flatMap((i) => body.ofFacet(i).map(body.point));
  const middle = range(body.d).map((k) => x.reduce((sum, p) => sum + p[k], 0) / x.length);
  return { middle, extent: Math.max(...x.map((p) => norm(minus(p, middle)))) };
}

const boxOfPoints = (points) => [0, 1].map((end) => range(points[0].length).map(
  (i) => Math[end ? "max" : "min"](...points.map((p) => p[i]))));

/** Boxes, sorted into grids of their size, so that boxes near another box are found quickly. */
class Grid {
  constructor(boxes) {
    Object.assign(this, { boxes, at: new Map(), levels: new Map(), tries: 0 }); // boxes of each level
    boxes.forEach((box, i) => {
      const level = Math.ceil(Math.log2(Math.max(...box[1].map((y, k) => y - box[0][k]))));
      (this.levels.get(level) ?? this.levels.set(level, []).get(level)).push(i);
      this.places(box, level, (at) => (this.at.get(at) ?? this.at.set(at, []).get(at)).push(i));
    });
  }

  /** Visit the places of a box in the grid of a level; return false if there are more than `most`. */
  places([low, high], level, visit, most = Infinity) {
    const [a, b] = [low, high].map((p) => p.map((y) => Math.floor(y / 2 ** level)));
    if (a.reduce((product, y, k) => product * (b[k] - y + 1), 1) > most) return false;
    for (let i = a[0]; i <= b[0]; i++) for (let j = a[1]; j <= b[1]; j++) {
      for (let k = a[2] ?? 0; k <= (b[2] ?? 0); k++) visit(`${level},${i},${j},${k}`);
    }
    return true;
  }

  /** Visit the numbers of the boxes that intersect a box. */
  near(box, visit) {
    const seen = new Set(), test = (i) => {
      if (++this.tries > 2e7) {
        refuse("there are too many neighbouring cells for this checker to test them for overlap");
      }
      if (i < 0 || seen.has(i)) return;
      seen.add(i);
      if (box[0].some((y, k) => y > this.boxes[i][1][k]) ||
        box[1].some((y, k) => y < this.boxes[i][0][k])) return;
      visit(i);
    };
    for (const [level, own] of this.levels) { // a large box has more places in a fine grid than boxes are there
      if (!this.places(box, level, (at) => (this.at.get(at) ?? [-1]).forEach(test), own.length)) own.forEach(test);
    }
  }
}

/** Refuse overlapping cells: points just inside an outer facet must be in its own cell only. */
function overlap(body) {
  const { d, w, n } = body, every = range(n).map((c) => cornersOf(body, c)),
    grid = new Grid(every.map(boxOfPoints));
  const mix = (a, b) => a.map((y, i) => 0.999 * y + 0.001 * b[i]); // smaller overlaps are rounding errors
  for (const side of body.outer) {
    const own = Math.floor(side / w), apex = every[own][side % w];
    const base = body.corners[side % w].map((k) => mix(every[own][k], apex));
    const middle = range(d).map((i) => base.reduce((sum, p) => sum + p[i], 0) / d);
    const slice = [...base, mix(middle, apex)];
    grid.near(boxOfPoints(slice), (c) => {
      if (c !== own && !apart(slice, every[c])) refuse(`cells overlap near (${slice[0].join(", ")})`);
    });
  }
}

/** Whether a plane separates two simplices: through a facet of one, or parallel to an edge of each. */
function apart(a, b) {
  const from = (of) => of.slice(1).map((p) => minus(p, of[0]));
  const parts = (axis) => {
    const low = [Infinity, Infinity], high = [-Infinity, -Infinity];
    [a, b].forEach((of, k) => of.forEach((p) => {
      let y = 0;
      for (let i = 0; i < axis.length; i++) y += (p[i] - a[0][i]) * axis[i];
      low[k] = Math.min(low[k], y); high[k] = Math.max(high[k], y);
    }));
    const width = Math.min(high[0] - low[0], high[1] - low[1]); // an overlap of a millionth counts as 0
    return width > 0 && Math.min(...high) - Math.max(...low) <= 1e-6 * width;
  };
  const ends = [from(a), from(b)].map((of) => [...of, ...range(of.length).flatMap(
    (i) => range(i).map((j) => minus(of[i], of[j])))]);
  if (a[0].length === 2) return ends.flat().some(([u, v]) => parts([v, -u]));
  return ends.some(([p, q, r, u, v]) => [[p, q], [q, r], [p, r], [u, v]].some((of) => parts(cross(...of))))
    || ends[0].some((p) => ends[1].some((q) => parts(cross(p, q))));
}
