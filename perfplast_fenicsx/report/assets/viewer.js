// The bodies at a step: the shown field and bodies, the view, and the picked body.

const ENLARGED = 0.12; // the largest motion, as a share of the size of the bodies
const TURNING = 250; // ms after the last motion of the camera until it rests
const SLOW = 24; // ms between frames from which a large mesh turns with half as many pixels a side
const COLLAPSING = 0.06; // the same for a mechanism, in which only a small part may move

class Viewer {
  constructor(canvas, data, mesh, changed) {
    Object.assign(this, { canvas, data, mesh, changed, state: null, field: null, values: null });
    const ends = mesh.marks.flatMap(({ anchors, offsets }) =>
      Array.from(offsets, (offset, i) => mesh.points[3 * anchors[Math.floor(i / 3)] + (i % 3)] + offset));
    this.camera = new Camera(mesh.points, mesh.plane, ENLARGED * data.size, ends);
    this.drawing = new Drawing(canvas, mesh);
    this.look = {
      camera: this.camera, amount: 0, reach: 0, cut: [0, 0, 0, 1], field: false, range: [0, 1],
      hidden: new Set(), picked: -1, meshed: false, marked: true, outlined: false, turning: false,
      dark: false,
    };
    this.scheme = matchMedia("screen and (prefers-color-scheme: dark)");
    this.scheme.addEventListener("change", () => this.follow());
    this.look.dark = this.scheme.matches;
    this.asked = 0;
    this.pace = 0; // mean time between the frames of a turn (ms)
    this.share = 1; // of the enlarged motion
    this.phase = 1; // of a mechanism that moves
    new ResizeObserver(() => this.redraw()).observe(canvas);
    window.addEventListener("resize", () => this.redraw());
    this.watchPixels();
  }

  /** Follow the colour scheme of the screen; paper is white. */
  follow() {
    this.look.dark = this.scheme.matches;
    this.redraw();
  }

  /** Redraw whenever the size of the screen's pixels changes, for example on another screen. */
  watchPixels() {
    const now = matchMedia(`(resolution: ${window.devicePixelRatio}dppx)`);
    const changed = () => { this.watchPixels(); this.redraw(); };
    now.addEventListener("change", changed, { once: true });
  }

  static async of(canvas, data, changed) {
    const [points, triangles, lines, faces] = await Promise.all([
      vectors(data.points), integers(data.triangles), integers(data.lines),
      data.faces ? integers(data.faces.of) : null,
    ]);
    const marks = await Promise.all(data.marks.map(async (mark) => ({
      colour: mark.colour, anchors: await integers(mark.anchors), offsets: await vectors(mark.offsets),
    })));
    return new Viewer(canvas, data, { ...data, points, triangles, lines, faces, marks }, changed);
  }

  /** The magnification of the motion at share 1. */
  get enlargement() {
    const alike = this.data.states.filter((a) => a.mechanism === this.state.mechanism);
    const largest = Math.max(...alike.map((a) => a.largest));
    const share = this.state.mechanism ? COLLAPSING : ENLARGED;
    return largest > 0 ? (share * this.data.size) / largest : 0;
  }

  /** Size at which the largest motion of the state is shown, in percent of the size of the bodies. */
  get percent() {
    return (100 * this.share * this.enlargement * this.state.largest) / this.data.size;
  }

  /** Show a state; if several are requested, the last one. */
  async show(number) {
    const asked = ++this.asked;
    const state = this.data.states[number];
    const motion = await vectors(state.motion);
    const values = await this.valuesOf(state, this.field);
    if (asked !== this.asked) return;
    Object.assign(this, { state, number, motion });
    this.drawing.setMotion(motion);
    this.take(values);
  }

  /** Colour by a field; null for bodies. */
  async colourBy(field) {
    this.field = field;
    const asked = ++this.asked;
    const values = await this.valuesOf(this.state, field);
    if (asked === this.asked) this.take(values);
  }

  /** A value for each corner of triangles; null if the state has no such field. */
  async valuesOf(state, field) {
    const found = field && state.fields[field.name];
    if (!found) return null;
    const values = await numbers(found.values);
    const { triangles } = this.mesh;
    if (found.at === "points") return gathered(values, triangles, 1);
    return Float32Array.from(triangles, (_, corner) => values[Math.floor(corner / 3)]);
  }

  take(values) {
    this.values = values;
    this.drawing.setValues(values);
    this.look.field = values !== null;
    if (values) {
      const { low, high } = this.field;
      this.look.range = high > low ? [low, high] : [low, low + 1];
    }
    this.redraw();
  }

  /** Mark faces by their numbers: 1 for a support, 2 for a load, 4 for chosen, summed. */
  markFaces(marks) {
    const { faces } = this.mesh;
    const values = new Float32Array(3 * faces.length); // Float32Array.from calls a function for each corner
    for (let t = 0; t < faces.length; t++) values.fill(marks.get(faces[t]) ?? 0, 3 * t, 3 * t + 3);
    this.drawing.setValues(values);
    this.redraw();
  }

