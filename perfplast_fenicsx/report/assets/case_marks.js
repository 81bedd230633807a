// Marks of a case on the bodies: arrows of loads, ticks of supports, outlines of contacts and ties.

const MARK_COLOURS = {
  load: [0.65, 0, 0], support: [0, 0.15, 0.6], contact: [0.85, 0.45, 0], tie: [0.45, 0.1, 0.55],
};
const ARROW = 0.11; // length of an arrow, as a share of the bodies
const TICK_LENGTH = 0.02;
const HEAD_SHARE = 0.25;
const MARKS_OF_FACE = 12;
const RING = 8; // arrows around a bore
const FREE_SHARE = 0.42; // length of an arrow inside a bore, relative to the distance to the opposite wall

const plus = (a, b, factor = 1) => a.map((one, k) => one + factor * b[k]);
const norm = (a) => Math.hypot(...a);
const cross = (a, b) => [0, 1, 2].map((k) => a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3]);
const unit = (a) => a.map((one) => one / (norm(a) || 1));

/** A unit vector perpendicular to another one. */
const across = (a) => unit(cross(a, Math.abs(a[2]) < 0.9 * norm(a) ? [0, 0, 1] : [0, 1, 0]));

const FUNCTIONS = {
  ...Object.fromEntries(["abs", "ceil", "cos", "cosh", "exp", "expm1", "floor", "log", "log10", "log1p", "sin", "sinh", "sqrt", "tan", "tanh"]
    .map((name) => [name, Math[name]])),
  ...Object.fromEntries(["cos", "cosh", "sin", "sinh", "tan", "tan2", "tanh"].map((name) => [`arc${name}`, Math[`a${name}`]])),
  maximum: Math.max, minimum: Math.min, fmod: (a, b) => a % b, where: (test, a, b) => (test ? a : b),
};

const OPERATORS = [
  { "|": (a, b) => Number(a || b) }, { "&": (a, b) => Number(a && b) },
  { "<=": (a, b) => Number(a <= b), ">=": (a, b) => Number(a >= b), "==": (a, b) => Number(a === b),
    "!=": (a, b) => Number(a !== b), "<": (a, b) => Number(a < b), ">": (a, b) => Number(a > b) },
  { "+": (a, b) => a + b, "-": (a, b) => a - b },
  { "*": (a, b) => a * b, "/": (a, b) => a / b, "%": (a, b) => a - b * Math.floor(a / b) },
];

/** The value of a formula at a point; NaN where it cannot be read. The page may not run text as a script. */
function formulaAt(text, [x, y, z]) {
  const words = text.match(/\*\*|[<>=!]=|[\d.]+(?:[eE][+-]?\d+)?|[A-Za-z_]\w*|\S/g) ?? [];
  const names = { x, y, z, pi: Math.PI, e: Math.E, E: Math.E };
  let at = 0;
  const next = (word) => words[at] === word && ++at;
  const atom = () => {
    const word = words[at++];
    if (word === "(") {
      const value = level(0);
      return next(")") ? value : NaN;
    }
    if (!Object.hasOwn(FUNCTIONS, word)) return Object.hasOwn(names, word) ? names[word] : Number(word ?? NaN);
    const given = [];
    if (!next("(")) return NaN;
    do given.push(level(0)); while (next(","));
    return next(")") ? FUNCTIONS[word](...given) : NaN;
  };
  const power = () => {
    if (next("-")) return -power();
    if (next("+")) return power();
    const value = atom();
    return next("**") ? value ** power() : value;
  };
  function level(depth) {
    if (depth === OPERATORS.length) return power();
    let value = level(depth + 1);
    while (Object.hasOwn(OPERATORS[depth], words[at] ?? "")) value = OPERATORS[depth][words[at++]](value, level(depth + 1));
    return value;
  }
  const value = level(0);
  return at === words.length ? value : NaN;
}

/** A number or formula at a point; 0 where it has no value. */
function valueAt(given, point) {
  if (typeof given === "number") return given;
  const found = typeof given === "string" ? formulaAt(given, point) : 0;
  return Number.isFinite(found) ? found : 0;
}

