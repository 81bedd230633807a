// The faults of a case in words, from its JSON Schema and from the names in the drawing.

/** Return a schema with its conditions and allOf resolved for a value. */
function resolved(schema, value) {
  let found = { ...schema, properties: { ...schema.properties } };
  const join = (part) => {
    const other = resolved(part, value);
    const mine = found.properties;
    // A key that selects the alternative, such as law, keeps all of its choices.
    const theirs = Object.entries(other.properties).filter(([key, one]) => !("const" in one && mine[key]?.enum));
    found = {
      ...found, ...other,
      properties: { ...mine, ...Object.fromEntries(theirs) },
      required: [...(found.required ?? []), ...(other.required ?? [])],
    };
  };
  delete found.allOf;
  (schema.allOf ?? []).forEach(join);
  if (schema.if) join(faultsBySchema(value, schema.if, []).length ? schema.else ?? {} : schema.then ?? {});
  return found;
}

/** The schema of a table of the case. */
function schemaAt(schema, path, value) {
  for (const name of path) {
    const part = resolved(schema, {}).properties[name] ?? schema.additionalProperties ?? {};
    schema = part.items ?? part;
  }
  return resolved(schema, value);
}

/** The schema of a key of a table; undefined if the table does not have the key. */
const keySchema = (schema, key) => schema.properties[key]
  ?? (typeof schema.additionalProperties === "object" ? schema.additionalProperties : undefined);

const typeOf = (value) =>
  Array.isArray(value) ? "array" : typeof value === "number" ? "number" : typeof value;

const TYPE_WORDS = {
  number: "a number", integer: "a whole number", string: "a text", boolean: "true or false",
  array: "a list", object: "a table",
};

/** The simple types of value that a schema accepts. */
function kindsOf(schema) {
  if (schema.anyOf) return schema.anyOf.flatMap(kindsOf);
  if (schema.enum || "const" in schema) return ["enum"];
  return [schema.type];
}

const choicesOf = (schema) => schema.enum ?? ("const" in schema ? [schema.const] : null)
  ?? (schema.anyOf ?? []).flatMap((one) => choicesOf(one) ?? []);

/** The values that a schema accepts, in words. */
function expected(schema) {
  if (["number", "string"].every((kind) => kindsOf(schema).includes(kind))) return "a number or a formula";
  if (schema.anyOf) return [...new Set(schema.anyOf.map(expected))].join(" or ");
  const choices = choicesOf(schema);
  if (choices?.length) return choices.map((one) => `"${one}"`).join(" or ");
  if (schema.type === "array" && schema.items) {
    const kinds = kindsOf(schema.items);
    const things = kinds.includes("number") ? "numbers" : kinds.includes("string") ? "texts" : "lists";
    return kinds.includes("number") && kinds.includes("string") ? "a list of numbers or formulas" : `a list of ${things}`;
  }
  return TYPE_WORDS[schema.type] ?? "another value";
}

/** Return the most similar one of some names if it is similar enough. */
function nearest(name, names) {
  const distance = (a, b) => {
    let row = [...b].map((_, k) => k + 1);
    [...a].forEach((letter, i) => {
      let corner = i;
      let left = i + 1;
      row = row.map((above, k) => {
        const now = Math.min(left + 1, above + 1, corner + (letter === b[k] ? 0 : 1));
        corner = above;
        left = now;
        return now;
      });
    });
    return row.at(-1) ?? a.length;
  };
  const best = names.map((one) => [distance(name, one), one]).sort(([a], [b]) => a - b)[0];
  return best && best[0] <= Math.max(2, name.length / 3) ? best[1] : null;
}

