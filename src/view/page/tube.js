// A rope as a tube: one straight piece per edge, cut off at each node by the plane between its two edges. Where the directors of two
// edges differ by a twist, each edge takes half of it on its own half, so that the stripe has no steps.

/**
 * Adds a tube along `n` points (flat, three numbers each). `colourOf(edge)` is an edge's colour; `directors` (flat, three numbers per
 * edge) is where the painted stripe runs, or null for a tube without one.
 */
function addTube(batch, points, n, radius, sides, colourOf, directors) {
  const node = (i) => [points[3 * i], points[3 * i + 1], points[3 * i + 2]];
  const nodes = Array.from({ length: n }, (_, i) => node(i));
  const edges = edgeFrames(nodes, directors);
  for (let e = 0; e + 1 < n; e++) {
    const { along } = edges[e];
    const longest = Math.max(norm(minus(nodes[e + 1], nodes[e])), radius);
    const cut = (other) => (other ? unit(add(along, other.along), along) : along);
    const ring = { ...edges[e], radius, longest, sides, colour: colourOf(e), striped: directors !== null };
    const low = addRing(batch, nodes[e], ring, cut(edges[e - 1]), -0.5 * edges[e].twist);
    const high = addRing(batch, nodes[e + 1], ring, cut(edges[e + 1]), 0.5 * (edges[e + 1]?.twist ?? 0));
    joinRings(batch, low, high, sides);
  }
  if (n < 2) return;
  const last = edges[n - 2];
  addCap(batch, nodes[0], edges[0], -1, radius, sides, colourOf(0));
  addCap(batch, nodes[n - 1], last, 1, radius, sides, colourOf(n - 2));
}

/**
 * Of each edge a unit vector along it and two across, the first one the director, or what turns as little as possible from edge to
 * edge; and the twist from the edge before [rad].
 */
function edgeFrames(nodes, directors) {
  const out = [];
  let [along, first] = [null, null];
  for (let e = 0; e + 1 < nodes.length; e++) {
    const next = unit(minus(nodes[e + 1], nodes[e]), along ?? [1, 0, 0]);
    const square = (x) => unit(minus(x, times(next, dot(x, next))), across(next));
    let carried = across(next);
    if (along !== null) {
      // the turn that takes the last edge to this one, about the normal of both
      const share = dot(first, next) / Math.max(1 + dot(along, next), 1e-6);
      carried = square(minus(first, times(add(along, next), share)));
    }
    first = directors ? square([directors[3 * e], directors[3 * e + 1], directors[3 * e + 2]]) : carried;
    const twist = along === null ? 0 : Math.atan2(dot(first, cross(next, carried)), dot(first, carried));
    along = next;
    out.push({ along, first, second: cross(along, first), twist });
  }
  return out;
}

/**
 * A ring of `sides` + 1 vertices where the plane through `at` with the normal `plane` cuts an edge, turned about the edge by `turn`;
 * returns the first one's number.
 */
function addRing(batch, at, { along, first, second, radius, longest, sides, colour, striped }, plane, turn) {
  const slope = Math.max(dot(along, plane), 0.2);
  let ring = 0;
  for (let k = 0; k <= sides; k++) {
    const angle = 2 * Math.PI * (k / sides - 0.5) + turn;
    const out = add(times(first, Math.cos(angle)), times(second, Math.sin(angle)));
    const shift = clamp((-radius * dot(out, plane)) / slope, -longest, longest);
    const arm = add(times(out, radius), times(along, shift));
    const vertex = batch.vertex(add(at, arm), unit(arm, out), colour, striped ? k / sides : -1);
    if (k === 0) ring = vertex;
  }
  return ring;
}

function joinRings(batch, low, high, sides) {
  for (let k = 0; k < sides; k++) batch.quad(low + k, low + k + 1, high + k + 1, high + k);
}

/** Half a ball at an end, the last one for sign 1. */
function addCap(batch, at, { along, first, second }, sign, radius, sides, colour) {
  const steps = 4;
  let before = null;
  for (let j = 0; j <= steps; j++) {
    const rise = (0.5 * Math.PI * j) / steps;
    let ring = 0;
    for (let k = 0; k <= sides; k++) {
      const angle = 2 * Math.PI * (k / sides - 0.5);
      const out = add(times(first, Math.cos(angle)), times(second, Math.sin(angle)));
      const normal = add(times(out, Math.cos(rise)), times(along, sign * Math.sin(rise)));
      const vertex = batch.vertex(add(at, times(normal, radius)), normal, colour);
      if (k === 0) ring = vertex;
    }
    if (before !== null) {
      if (sign > 0) joinRings(batch, before, ring, sides);
      else joinRings(batch, ring, before, sides);
    }
    before = ring;
  }
}
