// Draws triangles and lines, body by body, and finds the triangle at a pixel.

const MANY = 20000; // most triangles that a machine without a graphics card turns smoothly
const FEW = 6000; // triangles that it turns instead of more

/**
 * Return fewer triangles of the same bodies, to draw while they turn: all corners in one cube of a
 * grid become one. `corners` are the remaining corners of the mesh, `points` their drawn positions.
 */
function coarsened(mesh) {
  const { points, triangles, triangleStarts } = mesh;
  const low = [0, 1, 2].map((k) => points.reduce((least, x, i) => (i % 3 === k ? Math.min(least, x) : least), Infinity));
  for (let cubes = 128; cubes >= 8; cubes /= 2) {
    const length = mesh.size / cubes;
    const first = new Map();
    const of = new Uint32Array(points.length / 3);
    for (let point = 0; point < of.length; point++) {
      const [i, j, k] = [0, 1, 2].map((axis) => Math.floor((points[3 * point + axis] - low[axis]) / length));
      const key = (i * 1024 + j) * 1024 + k;
      if (!first.has(key)) first.set(key, point);
      of[point] = first.get(key);
    }
    const [corners, drawn, starts] = [[], [], [0]];
    for (let body = 0; body + 1 < triangleStarts.length; body++) {
      const seen = new Set();
      for (let k = triangleStarts[body]; k < triangleStarts[body + 1]; k++) {
        const three = [0, 1, 2].map((i) => of[triangles[3 * k + i]]);
        const key = [...three].sort((a, b) => a - b).join();
        if (three[0] === three[1] || three[1] === three[2] || three[0] === three[2] || seen.has(key)) continue;
        seen.add(key);
        drawn.push(...three);
        corners.push(3 * k, 3 * k + 1, 3 * k + 2);
      }
      starts.push(corners.length / 3);
    }
    if (starts.at(-1) <= FEW || cubes === 8) {
      return { corners: Uint32Array.from(corners), points: Uint32Array.from(drawn), starts };
    }
  }
}

class Drawing {
  constructor(canvas, mesh) {
    const many = mesh.triangles.length / 3 > MANY;
    const gl = canvas.getContext("webgl2", { antialias: !many, preserveDrawingBuffer: true, stencil: true });
    if (!gl) throw new Error("this browser has no WebGL 2");
    Object.assign(this, { gl, canvas, mesh, program: makeProgram(gl), places: {} });
    this.faces = this.bundle(mesh.triangles);
    this.few = many ? coarsened(mesh) : null;
    if (many) this.fewFaces = this.bundle(this.few.points);
    this.edges = this.bundle(mesh.lines);
    this.marks = mesh.marks.map(({ anchors, offsets, colour }) => {
      const bundle = this.bundle(anchors);
      this.fill(bundle, 0, gathered(mesh.points, anchors, 3).map((a, k) => a + offsets[k]));
      return { ...bundle, colour };
    });
    gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
    const pixels = scalePixels();
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, 256, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
    gl.useProgram(this.program);
    gl.enable(gl.DEPTH_TEST);
  }

  /** Buffers of corners, each with its own position, motion and value. */
  bundle(corners) {
    const { gl } = this;
    const bundle = { corners, array: gl.createVertexArray(), buffers: [] };
    gl.bindVertexArray(bundle.array);
    [3, 3, 1].forEach((width, i) => {
      bundle.buffers.push(gl.createBuffer());
      gl.bindBuffer(gl.ARRAY_BUFFER, bundle.buffers[i]);
      gl.vertexAttribPointer(i, width, gl.FLOAT, false, 0, 0);
    });
    gl.enableVertexAttribArray(1);
    gl.enableVertexAttribArray(0);
    this.fill(bundle, 0, gathered(this.mesh.points, corners, 3));
    return bundle;
  }

  /** Take other marks: for each, its colour and the coordinates of the ends of its lines. */
  setMarks(kinds) {
    const { gl } = this;
    for (const { array, buffers } of this.marks) {
      buffers.forEach((buffer) => gl.deleteBuffer(buffer));
      gl.deleteVertexArray(array);
    }
    this.marks = kinds.map(({ colour, ends }) => {
      const bundle = this.bundle(new Uint32Array(ends.length / 3));
      this.fill(bundle, 0, ends);
      this.fill(bundle, 1, new Float32Array(ends.length));
      return { ...bundle, colour };
    });
  }

