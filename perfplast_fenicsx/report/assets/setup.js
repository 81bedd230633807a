// The entries of a case: faces that are chosen, forms that add to the text, and cards that change it.

const { setup } = data;
const drawn = new Drawn(setup);
const chosen = new Set();
const history = [];
const wrongFields = new Map(); // by the id of a field: what was typed, and what is wrong with it
const pending = new Map(); // by the id of a card: a key that has no value yet
let caseText = "";
let parsed = null;
let shape = "";
let painter = null;
let marked = null; // the places of marks on faces

const AXES = ["x", "y", "z"].slice(0, setup.dim);
const made = (tag, properties = {}, ...inside) => {
  const element = Object.assign(document.createElement(tag), properties);
  element.append(...inside);
  return element;
};

/* ---- What a click has done, in words ---- */

const near = made("p", { id: "near", className: "near" });
let clicked = null; // the id of the form, card or list of the last click or change
let nearAt = null;
for (const kind of ["click", "change"]) {
  document.addEventListener(kind, ({ target }) => { clicked = target.closest?.("#cards fieldset, form, #left")?.id ?? null; }, true);
}

/** Say what has been done: in the status line, and where the click was. */
function done(words) {
  part("done").textContent = near.textContent = words;
  nearAt = clicked;
  putNear();
}

function putNear() {
  if (!nearAt || !near.textContent) return near.remove();
  const at = document.getElementById(nearAt);
  if (!at) part("cards").before(near); // a card that has been removed
  else if (at.matches("ul")) at.after(near);
  else at.append(near);
}

const system = () => parsed?.value.units?.system;
const units = () => setup.systems[system()] ?? {};

const modelKind = () => parsed?.value.model?.kind ?? "plane-strain";

/** What the units of fields depend on. */
const unitsOfFields = () => `${system()} ${modelKind()}`;

/** The unit of a key, by its description in the schema. */
function unitOf(schema) {
  const words = schema?.description ?? "";
  const [, kind, per] = /\((stress|length|force|moment)\b( per (?:volume|time))?[^)]*\)/.exec(words) ?? [];
  const { length, force } = units();
  if (length && words.includes("(length per s²)")) return `${length}/s²`;
  if (length && words.includes("(mass per volume)")) return units().density;
  if (!kind || !length) return /degrees/.test(words) ? "degrees" : "";
  const unit = kind === "moment" ? `${force} ${length}` : units()[kind];
  if (per) return per === " per volume" ? `${unit}/${length}³` : `${unit} per unit of time`;
  const deep = setup.dim === 2 && modelKind() === "plane-strain" && /per unit of depth/.test(words);
  return deep ? `${unit} per ${length} of depth` : unit;
}

/* ---- The text ---- */

/** Take another text; `rewrite` unless the text field has it already. */
function take(text, { rewrite = true, remember = true } = {}) {
  if (text === caseText) return;
  if (remember && caseText) history.push(caseText);
  caseText = text;
  if (rewrite) rewriteText(text);
  part("undo").disabled = !history.length;
  try {
    parsed = parseToml(text);
    parsed.fault = null;
  } catch (error) {
    if (!(error instanceof CaseFault)) throw error;
    parsed = { ...parsed, fault: error };
  }
  refreshSoon();
}

/** Show the text, and of it the first line that has changed. */
function rewriteText(text) {
  const field = part("text");
  const before = field.value;
  let same = 0;
  while (same < text.length && text[same] === before[same]) same++;
  field.value = text;
  const lines = text.split("\n").length;
  const line = before ? text.slice(0, same).split("\n").length : 0;
  field.scrollTop = (line / lines) * field.scrollHeight - 0.3 * field.clientHeight;
}

/** Refresh after the focus has moved to the next field. */
function refreshSoon() {
  part("cards").setAttribute("aria-busy", "true");
  setTimeout(refresh);
}

const editable = () => !parsed.fault;

/** Tables of a kind, in the order of the file. */
const tablesOf = (...path) => parsed.tables.filter((table) => table.path.join("\n") === path.join("\n"));

const idOf = (table) => `e-${[...table.path, table.number ?? ""].join("-").replace(/[^\w-]/g, "_")}`;

/** Remove the entries that the first case leaves to be filled in. */
function withoutPlaceholders(text) {
  for (;;) {
    const table = parseToml(text).tables.find((one) =>
      ["support", "load"].includes(one.path[0]) && one.value.on === "NAME");
    if (!table) return text;
    text = withoutTable(text, table);
  }
}

/** Take a case file from outside. */
function open(text, name) {
  let found = text.replaceAll("\r\n", "\n");
  try {
    found = withoutPlaceholders(found);
  } catch (error) {
    if (!(error instanceof CaseFault)) throw error;
  }
  wrongFields.clear();
  pending.clear();
  showQuestion();
  askedLast = formAsks();
  take(found);
  done(parsed.fault ? `${name} is not a case file; Undo restores the previous case.` : `${name} has been read.`);
}

/* ---- Faces that are chosen ---- */

function paintFaces() {
  const surfaces = parsed ? drawn.surfacesOf(parsed.value) : drawn.surfaces;
  const marks = new Map();
  const mark = (name, bit) => (surfaces[name]?.faces ?? []).forEach((face) =>
    marks.set(face, (marks.get(face) ?? 0) | bit));
  (parsed?.value.support ?? []).forEach?.((row) => mark(row.on, 1));
  (parsed?.value.load ?? []).forEach?.((row) => mark(row.on, 2));
  chosen.forEach((name) => mark(name, 4));
  painter?.markFaces(marks);
  drawMarks();
  document.querySelectorAll("tr[data-face] button").forEach((button) =>
    button.setAttribute("aria-pressed", String(chosen.has(button.textContent))));
  const names = [...chosen];
  part("chosen").textContent = names.length
    ? `Chosen: ${names.join(", ")}` : "Nothing is chosen. Click faces, or choose them by name.";
  part("clear").disabled = !names.length;
  offerWider();
  offerTogether();
}

/** The faces that are chosen by their own names. */
const chosenFaces = () => setup.faces.filter(({ name }) => chosen.has(name));

/** Offer names of several faces, of which a part is chosen, and more faces like the chosen ones. */
function offerWider() {
  const given = chosenFaces();
  const wider = setup.sets.filter(({ name, faces }) => !chosen.has(name) && given.some(({ number }) => faces.includes(number)));
  const named = wider.map(({ name, faces }) => [`Choose ${name}, ${faces.length} faces`, () => {
    setup.faces.filter((face) => faces.includes(face.number)).forEach((face) => chosen.delete(face.name));
    chosen.add(name);
  }]);
  const round = roundFamilies(setup.faces, given).filter(([, faces]) => faces.some(({ name }) => !chosen.has(name)))
    .map(([words, faces]) => [`Choose all ${faces.length} faces: ${words}`, () => faces.forEach(({ name }) => chosen.add(name))]);
  part("wider").replaceChildren(...[...named, ...round].map(([words, choose]) => {
    const button = made("button", { type: "button" }, words);
    button.addEventListener("click", () => {
      choose();
      part("add-fault").textContent = "";
      paintFaces();
      part("clear").focus(); // this button is gone
    });
    return button;
  }));
  part("growing").hidden = setup.dim === 2 || !given.length || !painter;
}