/** The direction most nearly perpendicular to all normals of a face: a cylinder's axis. */
function leastAlong(parts) {
  const area = parts.reduce((sum, { size }) => sum + size, 0);
  // powers of I - M, with the mean M of n n', have the direction of its largest eigenvalue
  let power = [0, 1, 2].map((i) => [0, 1, 2].map((j) => Number(i === j)
    - parts.reduce((sum, { normal, size }) => sum + (size / area) * normal[i] * normal[j], 0)));
  for (let k = 0; k < 12; k++) {
    const scale = Math.max(...power.flat().map(Math.abs)) || 1;
    const half = power.map((row) => row.map((x) => x / scale));
    power = half.map((row) => [0, 1, 2].map((j) => row.reduce((sum, x, i) => sum + x * half[i][j], 0)));
  }
  return unit(power.reduce((best, row) => (norm(row) > norm(best) ? row : best)));
}

/** Points of faces with outward normals, spread by area; and the ends of outlines. */
class MarkedFaces {
  static async of(data, mesh) {
    const read = async ({ ends }) => vectors(ends);
    const lines = data.lines_of_faces;
    return new MarkedFaces(data, mesh, {
      face: await integers(lines.face), ends: await read(lines), outwards: await vectors(lines.outwards),
    }, { seam: await integers(data.outlines.seam), ends: await read(data.outlines) });
  }

  constructor(data, mesh, lines, outlines) {
    Object.assign(this, { size: data.size, plane: data.plane, mesh, lines, outlines });
    this.ofFace = new Map();
    this.pressed = new Map(); // by the numbers of faces: places of arrows
    const add = (face, corners, normal, size) => {
      if (!this.ofFace.has(face)) this.ofFace.set(face, { parts: [], size: 0 });
      const found = this.ofFace.get(face);
      found.parts.push({ corners, normal, size });
      found.size += size;
    };
    const point = (array, k) => [...array.subarray(3 * k, 3 * k + 3)];
    lines.face.forEach((face, k) => {
      const corners = [point(lines.ends, 2 * k), point(lines.ends, 2 * k + 1)];
      add(face, corners, point(lines.outwards, k), norm(plus(corners[1], corners[0], -1)));
    });
    if (this.plane) return;
    mesh.faces.forEach((face, k) => {
      if (!face) return;
      const corners = [0, 1, 2].map((i) => point(mesh.points, mesh.triangles[3 * k + i]));
      const normal = cross(plus(corners[1], corners[0], -1), plus(corners[2], corners[0], -1));
      add(face, corners, unit(normal), 0.5 * norm(normal));
    });
  }

  /** Points on faces: `{ point, normal }`. */
  places(faces) {
    const parts = faces.flatMap((face) => this.ofFace.get(face)?.parts ?? []);
    const step = parts.reduce((sum, { size }) => sum + size, 0) / MARKS_OF_FACE;
    const found = [];
    let due = 0.5 * step;
    for (const { corners, normal, size } of parts) {
      const count = size > due ? Math.floor((size - due) / step) + 1 : 0;
      due += count * step - size;
      for (let k = 0; k < count; k++) {
        let [s, t] = [(0.5 + 0.7548776662 * k) % 1, (0.5 + 0.5698402910 * k) % 1];
        if (corners.length === 3 && s + t > 1) [s, t] = [1 - s, 1 - t];
        if (count === 1) [s, t] = corners.length === 3 ? [1 / 3, 1 / 3] : [0.5, 0];
        let at = plus(corners[0], plus(corners[1], corners[0], -1), s);
        if (corners.length === 3) at = plus(at, plus(corners[2], corners[0], -1), t);
        found.push({ point: at, normal });
      }
    }
    return found;
  }