/** Faults of a value according to a JSON Schema: the path and words of each. */
function faultsBySchema(value, schema, path) {
  const fault = (words, at = path) => ({ path: at, words });
  const found = [];
  const choices = schema.enum ?? ("const" in schema ? [schema.const] : null);
  if (choices && !choices.includes(value)) {
    const near = typeof value === "string" ? nearest(value, choices.map(String)) : null;
    found.push(fault(`${toToml(value)} is not known; choose ${near ? `"${near}", or ` : ""}${expected(schema)}`));
  }
  const type = typeOf(value);
  const fits = schema.type === "integer" ? Number.isInteger(value) : schema.type === type;
  if (schema.type && !fits) return [fault(`${toToml(value)} is not ${expected(schema)}`)];
  if (schema.anyOf?.some((one) => one.type || one.enum || one.anyOf)) {
    if (!schema.anyOf.some((one) => !faultsBySchema(value, one, path).length)) {
      found.push(fault(`${toToml(value)} is not ${expected(schema)}`));
    }
  }
  const alternatives = [["anyOf", 1, Infinity], ["oneOf", 1, 1]];
  for (const [key, least, most] of alternatives) {
    const names = (schema[key] ?? []).flatMap((one) => one.required ?? []);
    if (!names.length) continue;
    const given = names.filter((name) => Object.hasOwn(value, name));
    const heads = names.map((name) => `[${name}]`).join(" or ");
    if (given.length < least) found.push(fault(`${heads} is missing`));
    if (given.length > most) found.push(fault(`${heads}: give only one of them`));
  }
  if (type === "array" && schema.items) {
    value.forEach((one, k) => found.push(...faultsBySchema(one, schema.items, [...path, k])));
  }
  if (type !== "object") return found;
  const shape = resolved(schema, value);
  for (const name of new Set(shape.required ?? [])) {
    if (!Object.hasOwn(value, name)) {
      const part = shape.properties[name];
      const words = part ? `is missing; give ${expected(part)}` : "is missing";
      found.push(fault(words, [...path, name]));
    }
  }
  for (const [name, one] of Object.entries(value)) {
    const part = keySchema(shape, name);
    if (part) {
      found.push(...faultsBySchema(one, part, [...path, name]));
    } else if (shape.additionalProperties === false) {
      const near = nearest(name, Object.keys(shape.properties));
      const remedy = near ? `; the nearest key is '${near}'` : "; remove it";
      found.push(fault(`is not a key here${remedy}`, [...path, name]));
    }
  }
  return found;
}

const positive = (value) => (value > 0 ? "" : "is not positive");
const atLeast0 = (value) => (value >= 0 ? "" : "is negative");
const share = (value) => (value > 0 && value < 1 ? "" : "is not between 0 and 1");
const angle = (value) => (value >= 0 && value < 90 ? "" : "is not an angle from 0° to below 90°");

const between = (low, high) => (value) => (value >= low && value <= high ? "" : `is not between ${low} and ${high}`);
const count = (value) => (Number.isInteger(value) && value > 0 ? "" : "is not a whole number from 1 on");

/** Ranges of numbers by their keys, where a key has one meaning in all tables. */
const RANGES = {
  young: positive, yield_stress: positive, size: positive, sizes: positive, thickness: positive, design: positive,
  radius: positive, coulomb: atLeast0, tresca: atLeast0, cohesion: atLeast0, tensile_strength: positive,
  compressive_strength: positive,
  friction_angle: angle, dilatancy_angle: angle, limit_tolerance: share, tolerance: share,
  cells: count, max_iterations: count, steps: count, density: atLeast0, strength: positive,
  curvature: between(0, 360), close_gaps: atLeast0, patience: positive, isotropic: atLeast0, kinematic: atLeast0,
  r11: positive, r22: positive, r33: positive, r12: positive, r13: positive, r23: positive,
  poisson: (value) => (value > -1 && value < 0.5 ? "" : "is not between −1 and 0.5"),
};

/** Tables of numbers with one range for all of them. */
const OF_NUMBERS = ["density", "sizes", "strength"];