  /** Redraw for another camera, with fewer triangles of a large mesh until it rests. */
  turned() {
    const now = performance.now();
    const since = this.look.turning ? now - this.lastTurn : 0;
    if (since) this.pace += 0.2 * (Math.min(since, 4 * SLOW) - this.pace); // the user may pause
    this.lastTurn = now;
    this.look.turning = true;
    clearTimeout(this.rest);
    this.rest = setTimeout(() => {
      this.look.turning = false;
      this.redraw();
    }, Math.max(TURNING, 3 * since)); // a slow machine has long frames
    this.redraw();
  }

  redraw() {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => {
      this.waiting = false;
      this.paint();
    });
  }

  /** Draw at once on white paper, and return the picture: printing shows the last frame of a canvas. */
  print() {
    this.look.dark = false;
    this.paint();
    return this.canvas.toDataURL();
  }

  /** Draw at once. */
  paint() {
    this.fit();
    this.look.amount = this.amount;
    this.look.reach = Math.abs(this.amount) * (this.state?.largest ?? 0);
    this.drawing.draw(this.look);
    this.changed(this);
  }

  /** The factor that multiplies the motion. */
  get amount() {
    if (!this.state) return 0;
    return this.share * this.enlargement * (this.state.mechanism ? this.phase : 1);
  }

  /** The largest value of the shown bodies: its position (CSS pixels) and value, or null. */
  get largest() {
    const { values, motion, mesh, look, camera, canvas } = this;
    if (!values) return null;
    let best = -1;
    for (let body = 0; body + 1 < mesh.triangleStarts.length; body++) {
      if (look.hidden.has(body)) continue;
      const [from, to] = [3 * mesh.triangleStarts[body], 3 * mesh.triangleStarts[body + 1]];
      for (let k = from; k < to; k++) if (best < 0 || values[k] > values[best]) best = k;
    }
    if (best < 0) return null;
    const point = mesh.triangles[best];
    const seen = [0, 1, 2].map((k) =>
      mesh.points[3 * point + k] + look.amount * motion[3 * point + k] - camera.centre[k]);
    const [u, v] = camera.axes.map((axis) => axis.reduce((sum, a, k) => sum + a * seen[k], 0));
    const half = camera.half(canvas.width, canvas.height);
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    return {
      x: width / 2 + (u / half) * (height / 2), y: height / 2 - (v / half) * (height / 2),
      value: values[best],
    };
  }

  /** Use as many pixels as the screen, or half as many per side after a large mesh has turned slowly. */
  fit() {
    const { canvas } = this;
    this.coarse ||= this.pace > SLOW && this.drawing.few !== null;
    const ratio = Math.min(window.devicePixelRatio || 1, 2) * (this.look.turning && this.coarse ? 0.5 : 1);
    for (const [side, seen] of [["width", "clientWidth"], ["height", "clientHeight"]]) {
      const wanted = Math.max(1, Math.round(canvas[seen] * ratio));
      if (canvas[side] !== wanted) canvas[side] = wanted;
    }
  }

  /** Cut across an axis at a share of the bodies' length along it; null for no cut. */
  cut(axis, share) {
    const normal = [0, 0, 0];
    if (axis === null) {
      this.look.cut = [...normal, 1];
    } else {
      normal[axis] = 1;
      const { low, high } = this.camera;
      const room = 1e-3 * this.camera.radius;
      this.look.cut = [...normal, low[axis] - room + share * (high[axis] - low[axis] + 2 * room)];
    }
    this.redraw();
  }

  setHidden(body, hidden) {
    this.look.hidden[hidden ? "add" : "delete"](body);
    if (hidden && this.look.picked === body) this.look.picked = -1;
    this.redraw();
  }

  /** The triangle at a point of the canvas (CSS pixels); −1 for none. */
  triangleAt(x, y) {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    const scale = this.camera.half(width, height) / (height / 2);
    return this.drawing.pick(this.look, scale * (x - width / 2), scale * (height / 2 - y));
  }

  /** The body and the value at a point of the canvas (CSS pixels), or null. */
  pick(x, y) {
    const { look, mesh } = this;
    const triangle = this.triangleAt(x, y);
    const starts = mesh.triangleStarts;
    const face = triangle < 0 || !mesh.faces ? 0 : mesh.faces[triangle];
    look.picked = triangle < 0 || face > 0 ? -1 : starts.findIndex((a, k) => a <= triangle && triangle < starts[k + 1]);
    this.redraw();
    if (triangle < 0) return null;
    const at = this.values?.subarray(3 * triangle, 3 * triangle + 3);
    return { body: look.picked, face, value: at ? (at[0] + at[1] + at[2]) / 3 : null };
  }
}
