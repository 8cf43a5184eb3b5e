// The things drawn: made from the header once, and from the numbers at every frame.

/** Colours of ropes, cloths and bodies, one after the other. */
const PALETTE = ["#2f7fd1", "#e08a1e", "#3d9a5f", "#b5518f", "#7a6bd1", "#c2543d", "#1f9aa0", "#8f7a2e"];
/** Least thickness of a rope on the screen [pixels]. */
const THINNEST = 3.6;
const LAMP = unit([0.35, -0.3, 0.9]);

const rgb = (text) => [1, 3, 5].map((k) => parseInt(text.slice(k, k + 2), 16) / 255);

/** From blue by grey to red, for −1 … 1. */
function diverging(x) {
  const s = clamp(x, -1, 1);
  const middle = [0.66, 0.68, 0.7];
  return mix(middle, s < 0 ? [0.13, 0.4, 0.75] : [0.8, 0.2, 0.16], Math.abs(s) ** 0.8);
}

/** The colours of the page's style that the renderer needs. */
function pageColours() {
  const style = getComputedStyle(document.documentElement);
  const names = ["sky", "grid", "plane", "fixed", "held", "stripe", "shadow"];
  const colours = Object.fromEntries(names.map((name) => [name, rgb(style.getPropertyValue(`--${name}`).trim())]));
  // a shadow on something dark has to be deeper to be seen
  return { ...colours, depth: colours.sky[1] > 0.5 ? 0.2 : 0.5 };
}

/** A colour for each body: bodies that hang on each other share one, and neighbours differ in tone. */
function treeColours(parents, first) {
  const trees = [];
  let roots = 0;
  parents.forEach((parent, body) => {
    const { root, depth } = parent === null ? { root: roots++, depth: 0 } : { ...trees[parent], depth: trees[parent].depth + 1 };
    trees[body] = { root, depth };
  });
  return trees.map(({ root, depth }) => mix(rgb(PALETTE[(first + root) % PALETTE.length]), [1, 1, 1], [0, 0.34, 0.17][depth % 3]));
}

class Stage {
  constructor(gl, { header, slice }) {
    this.gl = gl;
    this.header = header;
    this.colours = pageColours();
    this.byScale = false;
    const frames = header.time.length;
    const rows = (place) => (place ? new Rows(slice(place), frames) : null);
    const moving = (thing) => ({ ...thing, positions: rows(thing.positions), colour: rows(thing.colour), director: rows(thing.director) });
    this.ropes = header.ropes.map(moving);
    this.meshes = header.meshes.map(moving);
    this.poses = rows(header.poses);
    this.tips = header.points.map(rows);
    this.solids = header.solids.filter((solid) => solid.form !== "plane");
    this.bodyColours = treeColours(header.parents, this.ropes.length + this.meshes.length);
    this.measure(frames);
    this.planes = this.listPlanes();
    this.programs = {
      lit: new Program(gl, LIT_VERTEX, LIT_FRAGMENT),
      shadow: new Program(gl, SHADOW_VERTEX, SHADOW_FRAGMENT),
      plane: new Program(gl, PLANE_VERTEX, PLANE_FRAGMENT),
      line: new Program(gl, LINE_VERTEX, LINE_FRAGMENT),
    };
    this.shapes = this.solids.map((solid) => new Geometry(gl).load(solidMesh(solid)));
    this.outlines = this.solids.map((solid) => new Lines(gl).load(new Float32Array(solidEdges(solid))));
    this.soft = new Batch();
    this.softShape = new Geometry(gl);
    this.wires = this.meshes.map((mesh) => ({ pairs: meshEdges(mesh.triangles), lines: new Lines(gl) }));
    this.square = new Geometry(gl).load(squareMesh());
  }

