// Programs and buffers of WebGL 2.

const LIT_VERTEX = `#version 300 es
uniform mat4 u_view, u_model;
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
layout(location = 2) in vec3 colour;
layout(location = 3) in float around;
out vec3 v_position, v_normal, v_colour;
out float v_around;
void main() {
  vec4 world = u_model * vec4(position, 1.0);
  v_position = world.xyz;
  v_normal = mat3(u_model) * normal;
  v_colour = colour;
  v_around = around;
  gl_Position = u_view * world;
}`;

// A lamp above the reader's shoulder, light of the sky from above and of the floor from below, and a small gloss.
const LIT_FRAGMENT = `#version 300 es
precision highp float;
uniform vec3 u_eye, u_lamp, u_tint, u_stripe;
uniform float u_plain;
in vec3 v_position, v_normal, v_colour;
in float v_around;
out vec4 colour;
void main() {
  vec3 base = v_colour * u_tint;
  if (v_around >= 0.0) {
    float edge = max(fwidth(v_around), 1e-4);
    base = mix(u_stripe, base, smoothstep(0.09 - edge, 0.09 + edge, abs(v_around - 0.5)));
  }
  vec3 n = normalize(v_normal);
  if (!gl_FrontFacing) { n = -n; base *= 0.8; }
  vec3 to_eye = normalize(u_eye - v_position);
  float lamp = max(dot(n, u_lamp), 0.0);
  float sky = 0.5 + 0.5 * n.z;
  float gloss = pow(max(dot(n, normalize(u_lamp + to_eye)), 0.0), 36.0);
  vec3 light = vec3(0.36) + sky * vec3(0.20, 0.22, 0.25) + lamp * vec3(0.50, 0.48, 0.45) + 0.1 * max(dot(n, to_eye), 0.0);
  light = mix(light, vec3(0.95), u_plain);
  colour = vec4(base * light + 0.14 * (1.0 - u_plain) * gloss, 1.0);
}`;

/** Planes that end each other, so many of them. */
const MOST_PLANES = 4;
const WITHIN = `
uniform vec4 u_others[${MOST_PLANES}];
bool within(vec3 p) {
  for (int k = 0; k < ${MOST_PLANES}; k++) if (dot(u_others[k].xyz, p) < u_others[k].w) return false;
  return true;
}`;

// Everything that lies in the lamp's way, laid flat onto a plane n·x = u_plane.w.
const SHADOW_VERTEX = `#version 300 es
uniform mat4 u_view, u_model;
uniform vec4 u_plane;
uniform vec3 u_lamp;
layout(location = 0) in vec3 position;
out float v_height;
out vec3 v_position;
void main() {
  vec3 world = (u_model * vec4(position, 1.0)).xyz;
  v_height = dot(u_plane.xyz, world) - u_plane.w;
  v_position = world - u_lamp * v_height / max(dot(u_plane.xyz, u_lamp), 0.05);
  gl_Position = u_view * vec4(v_position, 1.0);
}`;

const SHADOW_FRAGMENT = `#version 300 es
precision highp float;
uniform vec4 u_colour;
uniform vec3 u_middle;
uniform float u_reach, u_below;
in float v_height;
in vec3 v_position;
out vec4 colour;
${WITHIN}
void main() {
  if (v_height < u_below || !within(v_position)) discard;
  colour = vec4(u_colour.rgb, u_colour.a * (1.0 - smoothstep(0.4 * u_reach, u_reach, distance(v_position, u_middle))));
}`;

const PLANE_VERTEX = `#version 300 es
uniform mat4 u_view;
uniform vec3 u_middle, u_along, u_across;
uniform float u_reach;
layout(location = 0) in vec3 position;
out vec2 v_place;
out vec3 v_position;
void main() {
  v_place = position.xy * u_reach;
  v_position = u_middle + u_along * v_place.x + u_across * v_place.y;
  gl_Position = u_view * vec4(v_position, 1.0);
}`;

