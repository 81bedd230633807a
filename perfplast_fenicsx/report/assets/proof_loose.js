// A stress at the apex of a cone with c = 0 has no room for another one that balances what it leaves.
// There residuals have limits (docs/proof.md, limits of residuals).

/** Residuals relative to the least strength that they touch, and forces without balance in all. */
class Limits {
  constructor(body, stress, factors) {
    const { d, w, n, across } = body, none = Number.MAX_VALUE, tiny = 2 ** -1022;
    this.body = body;
    const radii = range(n).map((c) => {
      const cone = body.cones[body.cone[c]];
      if (!cone || cone.c > 0) return body.radius(c);
      const heads = range(w).map((k) =>
        vector(stress.subarray((c * w + k) * d * d, (c * w + k + 1) * d * d), d))
        .filter((v) => v.some((y) => y)).map((v) =>
          Math.max(0, -v.reduce((sum, y, i) => sum + y * cone.q[i], 0)));
      return heads.length ? Math.min(...heads) / cone.steepest : none;
    });
    const least = radii.reduce((y, z) => Math.min(y, z)), weakest = least > 0 && least < none ? least : tiny;
    this.finite = (y) => (y === Infinity ? weakest : y === none ? tiny : y);
    this.strength = radii.map((y, c) => y * body.volume[c] ** ((d - 1) / d));
    this.radii = radii;
    this.around = [...radii];
    across.forEach((other, side) => {
      const c = Math.floor(side / w), o = Math.floor(other / w);
      if (other >= 0 && radii[c] !== none) this.around[c] = Math.min(this.around[c], radii[o]);
    });
    this.pieces = new Map();
    this.total = 0;
    this.loads = 0;
    const size = (values) => norm(values), mean = (values) => values.reduce(add, 0) / values.length;
    body.loads.forEach((of, kind) => {
      const factor = Math.abs(factors[kind]), at = (values, k) => values.subarray(k * d, k * d + d);
      for (let c = 0; c < n; c++) {
        const pores = mean(row(of.pore_pressure, w, c).map(Math.abs)) * body.volume[c] ** ((d - 1) / d);
        this.act(c, factor * (body.volume[c] * size(at(of.body_force, c)) + pores));
      }
      for (let i = 0; i < body.f; i++) {
        this.act(Math.floor(body.outer[i] / w),
          factor * norm(body.area[body.outer[i]]) * mean(range(d).map((j) =>
          size(at(of.traction, i * d + j)))));
      }
      this.loads += factor * [...of.rigid_force].reduce((sum, y) => sum + Math.abs(y), 0);
    });
  }

  piece(c) {
    const at = this.body.pieces.of(c);
    if (!this.pieces.has(at)) this.pieces.set(at, { left: 0, loads: 0, borne: 0 });
    return this.pieces.get(at);
  }

  /** A load acts on a cell, or a reaction, which does not count among all loads. */
  act(c, size, counts = true) {
    this.piece(c).loads += size;
    if (counts) this.loads += size;
  }

  /** A row leaves a force of this size, and a stress beside a strength. */
  leave(c, force, stress, strength) {
    if (!(stress <= 1e-10 * this.finite(strength))) {
      refuse("a stress without cohesion leaves more than rounding");
    }
    this.piece(c).left += force;
    this.total += force;
  }

  ofCell(c, force) {
    const x = cornersOf(this.body, c),
      extent = Math.max(...range(this.body.d).map((i) =>
      Math.max(...x.map((p) => p[i])) - Math.min(...x.map((p) => p[i]))));
    this.leave(c, force, (force / this.body.volume[c]) * extent, this.around[c]);
  }

  /** Tractions at the vertices of a side, beside the strengths of some cells. */
  ofSide(side, tractions, cells) {
    const area = norm(this.body.area[side]), mean = tractions.reduce((y, z) => y + z, 0) / tractions.length;
    this.leave(Math.floor(side / this.body.w), area * mean, Math.max(...tractions),
      Math.min(...cells.map((c) => this.radii[c])));
  }

  check() {
    for (let c = 0; c < this.body.n; c++) this.piece(c).borne += this.strength[c];
    const fails = [...this.pieces.values()].some(({ left, loads, borne }) => loads &&
      !(left <= 1e-10 * (loads + 1e-3 * Math.min(this.loads, borne))));
    const weakest = this.strength.reduce((y, z) => Math.min(y, z));
    if (fails || (this.total && !(this.total <= 1e-10 * this.loads && this.total <= 1e-7 * weakest))) {
      refuse("forces without balance are more than rounding beside ground without cohesion");
    }
    return this.total;
  }
}