/** Return what is wrong with the range of a key's value, or "". */
function outOfRange(key, value) {
  const some = (typeof value === "object" ? Object.values(value) : [value]).flat().filter((one) => typeof one === "number");
  if (some.some(Number.isNaN)) return "nan is not a number";
  if (some.some((one) => !Number.isFinite(one))) return `${toToml(value)} is not finite`;
  const far = some.find((one) => one && !(Math.abs(one) >= 1e-30 && Math.abs(one) <= 1e30));
  if (far !== undefined) return `${far} is too ${Math.abs(far) > 1 ? "large" : "small"} to compute with`;
  const test = RANGES[key];
  const bad = test && some.find((one) => test(one));
  return bad === undefined || !test ? "" : `${bad} ${test(bad)}`;
}

const LOAD_KINDS = [
  "pressure", "traction", "force", "moment", "bearing_force", "body_force", "pore_pressure",
];
const IN_BODIES = ["body_force", "pore_pressure"];
const FORMULA_WORDS = new Set(
  ("x y z pi e E abs arccos arccosh arcsin arcsinh arctan arctan2 arctanh ceil cos cosh exp expm1 floor fmod"
  + " log log10 log1p maximum minimum sin sinh sqrt tan tanh where").split(" "),
);

/** Return what is wrong with a formula in the coordinates, or "". */
function formulaFault(text, unit) {
  const word = text.match(/[A-Za-z_]\w*/g)?.find((one) => !FORMULA_WORDS.has(one));
  const alone = /^[+-]?[\d.]+(?:[eE][+-]?\d+)?\s*([A-Za-z°%].*)$/.exec(text);
  if (word && alone) return `'${text}' has a unit; give the number alone${unit ? `, in ${unit}` : ""}`;
  if (/^[+-]?\d+,\d+$/.test(text)) return `'${text}' has a comma; write ${text.replace(",", ".")}`;
  if (word) {
    return `'${word}' is not known in a formula; use numbers, x, y, z and functions such as maximum(x, 0)`;
  }
  if (text.includes("^")) return "'^' is not known in a formula; write ** for powers";
  if (/[^\w\s.+\-*/%<>=&|(),]/.test(text)) return `'${text}' is neither a number nor a formula`;
  if (text.split("(").length !== text.split(")").length) return "a bracket is missing";
  return /[\d\w)]/.test(text) ? "" : `'${text}' is neither a number nor a formula`;
}

/** The names in the drawing that a case can use. */
class Drawn {
  constructor(setup) {
    Object.assign(this, setup);
    const { face, ...geometry } = parseToml(this.case).value.geometry ?? {};
    this.geometry = JSON.stringify(geometry);
    const faces = this.faces.map((face) => [face.name, { bodies: [face.body], faces: [face.number] }]);
    const ofNumber = Object.fromEntries(this.faces.map((face) => [face.number, face.body]));
    const sets = this.sets.map((one) =>
      [one.name, { bodies: one.faces.map((number) => ofNumber[number]), faces: one.faces }]);
    const joints = this.joints.flatMap(({ surfaces, bodies }) =>
      surfaces.map((name, k) => [name, { bodies: [bodies[k]], faces: [] }]));
    this.surfaces = Object.fromEntries([...faces, ...sets, ...joints]);
  }

  /** Surfaces, including those that the case itself names. */
  surfacesOf(value) {
    const found = { ...this.surfaces };
    for (const axis of Object.keys(value.geometry?.symmetry ?? {})) found[`symmetry_${axis}`] = { bodies: [], faces: [] };
    for (const one of value.geometry?.face ?? []) {
      const known = (one.faces ?? []).map((name) => found[name]).filter(Boolean);
      found[one.name] = {
        bodies: known.flatMap((part) => part.bodies), faces: known.flatMap((part) => part.faces),
        unknown: !one.faces,
      };
    }
    return found;
  }
}

const tableWords = (path, number) => {
  const name = path.filter((part) => typeof part === "string").join(".");
  return number === null || number === undefined ? `[${name}]` : `[[${name}]] ${number + 1}`;
};

/**
 * Faults of a whole case: `path`, `words`, `loose` for mere warnings, the name of a remedy, and
 * `of` for the names that the remedy acts on.
 */
