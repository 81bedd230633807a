// The programs of the graphics card (WebGL 2).

const VERTEX = `#version 300 es
in vec3 position;
in vec3 motion;
in float value;
uniform float amount;
uniform mat3 turn;       // rows: right, up, towards the eye
uniform vec3 centre;
uniform vec3 stretch;
uniform vec2 range;      // of the values
uniform float nearer;    // of lines, so that triangles do not hide them
out vec3 place;
out vec3 seen;
out vec3 corner;
out float shade;

void main() {
  place = position + amount * motion;
  seen = turn * (place - centre);
  corner = vec3(gl_VertexID % 3 == 0, gl_VertexID % 3 == 1, gl_VertexID % 3 == 2);
  shade = (value - range.x) / (range.y - range.x);
  gl_Position = vec4(seen * stretch - vec3(0.0, 0.0, nearer), 1.0);
}
`;

const FRAGMENT = `#version 300 es
precision highp float;
in vec3 place;
in vec3 seen;
in vec3 corner;
in float shade;
uniform int mode;        // 0 body, 1 field, 2 line
uniform vec3 colour;
uniform sampler2D scale;
uniform vec4 cut;        // normal, place
uniform bool plane;
uniform bool meshed;
uniform float glow;
uniform float ambient;   // least light on a body
uniform bool rimmed;     // whether bodies have a light rim, which sets dark values off from dark paper
uniform vec3 ink;        // of lines of the mesh
uniform bool marked;     // whether values are marks of faces: 1 support, 2 load, 4 chosen, summed
out vec4 pixel;

void main() {
  if (dot(place, cut.xyz) > cut.w) discard;
  if (mode == 2) {
    pixel = vec4(colour, 1.0);
    return;
  }
  vec3 base = mode == 1 ? texture(scale, vec2(clamp(shade, 0.002, 0.998), 0.5)).rgb : colour;
  if (!plane && !gl_FrontFacing) {
    pixel = vec4(0.62, 0.63, 0.65, 1.0);
    return;
  }
  float light = 1.0;
  float rim = 0.0;
  if (!plane) {
    vec3 normal = normalize(cross(dFdx(seen), dFdy(seen)));
    light = mix(ambient, 1.0, max(dot(normal, normalize(vec3(-0.35, 0.55, 0.75))), 0.0));
    if (rimmed) rim = 0.6 * smoothstep(0.2, 0.0, normal.z);
  }
  if (meshed) {
    vec3 distance = corner / fwidth(corner);
    float edge = min(min(distance.x, distance.y), distance.z);
    base = mix(ink, base, 0.6 + 0.4 * smoothstep(0.2, 1.2, edge));
  }
  int mark = marked && mode == 0 ? int(shade + 0.5) : 0;
  if ((mark & 1) != 0) base = mix(base, vec3(0.5, 0.66, 1.0), 0.85);
  if ((mark & 2) != 0) base = mix(base, vec3(1.0, 0.6, 0.55), (mark & 1) != 0 ? 0.5 : 0.85);
  if ((mark & 4) != 0) base = mix(base, vec3(0.65, 1.0, 0.1), 0.85);
  pixel = vec4(mix(mix(base * light, vec3(0.8), rim), vec3(1.0, 0.85, 0.4), glow), 1.0);
}
`;

/** Compile and link the program. */
function makeProgram(gl) {
  const program = gl.createProgram();
  for (const [kind, source] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) {
      throw new Error(gl.getShaderInfoLog(shader));
    }
    gl.attachShader(program, shader);
  }
  ["position", "motion", "value"].forEach((name, i) => gl.bindAttribLocation(program, i, name));
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS)) {
    throw new Error(gl.getProgramInfoLog(program));
  }
  return program;
}