  fill(bundle, which, values) {
    const { gl } = this;
    gl.bindBuffer(gl.ARRAY_BUFFER, bundle.buffers[which]);
    gl.bufferData(gl.ARRAY_BUFFER, values, gl.DYNAMIC_DRAW);
  }

  /** Take the motion of points. */
  setMotion(motion) {
    this.motion = motion;
    for (const bundle of [this.faces, this.edges, ...this.marks, ...(this.few ? [this.fewFaces] : [])]) {
      this.fill(bundle, 1, gathered(motion, bundle.corners, 3));
    }
  }

  /** Take a value for each corner of triangles; null for none. */
  setValues(values) {
    this.valuesOf(this.faces, values);
    if (this.few) this.valuesOf(this.fewFaces, values && gathered(values, this.few.corners, 1));
  }

  valuesOf(bundle, values) {
    const { gl } = this;
    gl.bindVertexArray(bundle.array);
    if (values === null) {
      gl.disableVertexAttribArray(2);
    } else {
      this.fill(bundle, 2, values);
      gl.enableVertexAttribArray(2);
    }
  }

  uniform(kind, name, ...values) {
    this.places[name] ??= this.gl.getUniformLocation(this.program, name);
    this.gl[`uniform${kind}`](this.places[name], ...values);
  }

  /**
   * Draw with the settings in `look`: camera, amount, cut, field, range, hidden, picked, meshed,
   * turning, dark.
   */
  draw(look) {
    const { gl, canvas, mesh } = this;
    const { width, height } = canvas;
    const half = look.camera.half(width, height);
    const [u, v, w] = look.camera.axes;
    gl.viewport(0, 0, width, height);
    gl.clearColor(...(look.dark ? DARK : WHITE).map((a) => a / 255), 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT | gl.STENCIL_BUFFER_BIT);
    const darkField = look.dark && look.field; // its low values are as dark as the paper
    this.uniform("1f", "ambient", look.dark ? DIM_ON_DARK : DIM);
    this.uniform("1i", "rimmed", darkField);
    this.uniform("3f", "ink", ...(darkField ? [0.9, 0.9, 0.9] : [0.25, 0.25, 0.25]));
    this.uniform("1f", "amount", look.amount);
    this.uniform("Matrix3fv", "turn", false, [0, 1, 2].flatMap((k) => [u[k], v[k], w[k]]));
    this.uniform("3fv", "centre", look.camera.centre);
    const deep = 0.1 / (look.camera.radius + look.reach);
    this.uniform("3f", "stretch", height / width / half, 1 / half, -deep);
    this.uniform("2fv", "range", look.range);
    this.uniform("4fv", "cut", look.cut);
    this.uniform("1i", "plane", mesh.plane);
    this.uniform("1i", "meshed", look.meshed);
    this.uniform("1i", "marked", Boolean(mesh.faces));
    const few = look.turning && this.few;
    gl.bindVertexArray((few ? this.fewFaces : this.faces).array);
    this.uniform("1f", "nearer", 0);
    this.uniform("1i", "mode", look.field ? 1 : 0);
    gl.enable(gl.STENCIL_TEST);
    gl.stencilFunc(gl.ALWAYS, 1, 1); // 1 where a body is drawn
    gl.stencilOp(gl.KEEP, gl.KEEP, gl.REPLACE);
    this.bodies(gl.TRIANGLES, 3, few ? few.starts : mesh.triangleStarts, look, (body) => {
      this.uniform("3fv", "colour", bodyColour(body).map((a) => a / 255));
      this.uniform("1f", "glow", body === look.picked && !look.field ? 0.25 : 0);
    });
    gl.stencilOp(gl.KEEP, gl.KEEP, gl.KEEP);
    gl.bindVertexArray(this.edges.array);
    this.uniform("1f", "nearer", 2e-4);
    this.uniform("1i", "mode", 2);
    this.lines(look, (colour) => this.bodies(gl.LINES, 2, mesh.lineStarts, look, (body) => {
      // Colours of a field stay those of the legend: the edges tell which body is picked.
      colour(body === look.picked ? [0.8, 0.05, 0.4] : [0.12, 0.13, 0.15]);
    }));
    if (look.outlined) {
      gl.stencilFunc(gl.ALWAYS, 1, 1);
      this.uniform("1f", "amount", 0);
      this.uniform("3f", "colour", 0.5, 0.52, 0.56);
      this.bodies(gl.LINES, 2, mesh.lineStarts, look, () => {});
      this.uniform("1f", "amount", look.amount);
    }
    if (!look.marked) return;
    this.uniform("1f", "nearer", 4e-4);
    this.lines(look, (setColour) => {
      for (const { array, corners, colour } of this.marks) {
        gl.bindVertexArray(array);
        setColour(colour);
        gl.drawArrays(gl.LINES, 0, corners.length);
      }
    });
  }