function faultsOfCase(value, schema, drawn) {
  const found = faultsBySchema(value, schema, []);
  const add = (path, words, loose = false, remedy = null, of = null) => found.push({ path, words, loose, remedy, of });
  const surfaces = drawn.surfacesOf(value);
  const rows = (name) => (Array.isArray(value[name]) ? value[name] : []);
  const unknown = (name, names, path) => {
    if (typeof name !== "string" || names.includes(name)) return;
    const near = nearest(name, names);
    add(path, `'${name}' is not a name of the drawing${near ? `; the nearest is '${near}'` : ""}`);
  };
  const ranges = (table, path) => Object.entries(table).forEach(([key, one]) => {
    const inside = typeof one === "object" && !Array.isArray(one) && !OF_NUMBERS.includes(key);
    if (inside) ranges(one, [...path, key]);
    const words = inside ? "" : outOfRange(key, one);
    // A first case contains 0 or nan in place of numbers that the user must give.
    const toGive = path[0] === "material" && (Number.isNaN(one) || (key === "young" && one === 0));
    if (words) add([...path, key], toGive ? `${words}; give it, or choose a material from the library` : words);
  });
  for (const [name, one] of Object.entries(value)) {
    if (Array.isArray(one)) one.forEach((row, k) => ranges(row, [name, k]));
    else if (typeof one === "object") ranges(one, [name]);
  }
  for (const kind of ["support", "obstacle", "rigid_surface"]) {
    rows(kind).forEach((row, k) => unknown(row.on, Object.keys(surfaces), [kind, k, "on"]));
  }
  for (const kind of ["temperature", "initial_stress", "bolt"]) {
    rows(kind).forEach((row, k) => unknown(row.on, drawn.bodies, [kind, k, "on"]));
  }
  rows("support").forEach(({ components }, k) => {
    if (typeof components !== "string" || components === "normal") return;
    const axes = ["x", "y", "z"].slice(0, drawn.dim);
    if (![...components].every((letter, at) => axes.includes(letter) && components.indexOf(letter) === at)) {
      add(["support", k, "components"], `'${components}' must contain only the letters ${axes.join(", ")}, each at most once; write for instance "x", or "normal"`);
    }
  });
  rows("load").forEach((row, k) => loadFaults(row, k, drawn, add, (names) =>
    unknown(row.on, names, ["load", k, "on"]), Object.keys(surfaces)));
  for (const kind of ["contact", "tie"]) {
    rows(kind).forEach((row, k) => {
      for (const side of ["primary", "secondary"]) unknown(row[side], Object.keys(surfaces), [kind, k, side]);
      if (row.primary && row.primary === row.secondary) add([kind, k, "secondary"], `'${row.secondary}' is the primary surface as well`);
    });
  }
  const { acceleration } = value.gravity ?? {};
  if (Array.isArray(acceleration) && acceleration.length !== drawn.dim) {
    add(["gravity", "acceleration"], countWords(acceleration, drawn.dim));
  }
  weightFaults(value, drawn, add);
  Object.keys(value.gravity?.density ?? {}).forEach((body) => unknown(body, drawn.bodies, ["gravity", "density"]));
  Object.keys(value.geometry?.sizes ?? {}).forEach((body) => unknown(body, drawn.bodies, ["geometry", "sizes"]));
  const until = value.mesh?.adapt?.until;
  if (typeof until === "number" && share(until)) add(["mesh", "adapt"], `until = ${until} ${share(until)}`);
  for (const [body, { friction_angle: friction, dilatancy_angle: dilatancy }] of Object.entries(value.material ?? {})) {
    if (dilatancy > friction) add(["material", body, "dilatancy_angle"], `${dilatancy} is larger than friction_angle = ${friction}`);
  }
  combinationFaults(value, rows, add);
  const materials = Object.keys(value.material ?? {});
  materials.forEach((body) => unknown(body, drawn.bodies, ["material", body]));
  const bare = drawn.bodies.filter((body) => !materials.includes(body) && !value.geometry?.without?.includes(body));
  bare.forEach((body) => add(["material", body], `the material of '${body}' is missing`, false, "material", [body]));
  if (drawn.dim === 2 && !value.model?.kind) {
    add(["model"], "the kind of the plane model is missing, so the bodies are in plane strain: long, without strain along their length", true, "kind");
  }
  if (value.model?.thickness !== undefined && value.model.kind !== "plane-stress") {
    add(["model", "thickness"], "applies only to plane stress; remove it, or choose plane-stress");
  }
  loadingFaults(value, rows, add);
  holdFaults(value, rows, surfaces, drawn, add);
  refusedFaults(value, rows, drawn, add);
  return found;
}