let angles = null; // between the faces, at their common edges

part("grow").addEventListener("click", () => {
  const most = Number(part("edge-angle").value.trim() || NaN);
  const fits = most > 0 && most < 180;
  part("edge-fault").textContent = fits ? "" : "The angle is not a number above 0 and below 180.";
  if (!fits) return;
  angles ??= anglesAtEdges(painter.mesh);
  const before = chosen.size;
  continued(setup.faces, chosenFaces(), angles, most).forEach(({ name }) => chosen.add(name));
  paintFaces();
  const more = chosen.size - before;
  part("told").textContent = more
    ? `${more} more ${more === 1 ? "face is" : "faces are"} chosen` : `No other face continues these over edges with angles of up to ${most}° in the mesh`;
});

/** Draw the marks of the case, and say in words what they show. */
function drawMarks() {
  if (!painter || !marked || !parsed) return;
  const { counts, kinds } = marksOfCase(parsed.value, drawn, marked);
  painter.drawing.setMarks(kinds);
  painter.redraw();
  const words = { load: "loads", support: "supports", contact: "contacts", tie: "ties" };
  const shown = Object.entries(counts).filter(([, count]) => count).map(([kind, count]) => `${count} ${count === 1 ? words[kind].slice(0, -1) : words[kind]}`);
  part("drawn").textContent = shown.length ? `In the picture: ${shown.join(", ")}.` : "No entry is in the picture yet.";
}

function toggle(name) {
  if (!chosen.delete(name)) chosen.add(name);
  part("add-fault").textContent = "";
  paintFaces();
}

function toggleFace(number) {
  const face = setup.faces.find((one) => one.number === number);
  if (!face) return;
  toggle(face.name);
  part("told").textContent = data.faces.words[number] + (chosen.has(face.name) ? "; chosen" : "; no longer chosen");
}

function offerNames() {
  const own = (parsed?.value.geometry?.face ?? []).map((one) => one.name).filter(Boolean);
  const group = (label, options) => options.length
    ? [made("optgroup", { label }, ...options.map(([text, value]) => new Option(text, value)))] : [];
  part("choose").replaceChildren(
    new Option("a name …", ""),
    ...group("All free faces of a body", setup.bodies.map((body) => [body, `body:${body}`])),
    ...group("Faces", setup.faces.map(({ name, round }) => [round ? `${name}: ${round}` : name, name])),
    ...group("Several faces by one name", [...setup.sets.map(({ name }) => name), ...own].map((name) => [name, name])),
    ...group("Surfaces that touch", setup.joints.flatMap(({ surfaces }) => surfaces).map((name) => [name, name])),
  );
}

part("choose").addEventListener("change", ({ target }) => {
  const { value } = target;
  if (value.startsWith("body:")) {
    setup.faces.filter((face) => face.body === value.slice(5)).forEach((face) => chosen.add(face.name));
  } else if (value) {
    chosen.add(value);
  }
  target.value = "";
  paintFaces();
});
part("clear").addEventListener("click", () => {
  chosen.clear();
  paintFaces();
});
document.querySelectorAll("tr[data-face]").forEach((row) =>
  row.addEventListener("click", () => toggleFace(Number(row.dataset.face))));

/* ---- Fields of forms ---- */

const schemaOf = (path, value = {}) => schemaAt(setup.schema, path, value);

/** A field of a form: label, input and the place of its fault. */
function formField({ id, label, key, schema, optional, choices, check, zero }) {
  const unit = unitOf(schema);
  const fault = made("p", { className: "fault", id: `${id}-fault` });
  const input = choices
    ? made("select", { id }, ...choices.map(([text, value]) => new Option(text, value)))
    : made("input", { id, type: check ? "checkbox" : "text", autocomplete: "off" });
  input.setAttribute("aria-describedby", fault.id);
  if (zero) input.placeholder = "0";
  const words = made("label", { htmlFor: id }, label + (unit ? ` (${unit})` : "") + (optional ? ", may be empty" : ""));
  const element = made("div", { className: check ? "check" : "" }, ...(check ? [input, " ", words] : [words, input]), fault);
  const read = () => {
    if (check) return { toml: input.checked ? "true" : "" };
    if (choices) return { toml: input.value };
    const empty = !input.value.trim();
    const found = empty && zero ? { toml: "0", empty } : empty && optional ? { toml: "" } : fromField(key, schema, input.value, unit);
    return say(found);
  };
  const say = (found) => {
    fault.textContent = found.words ? `${label}: ${found.words}.` : "";
    input.setAttribute("aria-invalid", String(Boolean(found.words)));
    return found;
  };
  // Words that come or go as a button is pressed would move it away from the pointer.
  input.addEventListener("input", () => input.getAttribute("aria-invalid") === "true" && read());
  return { element, read, say, input, zero };
}

/** Fields with a number for each direction; an empty one is 0. */
function vectorFields(key, schema, label) {
  const item = { ...(schema.items ?? schema), description: schema.description };
  const axes = schema.items || schema.anyOf ? AXES : [""];
  return axes.map((axis) => formField({
    id: `add-${key}-${axis}`, label: `${label} ${axis}`.trim(), key, schema: item, zero: axes.length > 1,
  }));
}

const NUMBER_SCHEMA = { type: "number" };

const LOADS = {
  pressure: "Pressure", traction: "Traction", force: "Force on the whole face",
  moment: "Moment on the whole face", bearing_force: "Force of a pin or shaft on its bore",
};
const OF_WHOLE_FACE = ["force", "moment", "bearing_force"];
const CONSTANT = [["grows with the load factor", ""], ["is constant", "true"]];

