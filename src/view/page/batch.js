// Triangles that are made anew for every picture.

/** Numbers of a vertex: position, normal, colour, and the turn about a tube's axis [turns], or −1. */
const VERTEX = 10;

/** Vertices and triangles in arrays that grow. */
class Batch {
  constructor() {
    this.vertices = new Float32Array(1 << 14);
    this.indices = new Uint32Array(1 << 14);
    this.clear();
  }

  clear() {
    this.nVertices = 0;
    this.nIndices = 0;
  }

  /** Appends a vertex and returns its number. */
  vertex(position, normal, colour, around = -1) {
    const at = this.nVertices * VERTEX;
    if (at + VERTEX > this.vertices.length) this.vertices = grown(this.vertices);
    const { vertices } = this;
    for (let k = 0; k < 3; k++) {
      vertices[at + k] = position[k];
      vertices[at + 3 + k] = normal[k];
      vertices[at + 6 + k] = colour[k];
    }
    vertices[at + 9] = around;
    return this.nVertices++;
  }

  triangle(a, b, c) {
    if (this.nIndices + 3 > this.indices.length) this.indices = grown(this.indices);
    this.indices[this.nIndices++] = a;
    this.indices[this.nIndices++] = b;
    this.indices[this.nIndices++] = c;
  }

  /** Two triangles: a, b, c, d counterclockwise as seen from outside. */
  quad(a, b, c, d) {
    this.triangle(a, b, c);
    this.triangle(a, c, d);
  }

  /** What there is, for the GPU. */
  data() {
    return {
      vertices: this.vertices.subarray(0, this.nVertices * VERTEX),
      indices: this.indices.subarray(0, this.nIndices),
    };
  }
}

function grown(array) {
  const out = new array.constructor(2 * array.length);
  out.set(array);
  return out;
}
