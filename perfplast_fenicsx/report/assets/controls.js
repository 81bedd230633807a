// The controls below the picture, and the texts on it.

const part = (id) => document.getElementById(id);
const data = JSON.parse(part("data").textContent);

/** Axes as lines from the middle; those that point away from the viewer are pale. */
function drawAxes(camera) {
  const [u, v, w] = camera.axes;
  const names = data.axisymmetric ? ["r", "z"] : data.plane ? ["x", "y"] : ["x", "y", "z"];
  part("axes").innerHTML = names.map((name, k) => {
    const [x, y] = [34 * u[k], -34 * v[k]];
    return `<g><line x2="${x}" y2="${y}" stroke="currentColor"` +
      ` stroke-width="${w[k] < -0.3 ? 1.5 : 3}"/><text x="${1.25 * x}" y="${1.25 * y + 5}" fill="currentColor"` +
      ` text-anchor="middle">${name}</text></g>`;
  }).join("");
}

/** A ring at the largest value, with its number. */
function drawLargest(viewer) {
  const found = viewer.largest;
  const { canvas } = viewer;
  part("largest").toggleAttribute("hidden", !found || !viewer.look.marked);
  if (!found) return;
  part("largest").setAttribute("viewBox", `0 0 ${canvas.clientWidth} ${canvas.clientHeight}`);
  const left = found.x > 0.5 * canvas.clientWidth;
  part("largest").innerHTML = [5, 2].map((width) =>
    `<circle cx="${found.x}" cy="${found.y}" r="7" stroke-width="${width}"/>`).join("") +
    `<text x="${found.x + (left ? -11 : 11)}" y="${found.y + 4}"` +
    ` stroke-width="3" paint-order="stroke" text-anchor="${left ? "end" : "start"}">largest: ${short(found.value)}</text>`;
}

/** Legend and numbers beside the controls. */
function tell(viewer) {
  const { field, look, state } = viewer;
  drawAxes(viewer.camera);
  drawLargest(viewer);
  part("legend").hidden = !look.field;
  if (look.field) {
    const [low, high] = look.range;
    const name = field.label + (field.unit ? ` (${field.unit})` : "");
    const ends = [low, 0.5 * (low + high), high].map(short);
    part("legend-name").textContent = name;
    ["low", "middle", "high"].forEach((end, k) => {
      part(`legend-${end}`).textContent = ends[k];
    });
    part("legend").setAttribute("aria-label", `${name}: dark ${ends[0]}, bright ${ends[2]}`);
  }
  const missing = field && !look.field ? ` – it has no ${field.label}` : "";
  part("level-told").textContent = (state?.title ?? "") + missing;
  const times = state?.mechanism
    ? `largest velocity drawn as ${short(viewer.percent)} % of the size`
    : `motion × ${short(viewer.amount)}`;
  part("scale-told").textContent = viewer.amount === 0 ? "not deformed" : times;
  part("hide").disabled = look.picked < 0;
  viewer.sides?.later();
}

