// Shapes as triangles, about their own origins.

const SEGMENTS = 32;
/** How much darker every second quarter of something round is, so that one sees it turn. */
const PAINT = 0.82;

/** A surface of revolution about z: `profile` lists [r, z, normal's r, normal's z] from the bottom up, in strips. */
function revolved(batch, strips, painted) {
  for (const profile of strips) {
    for (let j = 0; j < SEGMENTS; j++) {
      const angles = [j, j + 1].map((k) => (2 * Math.PI * k) / SEGMENTS);
      for (let i = 0; i + 1 < profile.length; i++) {
        const quarter = Math.floor((4 * j) / SEGMENTS) + (profile[i][1] + profile[i + 1][1] < 0 ? 1 : 0);
        const tone = painted && quarter % 2 === 1 ? PAINT : 1;
        const corner = ([r, z, nr, nz], angle) => {
          const [c, s] = [Math.cos(angle), Math.sin(angle)];
          return batch.vertex([r * c, r * s, z], [nr * c, nr * s, nz], [tone, tone, tone]);
        };
        const [low, high] = [profile[i], profile[i + 1]];
        batch.quad(corner(low, angles[0]), corner(low, angles[1]), corner(high, angles[1]), corner(high, angles[0]));
      }
    }
  }
}

/** The profile of a half ball at height z, the upper one for sign 1. */
function dome(radius, z, sign) {
  const steps = 10;
  const at = (k) => {
    const angle = (0.5 * Math.PI * k) / steps;
    const [c, s] = [Math.cos(angle), sign * Math.sin(angle)];
    return [radius * c, z + radius * s, c, s];
  };
  const points = Array.from({ length: steps + 1 }, (_, k) => at(k));
  return sign > 0 ? points : points.reverse();
}

function addBlock(batch, [a, b, c]) {
  for (let axis = 0; axis < 3; axis++) {
    for (const sign of [-1, 1]) {
      const corner = (u, v) => {
        const [position, normal] = [[0, 0, 0], [0, 0, 0]];
        normal[axis] = sign;
        position[axis] = sign;
        position[(axis + 1) % 3] = u * sign;
        position[(axis + 2) % 3] = v;
        return batch.vertex([position[0] * a, position[1] * b, position[2] * c], normal, [1, 1, 1]);
      };
      batch.quad(corner(-1, -1), corner(1, -1), corner(1, 1), corner(-1, 1));
    }
  }
}

/** The unit normal of a triangle of a hull. */
function hullNormal({ corners }, [a, b, c]) {
  return unit(cross(minus(corners[b], corners[a]), minus(corners[c], corners[a])));
}

function addHull(batch, hull) {
  for (const triangle of hull.triangles) {
    const normal = hullNormal(hull, triangle);
    batch.triangle(...triangle.map((k) => batch.vertex(hull.corners[k], normal, [1, 1, 1])));
  }
}

/** The triangles of a shape of the header; none for a plane. */
function solidMesh({ form, sizes, body, hull }) {
  const batch = new Batch();
  const painted = body !== null;
  const [radius, half = 0] = sizes;
  const wall = [[radius, -half, 1, 0], [radius, 0, 1, 0], [radius, half, 1, 0]];
  if (form === "ball" || form === "capsule") revolved(batch, [[...dome(radius, -half, -1)], wall, dome(radius, half, 1)], painted);
  if (form === "cylinder") {
    const bottom = [[0, -half, 0, -1], [radius, -half, 0, -1]];
    const top = [[radius, half, 0, 1], [0, half, 0, 1]];
    revolved(batch, [bottom, wall, top], painted);
  }
  if (form === "block") addBlock(batch, sizes);
  if (form === "hull") addHull(batch, hull);
  return batch.data();
}

/** The edges of a block, as pairs of points. */
function blockEdges([a, b, c]) {
  const out = [];
  for (let axis = 0; axis < 3; axis++) {
    for (const [u, v] of [[-1, -1], [-1, 1], [1, -1], [1, 1]]) {
      for (const end of [-1, 1]) {
        const p = [0, 0, 0];
        p[axis] = end;
        p[(axis + 1) % 3] = u;
        p[(axis + 2) % 3] = v;
        out.push(p[0] * a, p[1] * b, p[2] * c);
      }
    }
  }
  return out;
}

/** The edges of a hull, as pairs of points; none within a flat side. */
function hullEdges(hull) {
  const sides = new Map();
  for (const triangle of hull.triangles) {
    const [a, b, c] = triangle;
    for (const [i, j] of [[a, b], [b, c], [c, a]]) sides.set(`${i} ${j}`, hullNormal(hull, triangle));
  }
  const out = [];
  for (const [side, normal] of sides) {
    const [i, j] = side.split(" ").map(Number);
    const other = sides.get(`${j} ${i}`);
    if (i < j && !(other && dot(normal, other) > 1 - 1e-6)) out.push(...hull.corners[i], ...hull.corners[j]);
  }
  return out;
}

/** What tells the faces of a shape apart in a flat light. */
function solidEdges({ form, sizes, hull }) {
  if (form === "hull") return hullEdges(hull);
  return form === "block" ? blockEdges(sizes) : [];
}

/** A small octahedron: what marks a node that is held. */
function addMarker(batch, at, size, colour) {
  for (const x of [-1, 1]) {
    for (const y of [-1, 1]) {
      for (const z of [-1, 1]) {
        const n = unit([x, y, z]);
        const corner = (k) => {
          const p = [...at];
          p[k] += size * [x, y, z][k];
          return batch.vertex(p, n, colour);
        };
        if (x * y * z > 0) batch.triangle(corner(0), corner(1), corner(2));
        else batch.triangle(corner(0), corner(2), corner(1));
      }
    }
  }
}