/** The rows of contacts that `perfplast mesh` has found to be refused. */
const refusedRows = (rows, { pairs }) => rows.filter(({ primary, secondary }) =>
  pairs.some((sides) => sides.includes(primary) && sides.includes(secondary)));

/** The rows of contacts between a bolt and its nut, according to the names of the bodies. */
const boltedRows = (rows, joints) => rows.filter(({ primary, secondary }) =>
  joints.some(({ surfaces, bolted }) => bolted && surfaces.includes(primary) && surfaces.includes(secondary)));

/** Contacts that a run refuses, as `perfplast mesh` has found on the mesh of the first case. */
function refusedFaults(value, rows, { refused, geometry }, add) {
  if (!refused) return;
  const left = refusedRows(rows("contact"), refused).length;
  const { face, ...now } = value.geometry ?? {};
  if (left === refused.pairs.length && JSON.stringify(now) === geometry) {
    add(["contact"], refused.why, false, "tie");
  } else if (left) {
    add(["contact"], "nodes had too many contact conditions in the first case, which has changed; perfplast check tests them again", true);
  }
}

const countWords = (given, wanted) =>
  `has ${given.length} number${given.length === 1 ? "" : "s"}; give ${wanted}, one for each direction`;

/** The names of loads, as combinations and stages use them. */
const loadNames = (value) => [
  ...(Array.isArray(value.load) ? value.load : []).map((row) => row.name || row.on),
  ...(value.gravity ? [value.gravity.name ?? "gravity"] : []),
  ...(value.water || value.seepage ? ["water"] : []), ...(value.earthquake ? ["earthquake"] : []),
].filter(Boolean);

/** Warnings of weights that no material has, which come from numbers in other units. */
function weightFaults({ gravity, units }, { systems, weights, dim }, add) {
  const { newtons, density: unit, length } = systems[units?.system] ?? {};
  const { acceleration, density } = gravity ?? {};
  if (!newtons || acceleration?.length !== dim || typeof density !== "object") return;
  for (const [body, one] of Object.entries(density)) {
    const weight = one * Math.hypot(...acceleration) * newtons;
    if (!(weight > 0) || (weight >= weights[0] && weight <= weights[1])) continue;
    add(["gravity", "density"], `'${body}' weighs ${Number((weight / 1e3).toPrecision(3))} kN/m³, and steel weighs 77 kN/m³; give densities in ${unit}, and accelerations in ${length}/s²`, true);
  }
}

/** Faults of combinations that the schema does not find. */
function combinationFaults(value, rows, add) {
  const names = loadNames(value);
  rows("combination").forEach(({ name, factors }, k) => {
    if (rows("combination").findIndex((one) => one.name === name) < k) add(["combination", k, "name"], `'${name}' is the name of another combination, too`);
    if (typeof factors !== "object" || Array.isArray(factors)) return;
    for (const load of Object.keys(factors)) {
      if (names.includes(load)) continue;
      const near = nearest(load, names);
      add(["combination", k, "factors"], `'${load}' is not a load${near ? `; the nearest is '${near}'` : names.length ? `; loads are ${names.join(", ")}` : ""}`);
    }
    if (!Object.values(factors).some((one) => one > 0)) add(["combination", k, "factors"], "has no factor above 0");
  });
}

