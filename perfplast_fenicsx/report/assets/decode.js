// Read the packed arrays of the page; packing.py describes how they are packed.

const TYPES = { uint8: Uint8Array, uint16: Uint16Array, uint32: Uint32Array };

/** The whole numbers of a packed array. */
async function integers(packed) {
  const text = atob(packed.data);
  const deflated = Uint8Array.from(text, (letter) => letter.charCodeAt(0));
  const stream = new Blob([deflated]).stream().pipeThrough(new DecompressionStream("deflate"));
  const byPlace = new Uint8Array(await new Response(stream).arrayBuffer());
  const Type = TYPES[packed.type];
  const width = Type.BYTES_PER_ELEMENT;
  const count = byPlace.length / width;
  const values = new Type(count);
  let factor = 1;
  for (let place = 0; place < width; place++, factor *= 256) {
    for (let i = 0; i < count; i++) values[i] += byPlace[place * count + i] * factor;
  }
  return values;
}

/** The quantised numbers of a packed array. */
async function numbers(packed) {
  const { low, step } = packed;
  return Float32Array.from(await integers(packed), (value) => low + step * value);
}

/** Join three arrays of coordinates to one array of points. */
async function vectors(axes) {
  const [x, y, z] = await Promise.all(axes.map(numbers));
  const points = new Float32Array(3 * x.length);
  for (let i = 0; i < x.length; i++) points.set([x[i], y[i], z[i]], 3 * i);
  return points;
}

/** Rows of `values`, each of `width` numbers, in the order of `rows`. */
function gathered(values, rows, width) {
  const found = new Float32Array(rows.length * width);
  for (let i = 0; i < rows.length; i++) {
    for (let k = 0; k < width; k++) found[i * width + k] = values[rows[i] * width + k];
  }
  return found;
}