/** The entries that a form adds: its fields, and the tables of what they say. */
const KINDS = {
  support: {
    label: "Support",
    fields: () => [formField({ id: "add-components", label: "Holds", choices: [
      ["all directions", ""], ...AXES.map((axis) => [axis, quoted(axis)]),
      ...(setup.dim === 3 ? ["xy", "xz", "yz"].map((axes) => [axes.split("").join(" and "), quoted(axes)]) : []),
      ["normal to a flat face", quoted("normal")],
    ] })],
    tables: ([components]) => onChosen((name) => [["support"], true, { on: quoted(name), ...(components && { components }) }]),
    least: 1,
    refused: () => (isTogether() ? nameFault(part("one-name").value.trim()) : ""),
  },
  ...Object.fromEntries(Object.entries(LOADS).map(([key, label]) => [key, {
    label,
    fields: () => {
      const schema = schemaOf(["load"]).properties[key];
      const { description } = schema;
      const numbers = key === "pressure" || (key === "moment" && setup.dim === 2)
        ? [formField({ id: `add-${key}`, label, key, schema: key === "moment" ? { ...NUMBER_SCHEMA, description } : schema })]
        : vectorFields(key, key === "moment" ? { ...schema.anyOf[1], description } : schema, key.replace("_", " "));
      return [...numbers, formField({ id: "add-constant", label: "The load", choices: CONSTANT })];
    },
    tables: (given) => {
      const constant = given.at(-1);
      const numbers = given.slice(0, -1);
      const value = numbers.length === 1 ? numbers[0] : `[${numbers.join(", ")}]`;
      const load = (name) => [["load"], true, { on: quoted(name), [key]: value, ...(constant && { constant }) }];
      return onChosen(load);
    },
    least: 1,
    get most() { return OF_WHOLE_FACE.includes(key) && !canBeNamed() ? 1 : Infinity; },
    refused: () => (isTogether() ? nameFault(part("one-name").value.trim()) : ""),
  }])),
  gravity: {
    label: "Gravity",
    fields: () => {
      const { properties } = schemaOf(["gravity"]);
      const densities = setup.bodies.map((body) => formField({
        id: `add-density-${body}`, label: `Density of ${body}`, key: "density",
        schema: { ...properties.density.additionalProperties, description: properties.density.description },
        optional: setup.bodies.length > 1,
      }));
      return [...vectorFields("acceleration", properties.acceleration, "acceleration"), ...densities];
    },
    tables: (given) => {
      const density = setup.bodies.map((body, k) => [body, given[AXES.length + k]]).filter(([, one]) => one);
      const inside = density.map(([body, one]) => `${bare(body)} = ${one}`).join(", ");
      return [[["gravity"], false, {
        acceleration: `[${given.slice(0, AXES.length).join(", ")}]`, density: `{ ${inside} }`,
      }]];
    },
    least: 0,
    single: true,
    refused: (given) => (given.slice(AXES.length).some(Boolean) ? "" : "give the density of at least one body"),
  },
  combination: {
    label: "Combination of loads, with factors",
    fields: () => [
      formField({ id: "add-name", label: "Name", key: "name", schema: { type: "string" } }),
      ...loadNames(parsed.value).map((name, k) => formField({
        id: `add-factor-${k}`, label: `Factor of ${name}`, key: "factor", schema: NUMBER_SCHEMA, optional: true,
      })),
      formField({ id: "add-strength", label: "Partial factor of strengths", key: "strength", schema: NUMBER_SCHEMA, optional: true }),
    ],
    tables: (given) => {
      const factors = loadNames(parsed.value).map((name, k) => [name, given[k + 1]]).filter(([, one]) => one);
      const inside = factors.map(([name, one]) => `${bare(name)} = ${one}`).join(", ");
      const strength = given.at(-1);
      return [[["combination"], true, { name: given[0], factors: `{ ${inside} }`, ...(strength && { strength }) }]];
    },
    least: 0,
    refused: (given) => {
      if (!loadNames(parsed.value).length) return "add a load or gravity first";
      if (parsed.value.combination?.some((one) => quoted(one.name) === given[0])) return `${given[0]} is the name of another combination`;
      return given.slice(1, -1).some((one) => Number(one) > 0) ? "" : "give at least one load a factor above 0";
    },
  },
  contact: {
    label: "Contact of two surfaces",
    fields: () => [formField({
      id: "add-coulomb", label: "Coefficient of friction", key: "coulomb", optional: true,
      schema: schemaOf(["contact"]).properties.coulomb,
    })],
    tables: ([coulomb]) => [[["contact"], true, { ...pair(), ...(coulomb && { coulomb }) }]],
    least: 2, most: 2,
  },
  tie: { label: "Tie of two surfaces", fields: () => [], tables: () => [[["tie"], true, pair()]], least: 2, most: 2 },
  face: {
    label: "One name for the chosen faces",
    fields: () => [formField({ id: "add-name", label: "Name", key: "name", schema: { type: "string" } })],
    tables: ([name]) => [[["geometry", "face"], true, { name, faces: toToml([...chosen]) }]],
    least: 1,
    refused: ([name]) => (Object.hasOwn(drawn.surfacesOf(parsed.value), JSON.parse(name)) ? `${name} is a name already; give another one` : ""),
    after: ([name]) => {
      chosen.clear();
      chosen.add(JSON.parse(name));
    },
  },
  material: {
    label: "Material of a body, or of all bodies",
    fields: () => [
      formField({ id: "add-body", label: "Body", choices: [
        ...(setup.bodies.length > 1 ? [[`all ${setup.bodies.length} bodies`, ""]] : []), ...setup.bodies.map((body) => [body, body]),
      ] }),
      formField({ id: "add-material", label: "From the library", choices: library().map((one) => [`${one.name}: ${one.what}`, one.name]) }),
    ],
    refused: ([, name]) => (name ? "" : "name a system under [units] first: the library has no numbers for other units"),
    tables: ([body, name]) => (body ? [body] : presentBodies()).map((one) =>
      [["material", one], false, library().find((other) => other.name === name).keys]),
    least: 0,
    words: ([body, name]) => `${name} is the material of ${body || `all ${presentBodies().length} bodies`}`,
  },
};

if (setup.dim === 2) {
  KINDS.model = {
    label: "Kind of the plane model",
    fields: () => [
      formField({ id: "add-model-kind", label: "The drawing shows", choices: [
        ["a section of long bodies (plane strain)", "plane-strain"], ["thin sheets (plane stress)", "plane-stress"],
        ["half a section of bodies of revolution about y (axisymmetric)", "axisymmetric"],
      ] }),
      formField({ id: "add-thickness", label: "Thickness of sheets", key: "thickness", optional: true, schema: schemaOf(["model"]).properties.thickness }),
    ],
    refused: ([kind, thickness]) => (thickness && kind !== "plane-stress" ? "thickness applies only to thin sheets; empty the field" : ""),
    tables: ([kind, thickness]) => [[["model"], false, { kind: quoted(kind), ...(thickness && { thickness }) }]],
    least: 0,
    single: true,
    words: ([kind]) => `the model is ${kind}`,
  };
}

/* ---- Loads and supports on several faces ---- */

/** Whether one name can cover the chosen faces; surfaces that touch have no other name. */
const canBeNamed = () => ![...chosen].some((name) => setup.joints.some(({ surfaces }) => surfaces.includes(name)));

const isTogether = () => !part("together").hidden && part("one-load").value === "one";

const together = { load: "one", support: "each" }; // what the user has chosen; a new name means a new mesh

/** The tables of an entry on the chosen faces: one for a name of all of them, or one for each. */
function onChosen(table) {
  if (!isTogether()) return [...chosen].map(table);
  const name = part("one-name").value.trim();
  const face = [["geometry", "face"], true, { name: quoted(name), faces: toToml([...chosen]) }];
  return [...(name === nameOfChosen() ? [] : [face]), table(name)];
}

/** The name that the case has for just the chosen faces; undefined without one. */
const nameOfChosen = () => (parsed?.value.geometry?.face ?? []).find?.(({ faces }) =>
  Array.isArray(faces) && faces.length === chosen.size && faces.every((name) => chosen.has(name)))?.name;

/** What is wrong with a name for the chosen faces, in words; "" if nothing is. */
function nameFault(name) {
  if (name && (name === nameOfChosen() || !Object.hasOwn(drawn.surfacesOf(parsed.value), name))) return "";
  return name ? `'${name}' is a name already; give another one` : "Name of these faces: is missing; give a text.";
}

