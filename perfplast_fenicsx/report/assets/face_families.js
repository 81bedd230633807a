// Free faces that belong together: round faces with one radius, and faces that continue each other.

/** The kind and radius of a round face, such as "bore, R 5"; "" for other faces. */
const roundness = ({ round }) => (round ?? "").split(", along")[0];

/** Families of at least two round faces with the kind and radius of a given face: [words, faces]. */
function roundFamilies(faces, given) {
  const kinds = new Set(given.map(roundness).filter(Boolean));
  return [...kinds].map((kind) => [kind, faces.filter((face) => roundness(face) === kind)])
    .filter(([, alike]) => alike.length > 1);
}

/** The largest angle (degrees) between two faces along their common edge: {face: {neighbour: angle}}. */
function anglesAtEdges({ points, triangles, faces }) {
  const count = points.length / 3;
  const corner = (k) => [0, 1, 2].map((i) => points[3 * triangles[k] + i]);
  const normals = Array.from({ length: triangles.length / 3 }, (_, t) => {
    const [a, b, c] = [0, 1, 2].map((k) => corner(3 * t + k));
    return unit(cross(plus(b, a, -1), plus(c, a, -1)));
  });
  const first = new Map(); // the triangles at each edge
  const angles = {};
  for (let t = 0; t < normals.length; t++) {
    for (let k = 0; k < 3; k++) {
      const [a, b] = [triangles[3 * t + k], triangles[3 * t + ((k + 1) % 3)]];
      const edge = Math.min(a, b) * count + Math.max(a, b);
      const others = first.get(edge) ?? [];
      for (const other of others.filter((one) => faces[one] !== faces[t])) {
        const cosine = normals[t].reduce((sum, x, i) => sum + x * normals[other][i], 0);
        const angle = (180 / Math.PI) * Math.acos(Math.min(1, Math.max(-1, cosine)));
        for (const [one, two] of [[faces[t], faces[other]], [faces[other], faces[t]]]) {
          const around = (angles[one] ??= {});
          around[two] = Math.max(around[two] ?? 0, angle);
        }
      }
      first.set(edge, [...others, t]);
    }
  }
  return angles;
}

/** The free faces of one body that are reached from given faces over edges with at most an angle. */
function continued(faces, given, angles, most) {
  const byNumber = new Map(faces.map((face) => [face.number, face]));
  const found = new Set(given);
  for (const face of found) {
    for (const [number, angle] of Object.entries(angles[face.number] ?? {})) {
      const next = byNumber.get(Number(number));
      if (next && next.body === face.body && angle <= most) found.add(next);
    }
  }
  return [...found];
}