  /** Points of everything over all frames (a sample), its size, and its lowest height [m]. */
  measure(frames) {
    const points = [];
    const every = Math.max(1, Math.ceil(frames / 40));
    for (let frame = 0; frame < frames; frame = frame < frames - 1 ? Math.min(frame + every, frames - 1) : frames) {
      for (const thing of [...this.ropes, ...this.meshes]) {
        const row = thing.positions.at(frame);
        const stride = Math.max(1, Math.ceil(thing.nodes / 64));
        for (let i = 0; i < thing.nodes; i = i < thing.nodes - 1 ? Math.min(i + stride, thing.nodes - 1) : thing.nodes) {
          points.push([row[3 * i], row[3 * i + 1], row[3 * i + 2]]);
        }
      }
      for (const solid of this.solids) if (solid.body !== null) points.push(...corners(solid, this.poseOf(solid, frame)));
      for (const bone of this.header.bones) points.push(...this.boneEnds(bone, frame));
      for (const rows of this.tips) points.push([...rows.at(frame)]);
    }
    const moving = points.length;
    const reach = Math.max(0, ...points.map(norm));
    for (const solid of this.solids.filter((s) => s.body === null)) {
      // a fixed shape much larger than what moves would hide it
      const own = corners(solid, solid);
      if (moving === 0 || own.every((p) => norm(p) < 3 * reach)) points.push(...own);
    }
    this.points = points;
    this.size = Math.max(1e-9, ...points.map(norm)) || 1;
    this.lowest = points.reduce((low, p) => Math.min(low, p[2]), Infinity);
    if (!Number.isFinite(this.lowest)) this.lowest = 0;
    this.thickest = Math.max(0, ...this.ropes.map((rope) => rope.radius));
  }

  /** Planes of the scene, or a grid below everything. */
  listPlanes() {
    const { center, solids } = this.header;
    const spacing = roundLength(this.size / 3);
    const plane = (point, normal, filled) => {
      const along = Math.abs(normal[2]) > 0.99 ? unit(minus([1, 0, 0], times(normal, normal[0]))) : unit(cross([0, 0, 1], normal));
      const side = cross(normal, along);
      const height = dot(point, normal);
      const shift = [along, side].map((axis) => dot(center, axis) % (5 * spacing));
      return { normal, along, side, height, shift, middle: times(normal, height), filled };
    };
    const own = solids.filter((solid) => solid.form === "plane").map((solid) => plane(solid.position, axes(solid.quaternion)[2], true));
    this.spacing = spacing;
    return own.length > 0 ? own : [plane([0, 0, this.lowest - this.thickest - 0.02 * this.size], [0, 0, 1], false)];
  }

  /** Pose of a body. */
  pose(body, frame) {
    const row = this.poses.at(frame).slice(7 * body, 7 * body + 7);
    const q = [...row.slice(3)];
    const length = Math.hypot(...q) || 1;
    return { position: [...row.slice(0, 3)], quaternion: q.map((x) => x / length) };
  }

  poseOf(solid, frame) {
    return solid.body === null ? solid : composed(this.pose(solid.body, frame), solid);
  }

  boneEnds({ body, to }, frame) {
    const { position, quaternion } = this.pose(body, frame);
    return [position, add(position, turned(quaternion, to))];
  }

  /** Makes the triangles of what bends, for a screen whose pixels are `pixel` large [m]. */
  shape(frame, pixel) {
    const batch = this.soft;
    const thin = 0.5 * THINNEST * pixel;
    batch.clear();
    const total = this.ropes.reduce((sum, rope) => sum + rope.nodes, 0);
    const most = total > 3000 ? 6 : total > 600 ? 10 : 18;
    this.ropes.forEach((rope, k) => {
      const row = rope.positions.at(frame);
      const radius = Math.max(rope.radius, thin);
      // as round as can be seen
      const sides = clamp(Math.round(4 * Math.sqrt(radius / pixel)), 6, most);
      const director = rope.director ? rope.director.at(frame) : null;
      addTube(batch, row, rope.nodes, radius, sides, this.colouring(rope, k, frame), director);
      for (const i of rope.held) {
        addMarker(batch, [row[3 * i], row[3 * i + 1], row[3 * i + 2]], Math.max(1.7 * radius, 4 * pixel), this.colours.held);
      }
    });
    for (const rows of this.tips) addMarker(batch, [...rows.at(frame)], Math.max(0.012 * this.size, 4 * pixel), this.colours.held);
    for (const bone of this.header.bones) this.addBone(batch, bone, frame, Math.max(0.008 * this.size, thin));
    this.meshes.forEach((mesh, k) => this.addMesh(batch, mesh, this.ropes.length + k, frame, pixel));
    this.softShape.load(batch.data());
    this.meshes.forEach((mesh, k) => {
      const row = mesh.positions.at(frame);
      const { pairs, lines } = this.wires[k];
      lines.load(Float32Array.from({ length: 3 * pairs.length }, (_, j) => row[3 * pairs[Math.floor(j / 3)] + (j % 3)]));
    });
  }