  /** The bore of a face: axis, a point on it, radius and ends along the axis; null for other faces. */
  bore(face) {
    const parts = (this.ofFace.get(face)?.parts ?? []).map(({ corners, normal, size }) => ({
      normal, size, corners, centre: corners.reduce((sum, one) => plus(sum, one, 1 / corners.length), [0, 0, 0]),
    }));
    if (parts.length < 3) return null;
    const axis = this.plane ? [0, 0, 1] : leastAlong(parts);
    const one = across(axis);
    const other = cross(axis, one);
    const flat = (vector) => [one, other].map((along) => along.reduce((sum, x, k) => sum + x * vector[k], 0));
    const area = parts.reduce((sum, { size }) => sum + size, 0);
    const mean = (of) => parts.reduce((sum, part) => plus(sum, of(part), part.size / area), [0, 0]);
    const [centre, normal] = [mean((part) => flat(part.centre)), mean((part) => flat(part.normal))];
    let [above, below] = [0, 0]; // the best radius r, with centre + r normal the same for all parts
    for (const part of parts) {
      const [c, n] = [plus(flat(part.centre), centre, -1), plus(flat(part.normal), normal, -1)];
      above -= part.size * (c[0] * n[0] + c[1] * n[1]);
      below += part.size * (n[0] * n[0] + n[1] * n[1]);
    }
    const radius = above / below;
    if (!(below > 0.05 * area) || !(radius > 0)) return null; // flat, or a shaft
    const middle = plus(centre, normal, radius);
    const misses = parts.map((part) => norm(plus(plus(flat(part.centre), flat(part.normal), radius), middle, -1)));
    if (Math.max(...misses) > 0.35 * radius) return null; // straight edges: a hexagon is off by 0.2
    const heights = parts.flatMap(({ corners }) => corners.map((point) => axis.reduce((sum, x, k) => sum + x * point[k], 0)));
    const point = [0, 1, 2].map((k) => middle[0] * one[k] + middle[1] * other[k]);
    return { axis, one, other, point, radius, parts, ends: [Math.min(...heights), Math.max(...heights)] };
  }

  /** Arrows in a bore: rings at its ends and its middle, where the face is. */
  ring({ axis, one, other, point, radius, parts, ends: [low, high] }) {
    const found = [];
    for (const height of this.plane ? [0] : [low, 0.5 * (low + high), high]) {
      for (let k = 0; k < RING; k++) {
        const angle = (2 * Math.PI * (k + 0.5)) / RING;
        const inwards = plus(one.map((x) => -Math.cos(angle) * x), other, -Math.sin(angle));
        const on = (part) => part.normal.reduce((sum, x, i) => sum + x * inwards[i], 0);
        if (!parts.some((part) => on(part) > Math.cos(Math.PI / RING))) continue;
        found.push({ point: plus(plus(point, axis, height), inwards, -radius), normal: inwards, room: 2 * radius });
      }
    }
    return found;
  }

  /** Points of the arrows of a pressure: `{ point, normal, room }`, with the free distance outwards. */
  pressedPlaces(faces) {
    const key = faces.join();
    if (!this.pressed.has(key)) {
      const bores = faces.map((face) => [face, this.bore(face)]);
      const others = bores.filter(([, bore]) => !bore).map(([face]) => face);
      this.pressed.set(key, [
        ...bores.filter(([, bore]) => bore).flatMap(([, bore]) => this.ring(bore)),
        ...this.places(others).map((place) => ({ ...place, room: this.plane ? Infinity : this.freeDistance(place) })),
      ]);
    }
    return this.pressed.get(key);
  }