/** Faults of a load that the schema does not find. */
function loadFaults(row, k, drawn, add, unknown, surfaces) {
  const kinds = LOAD_KINDS.filter((kind) => kind in row);
  const inBody = kinds.some((kind) => IN_BODIES.includes(kind));
  unknown(inBody ? drawn.bodies : surfaces);
  const together = kinds.length === 2 && kinds.includes("force") && kinds.includes("moment");
  if (kinds.length === 0) add(["load", k, "on"], `this load has no value; give one of ${LOAD_KINDS.join(", ")}`);
  if (kinds.length > 1 && !together) add(["load", k, kinds[1]], `this load has ${kinds.join(" and ")}; give each of them in a separate [[load]] table`);
  for (const kind of kinds) {
    const given = row[kind];
    const wanted = kind === "moment" && drawn.dim === 2 ? 1 : drawn.dim;
    if (Array.isArray(given) && given.length !== wanted) add(["load", k, kind], countWords(given, wanted));
    [given].flat().filter((one) => typeof one === "string").forEach((one) => {
      const words = formulaFault(one, "");
      if (words) add(["load", k, kind], words);
    });
    const { point } = row;
    if (Array.isArray(point) && point.length !== drawn.dim) add(["load", k, "point"], countWords(point, drawn.dim));
    if ([given].flat().every((one) => one === 0)) add(["load", k, kind], "is zero; give another value, or remove the load");
  }
}

/** The paths of loads and gravity that grow with the load factor. */
const growingLoads = ({ load, gravity }) => [
  ...(Array.isArray(load) ? load : []).flatMap((row, k) => (row.constant ?? "pore_pressure" in row ? [] : [["load", k]])),
  ...(gravity?.constant === false ? [["gravity"]] : []),
];

/** Faults of the question in [loading]. */
function loadingFaults(value, rows, add) {
  const { control = "load", values, until } = value.loading ?? {};
  const growing = growingLoads(value);
  if (!value.loading) return;
  if (control === "strength") {
    growing.forEach((path) => add([...path, "constant"], "the factor of safety needs constant loads; set constant = true", false, "constant"));
    if (!rows("load").length && !value.gravity) add(["load"], "no load acts; add a load or gravity", false, "load");
  } else if (control !== "displacement" && !growing.length) {
    const constant = rows("load").some((row) => row.constant === true) || value.gravity?.constant === true;
    add(["load"], `no load grows with the load factor; add a load${constant ? ", or let constant loads grow" : ""}`, false, constant ? "grow" : "load");
  }
  if (["work", "displacement"].includes(control) && !values && !until) add(["loading", "values"], "is missing; give values, or until");
  if (Array.isArray(values)) {
    if (!values.length) add(["loading", "values"], "is empty; give at least one number");
    if (values.some((one, k) => k && !(one > values[k - 1])) && (control === "load" || control === "work") && growing.length === rows("load").length && !value.gravity) {
      add(["loading", "values"], "do not increase");
    }
  }
  if (value.mesh?.adapt && !["bounds", "strength"].includes(control)) {
    add(["mesh", "adapt"], "applies only to bounds and to the factor of safety; remove it");
  }
}

