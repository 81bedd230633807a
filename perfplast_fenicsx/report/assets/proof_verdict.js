// The verdict on the proof file in a page.

const TYPES_OF_PROOF = { float64: Float64Array, int32: Int32Array, uint8: Uint8Array };

/** Read an array that proof_data.py packs: bytes of the same place value together, deflated. */
async function unpacked({ shape, type, data }) {
  const deflated = Uint8Array.from(atob(data), (letter) => letter.charCodeAt(0));
  const stream = new Blob([deflated]).stream().pipeThrough(new DecompressionStream("deflate"));
  const byPlace = new Uint8Array(await new Response(stream).arrayBuffer());
  const Type = TYPES_OF_PROOF[type], width = Type.BYTES_PER_ELEMENT, count = byPlace.length / width;
  const bytes = new Uint8Array(byPlace.length);
  for (let k = 0; k < width; k++) for (let i = 0; i < count; i++) bytes[i * width + k] =
    byPlace[k * count + i];
  const size = shape.reduce((a, b) => a * b, 1), values = new Type(bytes.buffer);
  if (values.length !== size) refuse("the page contains fewer numbers than it declares");
  return { shape, data: values };
}

/** Names of arrays that do not describe bodies, so that halves do not share them. */
const OF_ONE_HALF = ["stress", "velocity", "nodes", "joint_force", "joint_traction", "inner_force",
  "inner_traction"];

/** The SHA-256 of the numbers of all halves (docs/proof.md), or null if the browser has no SHA-256. */
async function digestOf(arrays) {
  if (!globalThis.crypto?.subtle) return null;
  const parts = [];
  for (const kind of Object.keys(arrays).sort()) {
    const { numbers, ...rest } = arrays[kind];
    const every = { ...rest, ...Object.fromEntries(Object.entries(numbers).map(
      ([name, y]) => [name, { shape: [], data: [y] }])) };
    for (const name of Object.keys(every).sort()) {
      const { shape, data } = every[name], view = new DataView(new ArrayBuffer(8 * data.length));
      data.forEach((y, i) => view.setFloat64(8 * i, y, true));
      parts.push(new TextEncoder().encode(`${kind}/${name} ${shape.join()}\n`), view.buffer);
    }
  }
  const bytes = await new Blob(parts).arrayBuffer();
  const found = new Uint8Array(await globalThis.crypto.subtle.digest("SHA-256", bytes));
  return [...found].map((byte) => byte.toString(16).padStart(2, "0")).join("");
}

/** A number with six digits, rounded down or up. */
function shown(x, up) {
  if (x === 0) return "0";
  const unit = 10 ** (Math.floor(Math.log10(Math.abs(x))) - 5);
  const near = Number(x.toPrecision(6)), beyond = up ? near < x : near > x;
  return String(beyond ? Number((near + (up ? unit : -unit)).toPrecision(6)) : near);
}

/** The arrays of a half by name, and its numbers. */
async function arraysOf({ numbers, arrays }) {
  const found = { numbers };
  for (const [name, packed] of Object.entries(arrays)) found[name] = await unpacked(packed);
  return found;
}

/**
 * Return the factors of safety that two files prove, and a sentence: one file contains a stress with
 * strengths divided by one factor, the other a velocity with another factor, both for the same bodies.
 * `lower` and `upper` are the verdicts on them.
 */
async function verdictOnPair(below, above, lower, upper) {
  try {
    const parts = [];
    for (const [kind, halves] of [["lower", below], ["upper", above]]) {
      const arrays = await arraysOf(halves[kind]), body = bodyOf(arrays);
      const reduction = reductionOf(body, arrays) ?? refuse("strength_factor is missing");
      if (body.loads[1].some) refuse("there are constant loads, which the factor 1 does not multiply");
      parts.push({ body: whole(body, reduction), factor: reduction.factor });
    }
    const fault = lower.lower.fault ?? upper.upper.fault;
    if (fault) refuse(fault);
    if (!(lower.lower.proven >= 1)) refuse("the stress does not carry the loads with the factor 1");
    if (!(upper.upper.proven <= 1)) refuse("the loads with the factor 1 do not drive the mechanism");
    compare(...parts.map(({ body }) => body));
    const [carried, not] = parts.map(({ factor }) => factor);
    if (!(carried <= not)) refuse("the factor of the lower file is above the factor of the upper file");
    return { carried, not,
      sentence: `Factor of safety: between ${shown(carried)} and ${shown(not, true)}; both files describe`
        + " the same bodies." };
  } catch (error) {
    if (!(error instanceof Refused)) throw error;
    return { fault: error.message, sentence: `The factor of safety is not proven: ${error.message}.` };
  }
}