  /** The distance from a point on a face outwards to the next face. */
  freeDistance({ point, normal }) {
    const { points, triangles } = this.mesh;
    let nearest = Infinity;
    for (let k = 0; k < triangles.length; k += 3) {
      const [a, b, c] = [3 * triangles[k], 3 * triangles[k + 1], 3 * triangles[k + 2]];
      const [ux, uy, uz] = [points[b] - points[a], points[b + 1] - points[a + 1], points[b + 2] - points[a + 2]];
      const [vx, vy, vz] = [points[c] - points[a], points[c + 1] - points[a + 1], points[c + 2] - points[a + 2]];
      const [px, py, pz] = [normal[1] * vz - normal[2] * vy, normal[2] * vx - normal[0] * vz, normal[0] * vy - normal[1] * vx];
      const det = ux * px + uy * py + uz * pz;
      if (Math.abs(det) < 1e-30) continue;
      const [sx, sy, sz] = [point[0] - points[a], point[1] - points[a + 1], point[2] - points[a + 2]];
      const s = (sx * px + sy * py + sz * pz) / det;
      if (s < 0 || s > 1) continue;
      const [qx, qy, qz] = [sy * uz - sz * uy, sz * ux - sx * uz, sx * uy - sy * ux];
      const t = (normal[0] * qx + normal[1] * qy + normal[2] * qz) / det;
      if (t < 0 || s + t > 1) continue;
      const distance = (vx * qx + vy * qy + vz * qz) / det;
      if (distance > 1e-3 * this.size && distance < nearest) nearest = distance;
    }
    return nearest;
  }

  /** The centroid of faces, with the mean normal. */
  middle(faces) {
    const parts = faces.flatMap((face) => this.ofFace.get(face)?.parts ?? []);
    const whole = parts.reduce((sum, { size }) => sum + size, 0) || 1;
    let [point, normal] = [[0, 0, 0], [0, 0, 0]];
    for (const part of parts) {
      const centre = part.corners.reduce((sum, one) => plus(sum, one, 1 / part.corners.length), [0, 0, 0]);
      point = plus(point, centre, part.size / whole);
      normal = plus(normal, part.normal, part.size / whole);
    }
    return { point, normal };
  }

  /** The middle of the box of a body. */
  middleOf(body) {
    const { triangles, points, triangleStarts } = this.mesh;
    const [low, high] = [[Infinity, Infinity, Infinity], [-Infinity, -Infinity, -Infinity]];
    for (let corner = 3 * triangleStarts[body]; corner < 3 * triangleStarts[body + 1]; corner++) {
      for (let k = 0; k < 3; k++) {
        const x = points[3 * triangles[corner] + k];
        [low[k], high[k]] = [Math.min(low[k], x), Math.max(high[k], x)];
      }
    }
    return low.map((x, k) => 0.5 * (x + high[k]));
  }
}

/** An arrow as ends of lines; its tip is at the point where it pushes, else its tail. */
function arrowLines(point, vector, pushes) {
  const [tail, tip] = pushes ? [plus(point, vector, -1), point] : [point, plus(point, vector)];
  const side = across(vector).map((one) => one * norm(vector) * HEAD_SHARE * 0.5);
  const back = plus(tip, vector, -HEAD_SHARE);
  return [tail, tip, plus(back, side), tip, plus(back, side, -1), tip].flat();
}

/** Most of a circle around an axis, with a head, for a moment. */
function turnLines(point, axis, radius) {
  const one = across(axis).map((x) => x * radius);
  const other = cross(unit(axis), one);
  const at = (angle) => plus(plus(point, one, Math.cos(angle)), other, Math.sin(angle));
  const steps = Array.from({ length: 25 }, (_, k) => at((k / 24) * 1.6 * Math.PI));
  const found = steps.slice(1).flatMap((end, k) => [...steps[k], ...end]);
  const tip = steps.at(-1);
  const back = plus(tip, unit(plus(steps.at(-2), tip, -1)), 0.35 * radius);
  const outwards = unit(plus(tip, point, -1)).map((x) => 0.2 * radius * x);
  return [...found, ...plus(back, outwards), ...tip, ...plus(back, outwards, -1), ...tip];
}

const inSpace = (vector) => [...vector, 0, 0].slice(0, 3);