/** A name for the chosen faces: that of the case, or a free one. */
function offeredName() {
  const names = drawn.surfacesOf(parsed?.value ?? {});
  let number = 1;
  const word = part("kind").value === "support" ? "held" : "loaded";
  while (Object.hasOwn(names, `${word}_${number}`)) number++;
  return nameOfChosen() ?? `${word}_${number}`;
}

const whatOf = (kind) => (kind in LOADS ? "load" : kind);

/** Offer one load or support on all chosen faces, and say what the button adds. */
function offerTogether() {
  const kind = part("kind").value;
  const what = whatOf(kind);
  part("together").hidden = !(what in together && chosen.size > 1 && canBeNamed());
  if (what in together) {
    const [one, each] = part("one-load").options;
    one.textContent = `one ${what}, on all of them together`;
    each.textContent = `a ${what} on each of them`;
    part("one-load").value = together[what];
  }
  part("one-name").parentElement.hidden = !isTogether();
  if (part("one-name").dataset.typed === undefined) part("one-name").value = offeredName();
  part("adds").textContent = chosen.size < 2 || choiceFault(KINDS[kind]) ? "" : addedTo(chosen.size, kind);
}

/** What the button adds for several chosen faces, in words; "" if this is one entry. */
function addedTo(count, kind) {
  if (kind === "support") return isTogether() ? `Adds one support on ${count} faces.` : `Adds ${count} supports, one for each face.`;
  if (!(kind in LOADS)) return "";
  const whole = OF_WHOLE_FACE.includes(kind);
  const what = kind === "moment" ? "moment" : "force";
  if (isTogether()) return `Adds one load on ${count} faces${whole ? `: the ${what} is the total of all of them` : ""}.`;
  return `Adds ${count} loads, one for each face${whole ? `, each with the whole ${what}` : ""}.`;
}
part("one-load").addEventListener("change", ({ target }) => {
  together[whatOf(part("kind").value)] = target.value;
  offerTogether();
});
part("one-name").addEventListener("input", ({ target }) => { target.dataset.typed = ""; });

const pair = () => {
  const [primary, secondary] = [...chosen].map(quoted);
  return { primary, secondary };
};
const library = () => setup.library[system()] ?? [];

/** The bodies that the case does not leave out. */
const presentBodies = () => setup.bodies.filter((body) => !parsed.value.geometry?.without?.includes(body));

let fields = [];
function showKind() {
  part("add-fault").textContent = "";
  const kind = KINDS[part("kind").value];
  fields = kind.fields();
  part("wanted").replaceChildren(...fields.map((field) => field.element));
  offerTogether();
}
part("kind").append(...Object.entries(KINDS).map(([key, { label }]) => new Option(label, key)));
part("kind").addEventListener("change", showKind);

/** What the number of chosen faces is missing, in words. */
function choiceFault(kind) {
  const count = chosen.size;
  const most = kind.most ?? Infinity;
  if (kind.least && count < kind.least) return kind.least === 1 ? "Choose a face first." : `Choose ${kind.least} surfaces first; ${count} are chosen.`;
  if (kind.least && count > most) {
    return most === 1
      ? `${count} faces are chosen, and this acts on one. Give them one name first (the entry "${KINDS.face.label}").`
      : `${count} surfaces are chosen; choose ${most}.`;
  }
  return "";
}

/** Remove the words on an earlier entry. */
function forgetNear() {
  near.textContent = "";
  putNear();
}

part("adding").addEventListener("submit", (event) => {
  event.preventDefault();
  forgetNear();
  const kind = KINDS[part("kind").value];
  const say = (words) => { part("add-fault").textContent = words; };
  const given = fields.map((field) => field.read());
  const components = fields.filter(({ zero }) => zero);
  const empty = components.filter(({ input }) => !input.value.trim());
  if (components.length && empty.length === components.length) {
    given[0] = fields[0].say({ words: "all components are empty; give at least one number" });
  }
  const wrong = given.findIndex((one) => one.words);
  if (!editable()) return say("The text cannot be read; correct it first.");
  if (wrong >= 0) {
    fields[wrong].input.focus();
    return say(choiceFault(kind));
  }
  const values = given.map((one) => one.toml);
  const fault = choiceFault(kind) || kind.refused?.(values);
  if (fault) return say(fault);
  const tables = kind.tables(values);
  const [path] = tables[0];
  const there = tablesOf(...path)[0];
  if (kind.single && there) return say(`The case has [${path.join(".")}] already; change it among the entries.`);
  let text = caseText;
  tables.forEach(([where, list, entries]) => {
    const has = where[0] === "material" && tableIn(text, where.join("\n"));
    text = has ? withMaterial(text, where[1], entries) : withTable(text, where, list, entries);
  });
  say("");
  const key = components[0]?.input.id.split("-")[1];
  const understood = empty.length ? ` Empty components are 0: ${key} = ${tables.at(-1)[2][key]}.` : "";
  const words = kind.words?.(values) ?? `${tables.length > 1 && !isTogether() ? `${tables.length} entries, ` : ""}${kind.label.toLowerCase()}${kind.least ? ` on ${[...chosen].join(", ")}` : ""}${isTogether() ? `, together '${part("one-name").value.trim()}'` : ""}`;
  done(`Added: ${words}.${understood}`);
  delete part("one-name").dataset.typed;
  if (kind.least) { // the entry acts on the chosen faces
    chosen.clear();
    part("told").textContent = "Click a face to choose it.";
  }
  kind.after?.(values);
  take(text);
  showKind();
});

/** The text with the numbers of a material; keys that its law does not have are removed. */
function withMaterial(text, body, keys) {
  const table = () => tableIn(text, `material\n${body}`);
  const law = JSON.parse(keys.law);
  const { properties } = schemaOf(["material", body], { law });
  Object.keys(table().keys).filter((key) => !properties[key]).forEach((key) => { text = withoutKey(text, table(), key); });
  Object.entries(keys).forEach(([key, toml]) => { text = withKey(text, table(), key, toml); });
  return text;
}

/* ---- What is asked ---- */

const QUESTIONS = {
  bounds: { label: "Bounds on the load at which the bodies collapse", control: "bounds", keys: ["design"] },
  load: { label: "Levels: the state at given load factors", control: "load", keys: ["values"] },
  work: { label: "Limit load of this mesh alone (an estimate)", control: "work", keys: ["design"], fixed: { until: quoted("limit") } },
  strength: { label: "Factor of safety: the largest divisor of the strengths", control: "strength", keys: [] },
};
const KEY_LABELS = { design: "Load factor of the design load", values: "Load factors" };
let questionFields = [];

function showQuestion() {
  const { control, keys } = QUESTIONS[part("question").value];
  const { properties } = schemaOf(["loading"], { control });
  questionFields = keys.map((key) => formField({
    id: `ask-${key}`, label: KEY_LABELS[key], key, schema: properties[key], optional: key === "design",
  }));
  questionFields.forEach(({ input }, k) => { if (keys[k] === "values") input.placeholder = "1, 1.5, 2"; });
  part("question-fields").replaceChildren(...questionFields.map((field) => field.element));
  part("ask-fault").textContent = "";
  part("time").textContent = timeWords(control);
}

