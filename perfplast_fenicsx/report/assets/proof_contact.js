// Find the opposite facets of two surfaces in contact; the gap between them may have any size.

/** Rows { a, b, order, normal, c, mu } of pairs of facets; b = −1 for an obstacle. */
function contactOf(body) {
  const { d, w, x, facets } = body, rows = [];
  const points = range(body.f).map((i) => range(d).map((j) => {
    const v = facets[i * d + j];
    return range(d).map((k) => x[v * d + k]);
  }));
  const unit = range(body.f).map((i) => {
    const area = body.area[body.outer[i]];
    return area.map((y) => y / norm(area));
  });
  const centre = points.map((of) => range(d).map((i) => of.reduce((sum, p) => sum + p[i], 0) / d));
  const close = range(body.f).map((i) => 1e-6 * widthOf(body, i));
  if (body.revolved) points.forEach((of, i) =>
    { close[i] = Math.min(close[i], 1e-6 * Math.max(...of.map((p) => p[0]))); });
  const on = (tag) => range(body.f).filter((i) => body.surface[i] === tag);
  const foot = (p, q, n) => { // components of p − q along and across n
    const y = minus(p, q), height = dots(y, n);
    return [height, norm(y.map((z, i) => z - height * n[i]))];
  };
  for (let k = 0; k < body.contacts.length / 2; k++) {
    const [ones, others] = [on(body.contacts[2 * k]), on(body.contacts[2 * k + 1])];
    if (ones.length * others.length > 1e8) refuse("surfaces in contact have too many facets");
    const near = ones.map(() => [Infinity, -1]), back = new Map(others.map((b) => [b, [Infinity, -1]]));
    ones.forEach((a, i) => others.forEach((b) => {
      if (unit[a].some((y, j) => Math.abs(y + unit[b][j]) > 1e-8)) return;
      const [height, across] = foot(centre[b], centre[a], unit[a]);
      if (across > close[a] || height < -close[a]) return;
      if (height < near[i][0]) near[i] = [height, b];
      if (height < back.get(b)[0]) back.set(b, [height, a]);
    }));
    const met = new Set();
    ones.forEach((a, i) => {
      const b = near[i][1];
      if (b < 0 || back.get(b)[1] !== a) return;
      const order = points[a].map((p) => points[b].findIndex((q) => foot(q, p, unit[a])[1] <= close[a]));
      if (new Set(order).size < d || order.includes(-1)) return;
      if (body.revolved) { // rings of equal radius, with a third value at the edge
        if (order.some((q, j) => Math.abs(points[a][j][0] - points[b][q][0]) > close[a])) return;
        order.push(2);
      }
      met.add(a).add(b);
      const [c, mu] = body.rubs[0].map((of) => of[k]);
      rows.push({ a, b, order, normal: body.N[body.outer[a]], e: body.e * (d - 1), c, mu });
    });
    // A facet without an opposite facet must not face any facet: along its normal, none may overlap it.
    for (const [mine, theirs] of [[ones, others], [others, ones]]) for (const a of mine) {
      if (met.has(a)) continue;
      const wide = Math.max(...points[a].map((p) => norm(minus(p, centre[a]))));
      for (const b of theirs) {
        if (!(dots(unit[a], unit[b]) < -0.1)) continue;
        const [height, across] = foot(centre[b], centre[a], unit[a]);
        if (met.has(b) && height < -close[a]) continue;
        if (across >= wide + Math.max(...points[b].map((p) => norm(minus(p, centre[b]))))) continue;
        const sides = d === 2 ? [[-unit[a][1], unit[a][0]]] : points[a].map(
          (p, i) => cross(unit[a], minus(points[a][(i + 1) % 3], p)));
        if (sides.every((s) => {
          const [u, v] = [a, b].map((of) => points[of].map((p) => dots(minus(p, centre[a]), s)));
          return Math.min(Math.max(...u), Math.max(...v)) - Math.max(Math.min(...u), Math.min(...v))
            > Math.min(close[a], close[b]) * norm(s);
        })) refuse("facets in contact do not match the opposite facets");
      }
    }
  }
  body.obstacles.forEach((tag, k) => {
    const towards = exact(body.towards.subarray(k * d, k * d + d)), [c, mu] = body.rubs[1].map((of) => of[k]);
    for (const a of on(tag)) rows.push({ a, b: -1, order: null, normal: towards.v, e: towards.e, c, mu });
  });
  return rows;
}