/** Arrows of a load. */
function loadLines(row, faces, marked) {
  const length = ARROW * marked.size;
  const { point: middle, normal } = marked.middle(faces);
  const whole = (given) => {
    const vector = inSpace(given);
    return norm(vector) ? arrowLines(row.point ? inSpace(row.point) : middle, unit(vector).map((x) => 1.6 * length * x),
      normal.reduce((sum, x, k) => sum + x * vector[k], 0) < 0) : [];
  };
  const found = [];
  if ("pressure" in row || Array.isArray(row.traction)) {
    const some = ("pressure" in row ? marked.pressedPlaces(faces) : marked.places(faces)).map(({ point, normal: outwards, room }) => ({
      point, outwards, room,
      vector: "pressure" in row ? outwards.map((x) => -x * valueAt(row.pressure, point))
        : inSpace(row.traction.map((one) => valueAt(one, point))),
    }));
    const largest = Math.max(...some.map(({ vector }) => norm(vector)), 0);
    const room = Math.min(...some.map((one) => one.room ?? Infinity)); // the arrows of one load can be compared
    const longest = Math.min(length, FREE_SHARE * room);
    for (const { point, outwards, vector } of some) {
      const share = largest ? norm(vector) / largest : 0;
      if (share < 0.05) continue;
      const pushes = outwards.reduce((sum, x, k) => sum + x * vector[k], 0) < 0;
      found.push(...arrowLines(point, unit(vector).map((x) => x * longest * share), pushes));
    }
  }
  for (const key of ["force", "bearing_force"]) {
    if (Array.isArray(row[key])) found.push(...whole(row[key]));
  }
  if ("moment" in row) {
    const axis = Array.isArray(row.moment) ? inSpace(row.moment) : [0, 0, row.moment];
    if (norm(axis)) found.push(...turnLines(row.point ? inSpace(row.point) : middle, axis, 0.7 * length));
  }
  return found;
}

/** Ticks of a support, along each direction that it holds. */
function supportLines(row, faces, marked) {
  const half = TICK_LENGTH * marked.size;
  const letters = typeof row.components === "string" ? row.components : "xyz";
  return marked.places(faces).flatMap(({ point, normal }) => {
    const axes = letters === "normal" ? [normal]
      : [..."xyz"].map((letter, k) => (letters.includes(letter) && (k < 2 || !marked.plane) ? [0, 1, 2].map((i) => Number(i === k)) : null));
    return axes.filter(Boolean).flatMap((axis) => [...plus(point, axis, -half), ...plus(point, axis, half)]);
  });
}

/** Lines of a whole case by kind, and how many entries of each kind are shown. */
function marksOfCase(value, drawn, marked) {
  const lines = { load: [], support: [], contact: [], tie: [] };
  const counts = { load: 0, support: 0, contact: 0, tie: 0 };
  const surfaces = drawn.surfacesOf(value);
  const rows = (name) => (Array.isArray(value[name]) ? value[name] : []);
  const add = (kind, found) => {
    if (!found.length) return;
    counts[kind]++;
    lines[kind].push(...found);
  };
  rows("load").forEach((row) => add("load", loadLines(row, surfaces[row.on]?.faces ?? [], marked)));
  rows("support").forEach((row) => add("support", supportLines(row, surfaces[row.on]?.faces ?? [], marked)));
  const { acceleration, density } = value.gravity ?? {};
  if (Array.isArray(acceleration) && acceleration.every(Number.isFinite) && norm(acceleration)) {
    for (const body of Object.keys(density ?? {})) {
      const at = drawn.bodies.indexOf(body);
      const vector = unit(inSpace(acceleration)).map((x) => 1.6 * ARROW * marked.size * x);
      if (at >= 0) add("load", arrowLines(marked.middleOf(at), vector, false));
    }
  }
  drawn.joints.forEach(({ surfaces: sides, glued }, seam) => {
    const said = (kind) => rows(kind).some((row) => sides.includes(row.primary) || sides.includes(row.secondary));
    const kind = said("tie") || (glued && !said("contact")) ? "tie" : said("contact") ? "contact" : null;
    if (!kind) return;
    const found = [];
    marked.outlines.seam.forEach((number, k) => {
      if (number === seam) found.push(...marked.outlines.ends.subarray(6 * k, 6 * k + 6));
    });
    add(kind, found);
  });
  const kinds = Object.entries(lines).filter(([, ends]) => ends.length);
  return { counts, kinds: kinds.map(([kind, ends]) => ({ colour: MARK_COLOURS[kind], ends: Float32Array.from(ends) })) };
}