/** What is known of the run time before a mesh is solved, in words. */
function timeWords(control) {
  const [cells, most] = [setup.cells, setup.affordable].map((count) => count.toLocaleString("en").replaceAll(",", "\u202f"));
  const here = setup.cells > setup.affordable ? " This mesh takes longer." : "";
  const first = `Run time: the first mesh has ${cells} elements. Bounds on a mesh of up to ${most} elements take some minutes on one core.${here} `;
  return first + (REFINED.includes(control)
    ? "perfplast run prints the time of each mesh and what finer meshes take; Ctrl+C stops it and keeps its results."
    : `${control === "work" ? "The limit load of the mesh alone usually takes less. " : ""}Ctrl+C stops perfplast run and keeps its results.`);
}
part("question").append(...Object.entries(QUESTIONS).map(([key, { label }]) => new Option(label, key)));
part("question").addEventListener("change", () => {
  showQuestion();
  refreshSoon();
});
part("question-fields").addEventListener("input", refreshSoon);

let askedLast = ""; // the form, as its button or a file has left it

/** The question and its fields, as the form shows them. */
const formAsks = () => JSON.stringify([part("question").value, ...questionFields.map(({ input }) => input.value.trim())]);

/** Show the question of the case file, unless the user is changing the form. */
function followQuestion() {
  if (formAsks() !== askedLast) return;
  const control = parsed.value.loading?.control;
  const key = Object.keys(QUESTIONS).find((one) => QUESTIONS[one].control === control);
  if (!key || key === part("question").value) return;
  part("question").value = key;
  showQuestion();
  askedLast = formAsks();
}

part("asking").addEventListener("submit", (event) => {
  event.preventDefault();
  forgetNear();
  const { label, control, keys, fixed = {} } = QUESTIONS[part("question").value];
  const given = questionFields.map((field) => field.read());
  const wrong = given.findIndex((one) => one.words);
  if (wrong >= 0) return questionFields[wrong].input.focus();
  if (!editable()) return void (part("ask-fault").textContent = "The text cannot be read; correct it first.");
  if (parsed.value.stage) return void (part("ask-fault").textContent = "The case has [[stage]]; remove the stages in the text first.");
  const entries = { control: quoted(control), ...fixed };
  keys.forEach((key, k) => { if (given[k].toml) entries[key] = given[k].toml; });
  let text = tablesOf("loading").length ? caseText : withTable(caseText, ["loading"], false, {});
  const table = (name) => tableIn(text, name);
  const { properties } = schemaOf(["loading"], { control });
  const removed = Object.keys(table("loading").keys).filter((key) => !properties[key]);
  removed.forEach((key) => { text = withoutKey(text, table("loading"), key); });
  Object.entries(entries).forEach(([key, toml]) => { text = withKey(text, table("loading"), key, toml); });
  if (!REFINED.includes(control) && table("mesh")?.keys.adapt) {
    text = Object.keys(table("mesh").keys).length > 1
      ? withoutKey(text, table("mesh"), "adapt") : withoutTable(text, table("mesh"));
    removed.push("[mesh] adapt");
  }
  const refined = withRefinement(text);
  const added = refined === text ? "" : " Added, as in the first case: [mesh] adapt.";
  askedLast = formAsks();
  take(withTrueComments(refined));
  done(`Asked: ${label}.${removed.length ? ` Removed, since it does not go with this: ${removed.join(", ")}.` : ""}${added}`);
});

/** The table of a text by its path, and by its number if it is one of several; undefined without it. */
const tableIn = (text, name, number = null) =>
  parseToml(text).tables.find((one) => one.path.join("\n") === name && (number === null || one.number === number));

const REFINED = ["bounds", "strength"]; // controls that refine the mesh