  /** Colour by edge or node: the thing's own, or that of the scale. */
  colouring(thing, k, frame) {
    const { scale } = this.header;
    if (!this.byScale || !thing.colour || !scale) {
      const own = rgb(PALETTE[k % PALETTE.length]);
      return () => own;
    }
    const values = thing.colour.at(frame).slice();
    return (i) => diverging(values[i] / (scale.most || 1));
  }

  addBone(batch, bone, frame, radius) {
    const [from, to] = this.boneEnds(bone, frame);
    const colour = this.bodyColours[bone.body];
    const flat = [...from, ...to];
    if (bone.mass) addMarker(batch, to, 2.2 * radius, colour);
    else addTube(batch, flat, 2, radius, 12, () => colour, null);
    if (bone.mass) addTube(batch, flat, 2, 0.5 * radius, 8, () => colour, null);
  }

  addMesh(batch, mesh, k, frame, pixel) {
    const row = mesh.positions.at(frame);
    const point = (i) => [row[3 * i], row[3 * i + 1], row[3 * i + 2]];
    const normals = Array.from({ length: mesh.nodes }, () => [0, 0, 0]);
    for (const [a, b, c] of mesh.triangles) {
      const n = cross(minus(point(b), point(a)), minus(point(c), point(a)));
      for (const i of [a, b, c]) normals[i] = add(normals[i], n);
    }
    const colourOf = this.colouring(mesh, k, frame);
    const first = batch.nVertices;
    for (let i = 0; i < mesh.nodes; i++) batch.vertex(point(i), unit(normals[i]), colourOf(i));
    for (const [a, b, c] of mesh.triangles) batch.triangle(first + a, first + b, first + c);
    for (const i of mesh.held) addMarker(batch, point(i), 5 * pixel, this.colours.held);
  }

  /** Draws a frame. */
  draw(frame, camera, height) {
    const gl = this.gl;
    const view = camera.matrix(40 * this.size);
    const eye = camera.eye();
    this.shape(frame, camera.pixel(height));
    const models = this.solids.map((solid) => poseMatrix(this.poseOf(solid, frame)));
    gl.clearColor(...this.colours.sky, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT | gl.STENCIL_BUFFER_BIT);
    gl.enable(gl.DEPTH_TEST);
    gl.depthMask(true);
    gl.disable(gl.BLEND);
    this.programs.lit.use({ u_view: view, u_eye: eye, u_lamp: LAMP, u_stripe: this.colours.stripe, u_plain: 0 });
    this.solids.forEach((solid, k) => {
      this.programs.lit.set("u_model", models[k]);
      this.programs.lit.set("u_tint", solid.body === null ? this.colours.fixed : this.bodyColours[solid.body]);
      this.shapes[k].draw();
    });
    this.programs.lit.set("u_model", IDENTITY);
    this.programs.lit.set("u_tint", [1, 1, 1]);
    // colours that are to be read are shaded less
    this.programs.lit.set("u_plain", this.byScale ? 0.6 : 0);
    this.softShape.draw();
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    gl.depthMask(false);
    this.programs.line.use({ u_view: view, u_model: IDENTITY, u_colour: [...this.colours.shadow, 0.2] });
    for (const { lines } of this.wires) lines.draw();
    this.outlines.forEach((lines, k) => {
      this.programs.line.set("u_model", models[k]);
      lines.draw();
    });
    for (const plane of this.planes) this.drawPlane(plane, view, models, camera);
  }