/** Return what the halves prove by kind, { claimed, proven } or { claimed, fault }, and a sentence. */
async function verdictOn(halves) {
  const kinds = ["lower", "upper"].filter((kind) => halves[kind]), arrays = {}, found = {};
  const judge = { lower: lowerBound, upper: upperBound };
  for (const kind of kinds) found[kind] = { claimed: halves[kind].numbers.bound };
  const caught = (some, work) => {
    try { work(); } catch (error) {
      if (!(error instanceof Refused)) throw error;
      for (const kind of some) found[kind] = { claimed: found[kind].claimed, fault: error.message };
    }
  };
  for (const kind of kinds) {
    const shared = Object.entries(halves[kind].same ? arrays.lower : {});
    arrays[kind] = { ...Object.fromEntries(shared.filter(([name]) => !OF_ONE_HALF.includes(name))),
      ...await arraysOf(halves[kind]) };
  }
  found.digest = await digestOf(arrays);
  const read = { lower: readStress, upper: readVelocity }, ready = {};
  caught(kinds, () => { // invalid data of bodies invalidate the whole file
    for (const kind of kinds) {
      const old = kind === "upper" && ready.lower && Object.keys(halves.upper.arrays).length === 2;
      const alike = !!arrays.lower?.numbers.revolved === !!arrays[kind].numbers.revolved;
      const body = old && halves.upper.same && alike ? ready.lower.body : bodyOf(arrays[kind]);
      if (!Number.isFinite(found[kind].claimed)) refuse("bound is not a number");
      if (found[kind].claimed < 0 && !body.loads[1].some) refuse("bound is negative");
      reductionOf(body, arrays[kind]);
      ready[kind] = { body, half: read[kind](body, arrays[kind]) };
    }
    if (kinds.length === 2 && ready.upper.body !== ready.lower.body) compare(ready.lower.body,
      ready.upper.body);
    for (const kind of kinds) ready[kind].fine = true;
  });
  for (const kind of kinds) if (ready[kind]?.fine) caught([kind], () => {
    const { body, half } = ready[kind], result = judge[kind](body, half), { proven, power, others } = result,
      { claimed } = found[kind];
    ready[kind].result = result;
    const off = kind === "lower" ? claimed - proven : proven - claimed;
    if (!(off <= 1e-8 * Math.abs(proven) + 1e-12 * power)) {
      refuse(`only ${proven} is proven, and ${claimed} is claimed`);
    }
    found[kind].proven = proven;
    if (others < Infinity && others !== null) found[kind].note =
      ` Free loads with any factor up to ${shown(others)} reduce this bound by a thousandth at most.`;
  });
  const [low, high] = ["lower", "upper"].map((kind) => found[kind]?.proven);
  if (low !== undefined && high !== undefined) caught(kinds, () => {
    const { power } = ready.upper.result;
    if (!(low <= high + 1e-8 * Math.abs(high) + 1e-12 * power)) {
      refuse(`the lower bound ${low} is above the upper one ${high}`);
    }
  });
  if (kinds.every((kind) => found[kind].fault === found[kinds[0]].fault && found[kind].fault)) {
    found.sentence = `Not proven in this browser: ${found[kinds[0]].fault}.`;
  } else if (low !== undefined && high !== undefined) {
    found.sentence = `Proven again in this browser: between ${shown(low)} and ${shown(high, true)}.`;
  } else found.sentence = kinds.map((kind) => (found[kind].fault
    ? `The ${kind} bound is not proven in this browser: ${found[kind].fault}.`
    : `The ${kind} bound ${shown(found[kind].proven, kind === "upper")} is proven again in this browser.`))
    .join(" ");
  if (high !== undefined) found.sentence += found.upper.note ?? "";
  return found;
}