/** The text, in which comments of [loading] go with the values that have changed, and those of the first case with its question. */
function withTrueComments(text) {
  const before = parsed.value.loading ?? {};
  const first = tableIn(setup.case, "loading");
  const own = commentsOf(setup.case, first);
  const { value } = tableIn(text, "loading");
  const turned = value.control !== before.control;
  const right = value.control === first?.value.control ? own : {};
  for (const [key, comment] of Object.entries(commentsOf(text, tableIn(text, "loading")))) {
    const changed = toToml(value[key]) !== toToml(before[key] ?? "");
    const ofFirst = !comment.trim() || comment.trim() === own[key]?.trim();
    if (changed || (turned && ofFirst)) text = withComment(text, tableIn(text, "loading"), key, right[key] ?? "\n");
  }
  const lines = /^(#[^\n]*\n)+/.exec(setup.case.slice(first?.end ?? setup.case.length))?.[0] ?? "";
  if (!turned || !lines) return text;
  const { end } = tableIn(text, "loading");
  const there = text.startsWith(lines, end);
  if (there && value.control !== first.value.control) return spliced(text, end, end + lines.length, "");
  return !there && value.control === first.value.control ? spliced(text, end, end, lines) : text;
}

/** The text with the refinement of the first case, if the question before had none and this one may have it. */
function withRefinement(text) {
  const [first, loading] = ["mesh", "loading"].map((name) => tableIn(setup.case, name));
  const mesh = tableIn(text, "mesh");
  if (REFINED.includes(parsed.value.loading?.control) || !REFINED.includes(tableIn(text, "loading").value.control)) return text;
  if (!first?.keys.adapt || mesh?.keys.adapt || "mesh" in tableIn(text, "").keys) return text;
  const toml = (table, key) => setup.case.slice(table.keys[key].start, table.keys[key].end);
  const now = tableIn(text, "loading");
  if (loading.keys.limit_tolerance && !now.keys.limit_tolerance) text = withKey(text, now, "limit_tolerance", toml(loading, "limit_tolerance"));
  if (mesh) return withKey(text, tableIn(text, "mesh"), "adapt", toml(first, "adapt"));
  text = withTable(text, ["mesh"], false, { adapt: toml(first, "adapt") });
  const { start, body } = tableIn(text, "mesh");
  return spliced(text, start, body, setup.case.slice(first.start, first.body));
}

/* ---- Cards ---- */

const cardWords = ({ path, number, value }) => {
  const kind = path.at(-1);
  const count = number === null ? "" : ` ${number + 1}`;
  if (path[0] === "material") return `Material of ${path[1]}`;
  if (kind === "support") return `Support${count}: ${value.on ?? "?"}, ${value.components ?? "all directions"}`;
  if (kind === "load") {
    const what = LOAD_KINDS.filter((key) => key in value).map((key) => `${key.replace("_", " ")} ${toToml(value[key])}`);
    return `Load${count}: ${what.join(", ") || "?"} on ${value.on ?? "?"}`;
  }
  if (kind === "contact" || kind === "tie") return `${kind === "tie" ? "Tie" : "Contact"}${count}: ${value.primary ?? "?"} and ${value.secondary ?? "?"}`;
  if (path.length === 0) return "Title";
  return tableWords(path, number);
};

/** Text of a value in a field. */
function fieldText(table, key) {
  const value = table.value[key];
  const place = table.keys[key];
  return typeof value === "string" ? value : place.dotted ? toToml(value) : caseText.slice(place.start, place.end);
}

const NAMING = ["on", "primary", "secondary"];

function cardField(table, key) {
  const id = `${idOf(table)}-${key}`;
  const schema = schemaOf(table.path, table.value);
  const keyed = keySchema(schema, key);
  const unit = unitOf(keyed);
  const choices = keyed && kindsOf(keyed).every((kind) => kind === "enum") ? choicesOf(keyed)
    : keyed?.type === "boolean" ? ["true", "false"] : null;
  const input = choices
    ? made("select", { id }, ...["", ...choices].map((one) => new Option(one, one)))
    : made("input", { id, type: "text", autocomplete: "off" });
  if (NAMING.includes(key)) input.setAttribute("list", "names");
  const fault = made("p", { className: "fault", id: `${id}-fault` });
  const about = made("small", { id: `${id}-about` }, keyed?.description ?? "");
  input.setAttribute("aria-describedby", `${fault.id} ${about.id}`);
  input.addEventListener("change", () => changeField(table.path, table.number, key, keyed, input));
  const remove = made("button", { type: "button" }, "Remove");
  remove.setAttribute("aria-label", `Remove ${key}`);
  remove.addEventListener("click", () => removeField(table.path, table.number, key));
  const kept = (schema.required ?? []).includes(key);
  const box = made("div", {}, input, ...(kept ? [] : [remove]));
  const element = made("div", { className: "field" },
    made("label", { htmlFor: id }, key + (unit ? ` (${unit})` : "")), box, fault, about);
  return element;
}

const findTable = (path, number) =>
  parsed.tables.find((one) => one.path.join("\n") === path.join("\n") && one.number === number)
  ?? parsed.tables.find((one) => !path.length && !one.path.length);

/** The text of a field whose key is in no schema, such as a tolerance of the method by default. */
function withoutSchema(key, text) {
  const toml = /^[[{"'\d.+-]|^(true|false)$/.test(text.trim()) ? text.trim() : quoted(text);
  try {
    const words = outOfRange(key, parseValue(toml));
    return words ? { words } : { toml };
  } catch (error) {
    if (!(error instanceof CaseFault)) throw error;
    return { words: error.message };
  }
}

function changeField(path, number, key, schema, input) {
  if (!editable()) return;
  const table = findTable(path, number);
  const boolean = schema?.type === "boolean";
  const found = schema ? fromField(key, schema, input.value, unitOf(schema)) : withoutSchema(key, input.value);
  if (boolean && input.value) found.toml = input.value;
  if (found.words) {
    wrongFields.set(input.id, { text: input.value, words: found.words, place: `${cardWords(table)}, ${key}` });
    return refreshSoon();
  }
  wrongFields.delete(input.id);
  pending.delete(idOf(table));
  let text;
  try {
    text = path[0] === "material" && key === "law"
      ? withMaterial(caseText, path[1], { law: found.toml }) : withKey(caseText, table, key, found.toml);
  } catch (error) {
    if (!(error instanceof CaseFault)) throw error;
    wrongFields.set(input.id, { text: input.value, words: error.message, place: cardWords(table) });
    return refreshSoon();
  }
  if (path[0] === "units" && key === "system") text = inSystem(text, input.value);
  if (path[0] === "loading" && key === "control") text = withTrueComments(text);
  if (text === caseText) return refreshSoon();
  take(text);
  done(`Changed: ${key} of ${cardWords(table)}.`);
}

/** The text with materials of the library in other units; numbers of one's own stay as they are. */
function inSystem(text, wanted) {
  const before = library();
  for (const table of parsed.tables.filter((one) => one.path[0] === "material")) {
    const same = before.findIndex(({ keys }) => Object.entries(keys).every(([key, toml]) => parseValue(toml) === table.value[key]));
    if (same >= 0) text = withMaterial(text, table.path[1], setup.library[wanted][same].keys);
  }
  return text;
}

function removeField(path, number, key) {
  const table = findTable(path, number);
  wrongFields.delete(`${idOf(table)}-${key}`);
  if (pending.get(idOf(table)) === key) pending.delete(idOf(table));
  if (table.keys[key]) take(withoutKey(caseText, table, key));
  else refresh();
  done(`Removed: ${key} of ${cardWords(table)}.`);
}

function card(table) {
  const id = idOf(table);
  const schema = schemaOf(table.path, table.value);
  const legend = made("legend", { id: `${id}-legend` }, cardWords(table));
  const keys = Object.keys(table.keys);
  if (pending.has(id) && !keys.includes(pending.get(id))) keys.push(pending.get(id));
  const inside = keys.map((key) => cardField(table, key));
  const buttons = made("div", { className: "buttons" });
  const others = Object.keys(schema.properties).filter((key) =>
    !keys.includes(key) && schema.properties[key].type !== "object"
    && !(schema.properties[key].items?.type === "object"));
  if (others.length && table.path.length) {
    const select = made("select", { id: `${id}-more` }, new Option("Add a key …", ""), ...others.map((key) => new Option(key, key)));
    select.setAttribute("aria-label", `Add a key to ${cardWords(table)}`);
    select.addEventListener("change", () => {
      pending.set(id, select.value);
      refresh();
      part(`${id}-${select.value}`).focus();
    });
    buttons.append(select);
  }
  if (table.path[0] === "material") buttons.append(librarySelect(table, id), ...sameForAll(table, id));
  if (["contact", "tie"].includes(table.path[0])) buttons.append(swapButton(table, id));
  if (table.path.length) {
    const remove = made("button", { type: "button", id: `${id}-remove` }, "Remove entry");
    remove.setAttribute("aria-label", `Remove ${cardWords(table)}`);
    remove.addEventListener("click", () => {
      const words = cardWords(table);
      take(withoutTable(caseText, findTable(table.path, table.number)));
      done(`Removed: ${words}.`);
    });
    buttons.append(remove);
  }
  return made("fieldset", { id }, legend, ...inside, buttons);
}

function librarySelect(table, id) {
  const select = made("select", { id: `${id}-library` }, new Option("From the library …", ""),
    ...library().map((one) => new Option(`${one.name}: ${one.what}`, one.name)));
  select.setAttribute("aria-label", `Material of ${table.path[1]} from the library`);
  select.addEventListener("change", () => {
    const found = library().find((one) => one.name === select.value);
    if (!found || !editable()) return;
    for (const key of Object.keys(found.keys)) wrongFields.delete(`${id}-${key}`);
    take(withMaterial(caseText, table.path[1], found.keys));
    done(`${table.path[1]} has the material ${found.name} (${found.source}).`);
  });
  return select;
}

/** A button that gives the material of a card to all bodies; no button for one body. */
function sameForAll(table, id) {
  if (presentBodies().length < 2) return [];
  const dotted = presentBodies().some((body) => Object.values(tableIn(caseText, `material\n${body}`)?.keys ?? {}).some((place) => place.dotted));
  const button = made("button", { type: "button", id: `${id}-all`, disabled: dotted }, "Give it to all bodies");
  button.setAttribute("aria-label", `Give the material of ${table.path[1]} to all bodies`);
  button.addEventListener("click", () => {
    if (!editable()) return;
    const { keys: places } = findTable(table.path, table.number);
    const keys = Object.fromEntries(Object.entries(places).map(([key, { start, end }]) => [key, caseText.slice(start, end)]));
    let text = caseText;
    for (const body of presentBodies().filter((one) => one !== table.path[1])) {
      const there = tableIn(text, `material\n${body}`);
      if (!there) {
        text = withTable(text, ["material", body], false, keys);
        continue;
      }
      Object.keys(there.keys).filter((key) => !(key in keys)).forEach((key) => { text = withoutKey(text, tableIn(text, `material\n${body}`), key); });
      [...wrongFields.keys()].filter((field) => field.startsWith(`${idOf(there)}-`)).forEach((field) => wrongFields.delete(field));
      Object.entries(keys).forEach(([key, toml]) => { text = withKey(text, tableIn(text, `material\n${body}`), key, toml); });
    }
    take(text);
    done(`All ${presentBodies().length} bodies have the material of ${table.path[1]}.`);
  });
  return [button];
}

/** The keys of a contact or tie that the other kind does not have. */
const extraKeys = (table, other) => Object.keys(table.keys).filter((key) => !schemaOf([other]).properties[key]);

/** The text with a tie instead of a contact, or with a contact instead of a tie. */
function swapped(text, table, other) {
  const head = text.slice(table.start, table.body);
  return spliced(text, table.start, table.body, head.replace(/;[^;\n]*write \[\[\w+\]\][^\n]*/, "").replace(/\[\[.*?\]\]/, `[[${other}]]`));
}

/** A button that makes a tie of a contact, or a contact of a tie. */
function swapButton(table, id) {
  const other = table.path[0] === "tie" ? "contact" : "tie";
  const extra = extraKeys(table, other);
  const words = other === "tie" ? "Glue instead" : "Contact instead";
  const button = made("button", { type: "button", id: `${id}-swap`, disabled: extra.length > 0 }, words);
  button.setAttribute("aria-label", `${words}, ${table.value.primary} and ${table.value.secondary}`);
  button.title = extra.length ? `Remove ${extra.join(", ")} first` : "";
  button.addEventListener("click", () => {
    take(swapped(caseText, findTable(table.path, table.number), other));
    done(`${words}: ${table.value.primary} and ${table.value.secondary}.`);
  });
  return button;
}

/* ---- What is shown ---- */

/** The place of a fault: the field or the card that has it, if there is one. */
function placeOf(path) {
  const table = parsed.tables.filter((one) => {
    const steps = one.number === null ? one.path : [...one.path, one.number];
    return one.path.length && steps.every((step, k) => path[k] === step);
  }).sort((a, b) => b.path.length - a.path.length)[0];
  if (!table) return {};
  const key = path[table.path.length + (table.number === null ? 0 : 1)];
  return { table, key, id: key === undefined ? idOf(table) : `${idOf(table)}-${key}` };
}

function refresh() {
  const cards = parsed.tables.filter((table) => table.path.length || "title" in table.keys);
  const now = JSON.stringify([
    cards.map((table) => [table.path, table.number, Object.keys(table.keys), pending.get(idOf(table)),
      table.value.law, table.value.control, table.value.builder]), unitsOfFields(),
  ]);
  if (now !== shape) {
    const focused = document.activeElement?.id;
    const within = part("cards").contains(document.activeElement);
    part("cards").replaceChildren(...cards.map(card), made("datalist", { id: "names" },
      ...Object.keys(drawn.surfacesOf(parsed.value)).map((name) => new Option(name))));
    if (within) (document.getElementById(focused) ?? part("entries-h")).focus({ preventScroll: true });
    offerNames();
    const asked = part("kind").value === "combination"; // its fields are the loads
    if (shape === "" || asked || JSON.parse(shape)[1] !== unitsOfFields()) showKind();
    shape = now;
  }
  followQuestion();
  showFaults(cards);
  putNear();
  paintFaces();
  part("cards").setAttribute("aria-busy", "false");
}

const madeConstant = new Set(); // the loads that a button has made constant

/** A load without whether it is constant. */
const loadKey = (kind, { constant, ...value }) => `${kind} ${JSON.stringify(value)}`;

/** The paths of loads that a button has made constant, or without any of them of all constant loads. */
function toGrow() {
  const { load, gravity } = parsed.value;
  const constant = (Array.isArray(load) ? load : []).flatMap((row, k) => (row.constant === true ? [["load", k, row]] : []));
  const all = [...constant, ...(gravity?.constant === true ? [["gravity", null, gravity]] : [])];
  const own = all.filter(([kind, , row]) => madeConstant.has(loadKey(kind, row)));
  return own.length ? own : constant;
}

/** The text in which ties replace some contacts, in words; contacts with keys of their own remain. */
function glue(rows) {
  const kept = [];
  let text = caseText;
  for (const row of rows) {
    const table = parseToml(text).tables.find(({ path, value }) => path[0] === "contact" && value.primary === row.primary && value.secondary === row.secondary);
    if (extraKeys(table, "tie").length) kept.push(row.primary);
    else text = swapped(text, table, "tie");
  }
  take(text);
  const others = kept.length ? ` These have keys that a tie does not have: ${kept.join(", ")}.` : "";
  return `${rows.length - kept.length} contacts are ties now.${others}`;
}

/**
 * What a button in the list of faults does: its words, and a change that returns what it has done.
 * The change is given the names that it acts on.
 */
const REMEDIES = {
  constant: ["Make all loads constant", () => {
    const growing = growingLoads(parsed.value);
    let text = caseText;
    madeConstant.clear();
    for (const [kind, number] of growing) {
      const table = tableIn(text, kind, number);
      madeConstant.add(loadKey(kind, table.value));
      wrongFields.delete(`${idOf(table)}-constant`);
      text = withKey(text, table, "constant", "true");
    }
    take(text);
    return `All loads are constant now: constant = true for ${growing.length} of them.`;
  }],
  grow: ["Let these loads grow", () => {
    const found = toGrow();
    let text = caseText;
    for (const [kind, number] of found) {
      const table = tableIn(text, kind, number);
      text = kind === "gravity" ? withKey(text, table, "constant", "false") : withoutKey(text, table, "constant");
    }
    madeConstant.clear();
    take(text);
    return `${found.length} ${found.length === 1 ? "load grows" : "loads grow"} with the load factor again.`;
  }],
  kind: ["Choose the kind", () => goToForm("model", "add-model-kind")],
  material: ["Choose a material", (bodies) => goToForm("material", "add-body", bodies?.[0])],
  support: ["Add a support", () => goToForm("support", "add-components")],
  load: ["Add a load", () => goToForm("pressure", "kind")], // the kind of load is still open
  contact: ["Add a contact", (surfaces) => {
    chosen.clear();
    surfaces.forEach((name) => chosen.add(name));
    paintFaces();
    goToForm("contact", "add-coulomb");
    return `Chosen: ${surfaces.join(" and ")}. Press Add, or choose a tie.`;
  }],
  joint: ["Go to its contact", (sides) => {
    const number = parsed.value.contact.findIndex(({ primary, secondary }) => sides.includes(primary) && sides.includes(secondary));
    const swap = part(`e-contact-${number}-swap`);
    (swap.disabled ? part(`e-contact-${number}-primary`) : swap).focus();
  }],
  bolts: ["Glue bolts to their nuts", () => glue(boltedRows(parsed.value.contact, setup.joints))],
  tie: ["Glue them instead", () => glue(refusedRows(parsed.value.contact, setup.refused))],
};


/** Show the form of an entry, with the focus in one of its fields, which may get a value. */
function goToForm(kind, field, value) {
  part("kind").value = kind;
  showKind();
  if (value !== undefined) part(field).value = value;
  part(field).focus();
}

function remedyButton(remedy, of) {
  const [words, change] = REMEDIES[remedy];
  const button = made("button", { type: "button" }, words);
  if (of) button.setAttribute("aria-label", `${words}, ${of.join(" and ")}`);
  button.addEventListener("click", () => {
    const changed = change(of);
    if (changed) done(changed);
  });
  return button;
}

/** The bodies whose material still has the placeholders of the first case. */
const emptyMaterials = () => Object.entries(parsed.value.material ?? {})
  .filter(([, one]) => one.young === 0 && Number.isNaN(one.poisson)).map(([body]) => body);

/** Fill fields, and write faults beside them and into the list. */
function showFaults(cards) {
  const faults = parsed.fault ? [] : faultsOfCase(parsed.value, setup.schema, drawn);
  const atField = new Map();
  const lines = [];
  if (parsed.fault) lines.push({ words: `The text cannot be read, line ${parsed.fault.line}: ${parsed.fault.message}` });
  for (const [id, { words, place }] of wrongFields) {
    atField.set(id, words);
    lines.push({ words: `${place}: ${words} (not in the case file)`, id });
  }
  const back = parsed.fault || parsed.value.loading?.control === "strength" || !madeConstant.size ? [] : toGrow();
  if (back.length && !faults.some(({ remedy }) => remedy === "grow")) {
    faults.push({ path: ["load"], words: `${back.length} of the loads became constant for the factor of safety, and do not grow with the load factor`, loose: true, remedy: "grow" });
  }
  const empty = parsed.fault ? [] : emptyMaterials();
  if (empty.length > 4) {
    lines.push({ words: `${empty.length} bodies have no material yet: ${empty.slice(0, 3).join(", ")} and ${empty.length - 3} more`, remedy: "material" });
  }
  for (const { path, words, loose, remedy, of } of faults) {
    const { table, key, id } = placeOf(path);
    if (id && wrongFields.has(id)) continue; // its line says what was typed
    if (id) atField.set(id, words);
    if (empty.length > 4 && path[0] === "material" && empty.includes(path[1])) continue;
    const place = table ? `${cardWords(table)}${key === undefined ? "" : `, ${key}`}` : path.length ? `[${path[0]}]` : "The case";
    lines.push({ words: `${place}: ${words}`, id, loose, of, remedy: (of || !lines.some((line) => line.remedy === remedy)) && remedy });
  }
  for (const table of cards) {
    for (const key of Object.keys(schemaOf(table.path, table.value).properties).concat(Object.keys(table.keys))) {
      const input = document.getElementById(`${idOf(table)}-${key}`);
      if (!input) continue;
      const wrong = wrongFields.get(input.id);
      if (wrong) input.value = wrong.text;
      else if (key in table.keys) input.value = fieldText(table, key);
      input.setAttribute("aria-invalid", String(atField.has(input.id)));
      part(`${input.id}-fault`).textContent = atField.has(input.id) ? `${key}: ${atField.get(input.id)}.` : "";
    }
    part(`${idOf(table)}-legend`).textContent = cardWords(table);
  }
  if (formAsks() !== askedLast) lines.push({ words: `What is asked: the form has changed, and the case file has not; press "Ask this"`, id: "ask-button" });
  const focused = part("left").contains(document.activeElement);
  part("left").replaceChildren(...(lines.length ? lines : [{ words: "Nothing. perfplast check performs all other tests." }])
    .map(({ words, id, loose, remedy, of }) => {
      const target = id && document.getElementById(id);
      const item = made("li", { className: !lines.length ? "" : loose ? "loose" : "wrong" });
      if (target) {
        const button = made("button", { type: "button" }, words);
        button.addEventListener("click", () => (target.matches("input, select, button") ? target : target.querySelector("input, select"))?.focus());
        item.append(button);
      } else {
        item.append(words);
      }
      if (remedy) item.append(" ", remedyButton(remedy, of));
      return item;
    }));
  if (focused) (part("left").querySelector("button") ?? part("left-h")).focus({ preventScroll: true });
  part("text").setAttribute("aria-invalid", String(Boolean(parsed.fault)));
  for (const id of ["add-button", "ask-button"]) part(id).disabled = Boolean(parsed.fault);
  const open = lines.filter((line) => !line.loose).length;
  part("save").textContent = open ? `Save case.toml (${open} left)` : "Save case.toml";
}

/* ---- The text, files, and the clipboard ---- */

part("text").addEventListener("input", () => take(part("text").value, { rewrite: false }));
part("undo").addEventListener("click", () => {
  wrongFields.clear();
  take(history.pop(), { remember: false });
  done("The last change is undone.");
});
part("save").addEventListener("click", () => {
  const link = made("a", { href: URL.createObjectURL(new Blob([caseText], { type: "text/plain" })), download: "case.toml" });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  done("The browser saves case.toml. Put it into the folder of this page, in the place of the first one. If the browser has added a number, as in case (1).toml, rename the file.");
});
part("copy").addEventListener("click", async () => {
  part("text").select();
  try {
    await navigator.clipboard.writeText(caseText);
    done("The case file is on the clipboard.");
  } catch {
    done(document.execCommand("copy") ? "The case file is on the clipboard." : "This browser does not copy; the text is selected.");
  }
});
part("open").addEventListener("change", async ({ target }) => {
  const [file] = target.files;
  if (file) open(await file.text(), file.name);
  target.value = "";
});
document.addEventListener("dragover", (event) => {
  if (!event.dataTransfer.types.includes("Files")) return;
  event.preventDefault();
  document.body.classList.add("dropping");
});
document.addEventListener("dragleave", () => document.body.classList.remove("dropping"));
document.addEventListener("drop", async (event) => {
  document.body.classList.remove("dropping");
  const [file] = event.dataTransfer.files;
  if (!file) return;
  event.preventDefault();
  open(await file.text(), file.name);
});
let resting = null; // the pointer names the face on which it rests
part("canvas").addEventListener("pointermove", ({ target, buttons, offsetX, offsetY }) => {
  clearTimeout(resting);
  target.title = "";
  if (buttons || !painter) return;
  resting = setTimeout(() => {
    const triangle = painter.triangleAt(offsetX, offsetY);
    target.title = (triangle >= 0 && data.faces.words[painter.mesh.faces[triangle]]) || "";
  }, 150);
});
part("canvas").addEventListener("pick", ({ detail }) => (detail ? toggleFace(detail) : undefined));
part("canvas").addEventListener("ready", async ({ detail }) => {
  painter = detail;
  paintFaces();
  marked = await MarkedFaces.of(data, detail.mesh);
  drawMarks();
  part("drawn").dataset.ready = "";
});
part("canvas").setAttribute("aria-label", "The bodies; keys turn, move and zoom them. The lists below choose faces by name");
open(setup.case, "The first case");
part("undo").disabled = true;