  /** A plane, its grid, and the shadows on it. */
  drawPlane(plane, view, models, camera) {
    const gl = this.gl;
    const reach = 4 * this.size;
    const seenFrom = dot(camera.eye(), plane.normal) - plane.height;
    const others = new Float32Array(4 * MOST_PLANES);
    const ends = this.planes.filter((other) => other !== plane).slice(0, MOST_PLANES);
    ends.forEach(({ normal, height }, k) => others.set([...normal, height - 1e-6 * this.size], 4 * k));
    this.programs.plane.use({
      u_view: view, u_others: others, u_middle: plane.middle, u_along: plane.along, u_across: plane.side, u_reach: reach,
      u_shift: plane.shift, u_spacing: this.spacing,
      u_fill: [...this.colours.plane, plane.filled ? (seenFrom > 0 ? 0.75 : 0.3) : 0],
      u_line: [...this.colours.grid, 0.75],
    });
    this.square.draw();
    if (seenFrom <= 0) return;
    // each pixel is darkened once, however many triangles shade it
    gl.enable(gl.STENCIL_TEST);
    gl.clear(gl.STENCIL_BUFFER_BIT);
    gl.stencilFunc(gl.EQUAL, 0, 255);
    gl.stencilOp(gl.KEEP, gl.KEEP, gl.INCR);
    const lift = 1e-4 * this.size;
    this.programs.shadow.use({
      u_view: view, u_others: others, u_lamp: LAMP, u_plane: [...plane.normal, plane.height + lift], u_below: -2 * lift,
      u_middle: plane.middle, u_reach: reach, u_colour: [...this.colours.shadow, this.colours.depth * (plane.filled ? 1 : 0.6)], u_model: IDENTITY,
    });
    this.softShape.draw();
    models.forEach((model, k) => {
      this.programs.shadow.set("u_model", model);
      this.shapes[k].draw();
    });
    gl.disable(gl.STENCIL_TEST);
  }
}

/** Corners of a hull, or of a box around a shape. */
function corners({ form, sizes, hull }, { position, quaternion }) {
  if (hull) return hull.corners.map((corner) => add(position, turned(quaternion, corner)));
  const [a, b = 0, c = 0] = sizes;
  const half = { ball: [a, a, a], capsule: [a, a, a + b], cylinder: [a, a, b], block: [a, b, c] }[form];
  const signs = [-1, 1].flatMap((x) => [-1, 1].flatMap((y) => [-1, 1].map((z) => [x, y, z])));
  return signs.map((s) => add(position, turned(quaternion, [s[0] * half[0], s[1] * half[1], s[2] * half[2]])));
}

/** End points of all edges of triangles, each edge once. */
function meshEdges(triangles) {
  const seen = new Map();
  for (const [a, b, c] of triangles) {
    for (const [i, j] of [[a, b], [b, c], [c, a]]) seen.set(`${Math.min(i, j)} ${Math.max(i, j)}`, [i, j]);
  }
  return [...seen.values()].flat();
}

function squareMesh() {
  const batch = new Batch();
  const corner = (x, y) => batch.vertex([x, y, 0], [0, 0, 1], [1, 1, 1]);
  batch.quad(corner(-1, -1), corner(1, -1), corner(1, 1), corner(-1, 1));
  return batch.data();
}

/** The largest of 1, 2, 5 times a power of ten that is not above x. */
function roundLength(x) {
  const power = 10 ** Math.floor(Math.log10(x) + 1e-9);
  return power * ([5, 2].find((k) => k * power <= x * (1 + 1e-9)) ?? 1);
}
