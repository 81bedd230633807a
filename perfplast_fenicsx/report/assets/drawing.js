// Draws triangles and lines, body by body, and tells which triangle is at a pixel.

class Drawing {
  constructor(canvas, mesh) {
    const options = { antialias: true, preserveDrawingBuffer: true };
    const gl = canvas.getContext("webgl2", options);
    if (!gl) throw new Error("this browser has no WebGL 2");
    Object.assign(this, { gl, canvas, mesh, program: makeProgram(gl), places: {} });
    this.faces = this.bundle(mesh.triangles);
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

  /** Buffers of corners, each with a place, a motion and a value of its own. */
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

  /** Take other marks: of each its colour and the coordinates of the ends of its lines. */
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
    for (const bundle of [this.faces, this.edges, ...this.marks]) {
      this.fill(bundle, 1, gathered(motion, bundle.corners, 3));
    }
  }

  /** Take a value for each corner of triangles; null for none. */
  setValues(values) {
    const { gl } = this;
    gl.bindVertexArray(this.faces.array);
    if (values === null) {
      gl.disableVertexAttribArray(2);
    } else {
      this.fill(this.faces, 2, values);
      gl.enableVertexAttribArray(2);
    }
  }

  uniform(kind, name, ...values) {
    this.places[name] ??= this.gl.getUniformLocation(this.program, name);
    this.gl[`uniform${kind}`](this.places[name], ...values);
  }

  /** Draw what `look` says: camera, amount, cut, field, range, hidden, picked, meshed. */
  draw(look, picking = false) {
    const { gl, canvas, mesh } = this;
    const { width, height } = canvas;
    const half = look.camera.half(width, height);
    const [u, v, w] = look.camera.axes;
    gl.viewport(0, 0, width, height);
    gl.clearColor(...(picking ? [0, 0, 0, 0] : [1, 1, 1, 1]));
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
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
    gl.bindVertexArray(this.faces.array);
    this.uniform("1f", "nearer", 0);
    this.uniform("1i", "mode", picking ? 3 : look.field ? 1 : 0);
    this.bodies(gl.TRIANGLES, 3, mesh.triangleStarts, look, (body) => {
      this.uniform("3fv", "colour", bodyColour(body).map((a) => a / 255));
      this.uniform("1f", "glow", body === look.picked && !look.field ? 0.25 : 0);
    });
    if (picking) return;
    gl.bindVertexArray(this.edges.array);
    this.uniform("1f", "nearer", 2e-4);
    this.uniform("1i", "mode", 2);
    this.bodies(gl.LINES, 2, mesh.lineStarts, look, (body) => {
      // Colours of a field stay those of the legend: the edges tell which body is picked.
      this.uniform("3fv", "colour", body === look.picked ? [0.8, 0.05, 0.4] : [0.12, 0.13, 0.15]);
    });
    if (look.outlined) {
      this.uniform("1f", "amount", 0);
      this.uniform("3f", "colour", 0.5, 0.52, 0.56);
      this.bodies(gl.LINES, 2, mesh.lineStarts, look, () => {});
      this.uniform("1f", "amount", look.amount);
    }
    if (!look.marked) return;
    this.uniform("1f", "nearer", 4e-4);
    for (const { array, corners, colour } of this.marks) {
      gl.bindVertexArray(array);
      this.uniform("3fv", "colour", colour);
      gl.drawArrays(gl.LINES, 0, corners.length);
    }
  }

  bodies(kind, corners, starts, look, prepare) {
    for (let body = 0; body + 1 < starts.length; body++) {
      if (look.hidden.has(body)) continue;
      prepare(body);
      this.gl.drawArrays(kind, corners * starts[body], corners * (starts[body + 1] - starts[body]));
    }
  }

  /** The triangle at a pixel from the lower left corner; −1 where there is none. */
  pick(look, x, y) {
    const { gl, canvas } = this;
    const found = new Uint8Array(4);
    const frame = gl.createFramebuffer();
    const stores = [gl.RGBA8, gl.DEPTH_COMPONENT16].map((format, i) => {
      const store = gl.createRenderbuffer();
      gl.bindRenderbuffer(gl.RENDERBUFFER, store);
      gl.renderbufferStorage(gl.RENDERBUFFER, format, canvas.width, canvas.height);
      gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
      const where = i ? gl.DEPTH_ATTACHMENT : gl.COLOR_ATTACHMENT0;
      gl.framebufferRenderbuffer(gl.FRAMEBUFFER, where, gl.RENDERBUFFER, store);
      return store;
    });
    gl.enable(gl.SCISSOR_TEST);
    gl.scissor(x, y, 1, 1);
    this.draw(look, true);
    gl.readPixels(x, y, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, found);
    gl.disable(gl.SCISSOR_TEST);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.deleteFramebuffer(frame);
    stores.forEach((store) => gl.deleteRenderbuffer(store));
    return found[0] + 256 * found[1] + 65536 * found[2] - 1;
  }
}