  /**
   * Draw lines by a function, which is given a function that sets their colour. On dark paper, the
   * lines are lighter beside the bodies, and also on bodies with the dark colours of a field.
   */
  lines({ dark, field }, draw) {
    const { gl } = this;
    const set = (colour) => this.uniform("3fv", "colour", colour);
    const setLighter = (colour) => set(onDark(colour));
    if (!dark || field) return draw(dark ? setLighter : set);
    gl.stencilFunc(gl.EQUAL, 1, 1);
    draw(set);
    gl.stencilFunc(gl.EQUAL, 0, 1);
    draw(setLighter);
  }

  bodies(kind, corners, starts, look, prepare) {
    for (let body = 0; body + 1 < starts.length; body++) {
      if (look.hidden.has(body)) continue;
      prepare(body);
      this.gl.drawArrays(kind, corners * starts[body], corners * (starts[body + 1] - starts[body]));
    }
  }

  /** The triangle at a point of the picture, in lengths right and up from its middle; −1 for none. */
  pick(look, right, up) {
    const { mesh: { points, triangles, triangleStarts }, motion } = this;
    const { axes, centre } = look.camera;
    const seen = new Float64Array(points.length); // right, up, towards the eye
    for (let k = 0; k < 3; k++) {
      const [p, q, r] = axes[k];
      for (let i = 0; i < points.length; i += 3) {
        seen[i + k] = p * (points[i] + look.amount * motion[i] - centre[0])
          + q * (points[i + 1] + look.amount * motion[i + 1] - centre[1])
          + r * (points[i + 2] + look.amount * motion[i + 2] - centre[2]);
      }
    }
    const [cut, place] = [look.cut.slice(0, 3), look.cut[3]];
    const from = axes.map((axis) => axis.reduce((sum, a, k) => sum + a * cut[k], 0));
    const shift = centre.reduce((sum, a, k) => sum + a * cut[k], 0);
    let [best, nearest] = [-1, -Infinity];
    for (let body = 0; body + 1 < triangleStarts.length; body++) {
      if (look.hidden.has(body)) continue;
      for (let t = triangleStarts[body]; t < triangleStarts[body + 1]; t++) {
        const a = 3 * triangles[3 * t];
        const b = 3 * triangles[3 * t + 1];
        const c = 3 * triangles[3 * t + 2];
        const left = seen[a] < right;
        if (seen[b] < right === left && seen[c] < right === left) continue; // most end here
        const area = (seen[b] - seen[a]) * (seen[c + 1] - seen[a + 1]) - (seen[c] - seen[a]) * (seen[b + 1] - seen[a + 1]);
        if (area === 0) continue;
        const s = ((right - seen[a]) * (seen[c + 1] - seen[a + 1]) - (seen[c] - seen[a]) * (up - seen[a + 1])) / area;
        if (s < 0 || s > 1) continue;
        const r = ((seen[b] - seen[a]) * (up - seen[a + 1]) - (right - seen[a]) * (seen[b + 1] - seen[a + 1])) / area;
        if (r < 0 || s + r > 1) continue;
        const depth = seen[a + 2] + s * (seen[b + 2] - seen[a + 2]) + r * (seen[c + 2] - seen[a + 2]);
        if (depth <= nearest || from[0] * right + from[1] * up + from[2] * depth + shift > place) continue;
        best = t;
        nearest = depth;
      }
    }
    return best;
  }
}
