// Colours of fields and of bodies; colour-blind readers can distinguish both.

/** Viridis, from low to high, as [red, green, blue] of 255. */
const SCALE = [
  [68, 1, 84], [72, 36, 117], [65, 68, 135], [53, 95, 141], [42, 120, 142], [33, 145, 140],
  [34, 168, 132], [68, 191, 112], [122, 209, 81], [189, 223, 38], [253, 231, 37],
];

/** Okabe and Ito's, lightened. */
const BODIES = [
  [120, 178, 214], [230, 178, 90], [110, 190, 160], [214, 150, 186], [222, 140, 100],
  [150, 150, 200], [190, 190, 110], [150, 160, 170],
];

const WHITE = [255, 255, 255];
const DARK = [22, 25, 29]; // --paper of page.css in dark colours
const DIM = 0.55; // least light on a body
const DIM_ON_DARK = 0.68; // the same on dark paper

/** A colour of lines (parts of 1) as it is drawn on dark paper, beside the bodies. */
const onDark = (colour) => colour.map((part) => 0.6 + 0.4 * (part / Math.max(...colour)));

const css = (colour) => `rgb(${colour.join(" ")})`;

/** The scale as 256 pixels. */
function scalePixels() {
  const pixels = new Uint8Array(4 * 256);
  for (let i = 0; i < 256; i++) {
    const at = (i / 255) * (SCALE.length - 1);
    const below = Math.min(Math.floor(at), SCALE.length - 2);
    const mixed = SCALE[below].map((a, k) => a + (at - below) * (SCALE[below + 1][k] - a));
    pixels.set([...mixed.map(Math.round), 255], 4 * i);
  }
  return pixels;
}

/** The scale as a background. */
const scaleGradient = () => `linear-gradient(to right, ${SCALE.map(css).join(", ")})`;

const bodyColour = (body) => BODIES[body % BODIES.length];

/** A number in a few digits. */
function short(value) {
  const size = Math.abs(value);
  if (size > 0 && (size < 1e-3 || size >= 1e5)) return value.toExponential(2);
  return String(Number(value.toPrecision(4)));
}