function connect(viewer) {
  const { canvas, look } = viewer;
  const { names, states, fields } = data;
  const level = part("level");
  let timer = null;

  const say = (text) => { part("told").textContent = text; };
  const named = (found) => {
    if (!found) return say("No body is there.");
    if (found.face > 0) return canvas.dispatchEvent(new CustomEvent("pick", { detail: found.face }));
    const { field } = viewer;
    const unit = field?.unit ? ` ${field.unit}` : "";
    const value = found.value === null ? "" : `: ${field.label} ${short(found.value)}${unit}`;
    say(names[found.body] + value);
  };
  const go = (number) => {
    level.value = number;
    return viewer.show(Number(level.value));
  };
  const step = (by) => go(Math.max(0, Math.min(states.length - 1, Number(level.value) + by)));
  const stop = () => {
    cancelAnimationFrame(timer);
    timer = null;
    viewer.phase = 1;
    part("play").setAttribute("aria-pressed", "false");
    part("play").textContent = "Play";
    viewer.redraw();
  };
  const play = () => {
    if (timer !== null) return stop();
    part("play").setAttribute("aria-pressed", "true");
    part("play").textContent = "Stop";
    let began = null;
    let turned = performance.now();
    const frame = (now) => {
      began ??= now;
      if (viewer.state.mechanism) {
        viewer.phase = 0.5 - 0.5 * Math.cos(((now - began) / 1000) * 2);
        viewer.redraw();
      } else if (now - turned > 700) {
        turned = now;
        const steps = states.filter((state) => !state.mechanism).length;
        go((Number(level.value) + 1) % steps);
      }
      timer = requestAnimationFrame(frame);
    };
    timer = requestAnimationFrame(frame);
  };
  const boxes = names.map((name, body) => {
    const label = document.createElement("label");
    const box = Object.assign(document.createElement("input"), { type: "checkbox", checked: true });
    const patch = document.createElement("i");
    patch.style.background = css(bodyColour(body));
    label.append(box, patch, name);
    part("shown").append(label);
    box.addEventListener("change", () => viewer.setHidden(body, !box.checked));
    return box;
  });
  const setShown = (body, shown) => {
    boxes[body].checked = shown;
    viewer.setHidden(body, !shown);
  };
  const hide = () => look.picked >= 0 && setShown(look.picked, false);
  const all = () => boxes.forEach((_, body) => setShown(body, true));
  const cut = () => {
    const axis = part("cut-axis").value;
    part("cut").disabled = axis === "";
    viewer.cut(axis === "" ? null : Number(axis), Number(part("cut").value));
  };
  const setShare = (share) => {
    viewer.share = share;
    viewer.redraw();
  };

  level.max = states.length - 1;
  level.disabled = states.length < 2;
  level.addEventListener("input", () => viewer.show(Number(level.value)));
  part("field").append(new Option("bodies", ""), ...fields.map((a) => new Option(a.label, a.name)));
  part("field").addEventListener("change", (event) => {
    viewer.colourBy(fields.find((field) => field.name === event.target.value) ?? null);
  });
  part("scale").addEventListener("input", (event) => setShare(Number(event.target.value)));
  part("true-size").addEventListener("click", () => setShare(1 / (viewer.enlargement || 1)));
  ["cut-axis", "cut"].forEach((id) => part(id).addEventListener("input", cut));
  if (data.plane) part("cut-axis").options[3].remove();
  const clicks = { play, hide, all, reset: () => { viewer.camera.reset(); viewer.redraw(); } };
  Object.entries(clicks).forEach(([id, act]) => part(id).addEventListener("click", act));
  part("mesh").addEventListener("change", (event) => {
    look.meshed = event.target.checked;
    viewer.redraw();
  });
  part("marks").addEventListener("change", (event) => {
    look.marked = event.target.checked;
    viewer.redraw();
  });
  part("outline").addEventListener("change", (event) => {
    look.outlined = event.target.checked;
    viewer.redraw();
  });
  part("legend-bar").style.background = scaleGradient();
  window.addEventListener("beforeprint", () => { part("printed").src = viewer.print(); });
  window.addEventListener("afterprint", () => viewer.follow());
  if (!data.plane && !data.faces) viewer.sides = new Sides(viewer, part("sides"));
  followPointers(viewer, named);
  followKeys(viewer, {
    ",": () => step(-1), ".": () => step(1), p: play, h: hide, a: all,
  });
  const first = states.findIndex((state) => state.mechanism);
  const known = fields.filter((field) => field.name in data.states.at(-1).fields);
  // Where nothing flows, the stresses of a limit load are not unique: its velocity is the result.
  const flow = known.find((field) => field.name === "dissipation");
  viewer.field = (data.states.at(-1).mechanism && flow) || known[0] || null;
  part("field").value = viewer.field?.name ?? "";
  say(`Click a ${data.faces ? "face to choose it" : "body to see its name"}.`);
  return go(first < 0 ? states.length - 1 : first).then(() => {
    canvas.dispatchEvent(new CustomEvent("ready", { detail: viewer }));
    canvas.setAttribute("data-ready", "");
  });
}

// Printed pages show the parts that are folded on the screen.
const folded = () => document.querySelectorAll("details:not(#keys):not([open])");
let unfolded = [];
window.addEventListener("beforeprint", () => {
  unfolded = [...folded()];
  unfolded.forEach((details) => { details.open = true; });
});
window.addEventListener("afterprint", () => unfolded.forEach((details) => { details.open = false; }));

if (data !== null) {
  const still = part("still"); // only on reports: a sentence, and a picture if there is one
  still?.classList.add("waiting");
  const fail = (error) => {
    part("view").hidden = true;
    const text = `The bodies cannot be shown here: ${error.message}. All else is on the page.`;
    const words = part("still-words") ?? part("bodies").appendChild(document.createElement("p"));
    words.textContent = text;
    still?.classList.remove("waiting");
    console.warn(text);
  };
  Viewer.of(part("canvas"), data, tell).then(connect).then(() => { if (still) still.hidden = true; }).catch(fail);
  part("canvas").addEventListener("webglcontextlost", () => {
    if (still) still.hidden = false;
    fail(new Error("the browser has stopped WebGL; reload the page"));
  });
}