// Lines at multiples of the spacing, every fifth one stronger; they fade where they become finer than pixels, and outwards.
const PLANE_FRAGMENT = `#version 300 es
precision highp float;
uniform vec4 u_fill, u_line;
uniform vec2 u_shift;
uniform float u_reach, u_spacing;
in vec2 v_place;
in vec3 v_position;
out vec4 colour;
${WITHIN}
float lines(float spacing) {
  vec2 at = (v_place + u_shift) / spacing;
  vec2 wide = fwidth(at);
  vec2 near = abs(fract(at - 0.5) - 0.5) / max(wide, vec2(1e-6));
  vec2 line = (1.0 - clamp(near - 0.15, 0.0, 1.0)) * (1.0 - smoothstep(0.2, 0.6, wide));
  return max(line.x, line.y);
}
void main() {
  if (!within(v_position)) discard;
  float fade = 1.0 - smoothstep(0.35 * u_reach, u_reach, length(v_place));
  float line = max(0.45 * lines(u_spacing), lines(5.0 * u_spacing)) * u_line.a;
  float alpha = line + u_fill.a * (1.0 - line);
  vec3 mixed = mix(u_fill.rgb, u_line.rgb, alpha > 0.0 ? line / alpha : 0.0);
  colour = vec4(mixed, alpha * fade);
}`;

const LINE_VERTEX = `#version 300 es
uniform mat4 u_view, u_model;
layout(location = 0) in vec3 position;
void main() {
  gl_Position = u_view * u_model * vec4(position, 1.0);
  gl_Position.z -= 2e-4 * gl_Position.w;
}`;

const LINE_FRAGMENT = `#version 300 es
precision highp float;
uniform vec4 u_colour;
out vec4 colour;
void main() { colour = u_colour; }`;

/** A linked program; calling `use` with uniforms sets them: numbers, arrays of 2 to 4, or matrices of 16. */
class Program {
  constructor(gl, vertex, fragment) {
    this.gl = gl;
    this.program = gl.createProgram();
    for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(this.program, shader);
    }
    gl.linkProgram(this.program);
    if (!gl.getProgramParameter(this.program, gl.LINK_STATUS)) {
      const logs = gl.getAttachedShaders(this.program).map((shader) => gl.getShaderInfoLog(shader));
      throw new Error(`a shader was refused: ${[gl.getProgramInfoLog(this.program), ...logs].join(" ")}`);
    }
    this.places = new Map();
  }

  use(uniforms) {
    this.gl.useProgram(this.program);
    for (const [name, value] of Object.entries(uniforms)) this.set(name, value);
  }

  set(name, value) {
    if (!this.places.has(name)) this.places.set(name, this.gl.getUniformLocation(this.program, name));
    const place = this.places.get(name);
    if (name === "u_others") this.gl.uniform4fv(place, value);
    else if (typeof value === "number") this.gl.uniform1f(place, value);
    else if (value.length === 16) this.gl.uniformMatrix4fv(place, false, value);
    else this.gl[`uniform${value.length}fv`](place, value);
  }
}

/** Triangles on the GPU. */
class Geometry {
  constructor(gl) {
    this.gl = gl;
    this.array = gl.createVertexArray();
    [this.vertices, this.indices] = [gl.createBuffer(), gl.createBuffer()];
    gl.bindVertexArray(this.array);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.vertices);
    [3, 3, 3, 1].reduce((offset, size, place) => {
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, size, gl.FLOAT, false, 4 * VERTEX, 4 * offset);
      return offset + size;
    }, 0);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, this.indices);
    gl.bindVertexArray(null);
    this.count = 0;
  }

  load({ vertices, indices }) {
    const gl = this.gl;
    gl.bindVertexArray(this.array);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.vertices);
    gl.bufferData(gl.ARRAY_BUFFER, vertices, gl.DYNAMIC_DRAW);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, indices, gl.DYNAMIC_DRAW);
    this.count = indices.length;
    return this;
  }

  draw() {
    if (this.count === 0) return;
    this.gl.bindVertexArray(this.array);
    this.gl.drawElements(this.gl.TRIANGLES, this.count, this.gl.UNSIGNED_INT, 0);
  }
}

/** Line segments on the GPU, by their end points. */
class Lines {
  constructor(gl) {
    this.gl = gl;
    this.array = gl.createVertexArray();
    this.points = gl.createBuffer();
    gl.bindVertexArray(this.array);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.points);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
    gl.bindVertexArray(null);
    this.count = 0;
  }

  load(points) {
    const gl = this.gl;
    gl.bindVertexArray(this.array);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.points);
    gl.bufferData(gl.ARRAY_BUFFER, points, gl.DYNAMIC_DRAW);
    this.count = points.length / 3;
    return this;
  }

  draw() {
    if (this.count === 0) return;
    this.gl.bindVertexArray(this.array);
    this.gl.drawArrays(this.gl.LINES, 0, this.count);
  }
}