/** Bodies that nothing holds, and touching surfaces that the case does not mention. */
function holdFaults(value, rows, surfaces, drawn, add) {
  const said = [...rows("contact"), ...rows("tie")].flatMap((row) => [row.primary, row.secondary]);
  for (const { surfaces: [one, other], glued } of drawn.joints) {
    if (glued || said.includes(one) || said.includes(other)) continue;
    add(["contact"], `'${one}' and '${other}' touch, and the case has neither contact nor tie for them`, true, "contact", [one, other]);
  }
  const supports = rows("support");
  if (!supports.length && !rows("obstacle").length) {
    add(["support"], "nothing holds the bodies; choose a face and add a support", false, "support");
    return;
  }
  if (supports.some((row) => !surfaces[row.on]?.bodies.length) || rows("obstacle").length) return;
  const held = new Set(supports.flatMap((row) => surfaces[row.on].bodies));
  const bodiesOf = (kind) => rows(kind).map((row) => [row.primary, row.secondary].flatMap((name) => surfaces[name]?.bodies ?? []));
  const spread = (pairs) => {
    for (let before = -1; before !== held.size;) {
      before = held.size;
      pairs.filter((bodies) => bodies.some((body) => held.has(body))).flat().forEach((body) => held.add(body));
    }
  };
  const present = drawn.bodies.filter((body) => !value.geometry?.without?.includes(body));
  const glued = drawn.joints.filter((joint) => joint.glued && !joint.surfaces.some((name) => said.includes(name))).map((joint) => joint.bodies);
  spread([...bodiesOf("tie"), ...glued]);
  const free = present.filter((body) => !held.has(body));
  spread([...bodiesOf("contact"), ...bodiesOf("tie"), ...glued]);
  present.filter((body) => !held.has(body))
    .forEach((body) => add(["support"], `nothing holds '${body}': no support, contact or tie`, false, "support"));
  const alone = free.filter((body) => held.has(body));
  if (!alone.length) return;
  const pressed = alone.map((body) => `'${body}'`);
  const some = pressed.length > 4 ? `${pressed.slice(0, 3).join(", ")} and ${pressed.length - 3} more bodies` : pressed.join(", ");
  const touching = bodiesOf("contact");
  const theirs = rows("contact").filter((_, k) => touching[k].some((body) => alone.includes(body)));
  const bolted = boltedRows(theirs, drawn.joints).length > 0;
  const words = `contact alone holds ${some}, and it stops each motion in one direction only; perfplast check names the rigid motions that are left. Unless loads press the surfaces together, glue ${bolted ? "bolts to their nuts, or another joint" : "a joint"} ([[tie]] instead of [[contact]]), or add a support`;
  add(["support"], words, true, bolted ? "bolts" : "joint", bolted ? null : [theirs[0].primary, theirs[0].secondary]);
}

/** A field's text as TOML, or the words of what is wrong: `{ toml }` or `{ words }`. */
function fromField(key, schema, text, unit = "") {
  const typed = text.trim();
  const kinds = kindsOf(schema);
  const wrong = (words) => ({ words });
  if (!typed) return wrong(`is missing; give ${expected(schema)}`);
  let toml = typed;
  const numeric = kinds.includes("number") || kinds.includes("integer");
  if (numeric && Math.abs(Number(typed)) === Infinity) return wrong(`${typed} is not finite`);
  const structured = kinds.includes("object") && !numeric && !kinds.includes("string");
  if (/^[[{]/.test(typed) || structured || kinds.includes("boolean")) {
    try {
      parseValue(typed);
    } catch (error) {
      return wrong(error.message);
    }
  } else if (numeric && Number.isFinite(Number(typed)) && /^[\d.eE+-]+$/.test(typed)) {
    toml = typed.replace(/^([+-]?)\./, "$10.").replace(/\.(?=$|[eE])/, ".0").replace(/^\+/, "").replace(/^(-?)0+(?=\d)/, "$1");
  } else if (kinds.includes("array") && !kinds.includes("string")) {
    if (/\d,\d/.test(typed)) return wrong(`'${typed}' may be one number or several; write 1.5, or 1, 5 with a space`);
    const parts = typed.split(/[,;]/).map((part) => fromField(key, schema.items ?? {}, part, unit));
    const bad = parts.find((part) => part.words);
    if (bad) return bad;
    toml = `[${parts.map((part) => part.toml).join(", ")}]`;
  } else if (kinds.includes("string") || kinds.includes("enum")) {
    const words = numeric && !choicesOf(schema).includes(typed) ? formulaFault(typed, unit) : "";
    if (words) return wrong(words);
    toml = quoted(typed);
  } else {
    const words = /^[+-]?[\d.,]+/.test(typed) ? formulaFault(typed, unit) : "";
    const several = /\d\s+[-\d]/.test(typed) ? "; write a comma between numbers" : "";
    return wrong(words || `'${typed}' is not ${expected(schema)}${several}`);
  }
  const value = parseValue(toml);
  const [fault] = faultsBySchema(value, schema, []);
  const words = fault?.words || outOfRange(key, value);
  return words ? wrong(words) : { toml };
}
