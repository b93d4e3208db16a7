// What the page shows: a scene without files, and the room that a dropped mesh is put into.

import { Mesh, compose, copper, diffuse, glazed, gold } from './compose.js';
import { parseObj } from './obj.js';

const TAU = 2 * Math.PI;

/** A sky that is warm and bright at the horizon in front of the camera's back, and dim below. */
function sky() {
  const [width, height] = [32, 33];
  const texels = [];
  for (let row = 0; row < height; row++) {
    const y = Math.cos(Math.PI * row / (height - 1));
    for (let column = 0; column < width; column++) {
      const towards = 0.5 + 0.5 * Math.cos(TAU * ((column + 0.5) / width) - 2.4);
      const t = Math.sqrt(Math.max(y, 0));
      const bright = y < -0.01 ? 0.1 : 0.75 - 0.35 * t + 0.5 * towards * (1 - t);
      texels.push(bright * (1.06 - 0.5 * t), bright * (1.02 - 0.3 * t), bright * (1 + 0.12 * t));
    }
  }
  return { width, height, texels };
}

const sun = { direction: [-0.62, -0.66, -0.42], irradiance: [4.6, 4.2, 3.6], angle: 3 };

/** View and light of the knot. */
export const VIEW = { origin: [1.9, 1.75, 5.2], target: [0, 0.86, 0.1], fieldOfView: 28, sun, sky: sky() };

/** A level disk: nothing of it is seen as an edge. */
function ground(mesh, material, y, radius) {
  const sides = 64;
  const positions = [0, y, 0];
  const triangles = [];
  for (let i = 0; i < sides; i++) {
    positions.push(radius * Math.cos(TAU * i / sides), y, -radius * Math.sin(TAU * i / sides));
    triangles.push(0, 1 + i, 1 + (i + 1) % sides);
  }
  mesh.add(material, positions, triangles);
}

/** A surface with both parameters from 0 to 1, closed in both; normals by differences. */
function surface(mesh, material, point, columns, rows) {
  const positions = [];
  const normals = [];
  const triangles = [];
  for (let i = 0; i < columns; i++) {
    for (let j = 0; j < rows; j++) {
      const [u, v, e] = [i / columns, j / rows, 1e-4];
      const [p, du, dv] = [point(u, v), point(u + e, v), point(u, v + e)];
      const [a, b] = [du.map((x, k) => x - p[k]), dv.map((x, k) => x - p[k])];
      positions.push(...p);
      const n = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
      const length = Math.hypot(...n);
      normals.push(...n.map((x) => x / length));
      const at = (x, y) => (x % columns) * rows + y % rows;
      triangles.push(at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j), at(i + 1, j + 1), at(i, j + 1));
    }
  }
  mesh.add(material, positions, triangles, normals);
}

/** Latitude by longitude, without the poles' slivers. */
function ball(mesh, material, [x, y, z], radius) {
  const [around, down] = [48, 24];
  const [positions, normals, triangles] = [[], [], []];
  for (let j = 0; j <= down; j++) {
    for (let i = 0; i < around; i++) {
      const [a, b] = [TAU * i / around, Math.PI * j / down];
      const n = [Math.sin(b) * Math.cos(a), Math.cos(b), -Math.sin(b) * Math.sin(a)];
      positions.push(x + radius * n[0], y + radius * n[1], z + radius * n[2]);
      normals.push(...n);
      if (j < down) {
        const at = (k, row) => row * around + k % around;
        triangles.push(at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i, j), at(i + 1, j + 1), at(i + 1, j));
      }
    }
  }
  mesh.add(material, positions, triangles, normals);
}

/** A torus knot (2, 3) of copper that stands on two of its lobes, and balls. */
export function knot(composer) {
  const mesh = new Mesh();
  ground(mesh, diffuse([0.4, 0.385, 0.36]), 0, 60);
  const scale = 0.34;
  const curve = (t) => {
    const [r, a] = [2 + Math.cos(3 * t), 2 * t + TAU / 4];
    return [r * Math.cos(a), r * Math.sin(a), Math.sin(3 * t)];
  };
  const unit = (a) => a.map((x) => x / Math.hypot(...a));
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const tube = (u, v) => {
    const [p, next] = [curve(TAU * u), curve(TAU * u + 1e-3)];
    const tangent = unit(next.map((x, k) => x - p[k]));
    const side = unit(cross(tangent, p));
    const out = cross(side, tangent);
    const [s, c] = [Math.sin(TAU * v), Math.cos(TAU * v)];
    return p.map((x, k) => scale * (x + 0.5 * (out[k] * c + side[k] * s)));
  };
  let lowest = Infinity;
  for (let i = 0; i < 4000; i++) lowest = Math.min(lowest, tube(i / 4000, (i * 0.618) % 1)[1]);
  surface(mesh, copper(0.16), (u, v) => tube(u, v).map((x, k) => (k === 1 ? x - lowest : x)), 320, 28);
  ball(mesh, glazed([0.03, 0.24, 0.27], 0.08), [-1.15, 0.34, 0.75], 0.34);
  ball(mesh, gold(0.09), [1.12, 0.26, 0.85], 0.26);
  ball(mesh, glazed([0.6, 0.1, 0.06], 0.08), [0.42, 0.16, 1.3], 0.16);
  ball(mesh, glazed([0.72, 0.66, 0.55], 0.08), [-0.45, 0.12, 1.42], 0.12);
  return compose(composer, mesh, VIEW);
}

/** A mesh of clay on a ground of its own, seen whole. */
export function fromObj(composer, text) {
  const { positions, normals, triangles, faces } = parseObj(text);
  const mesh = new Mesh();
  mesh.add(glazed([0.62, 0.52, 0.43], 0.25), positions, triangles, normals);
  const [low, high] = mesh.bounds();
  const middle = low.map((x, i) => (x + high[i]) / 2);
  const size = Math.hypot(...low.map((x, i) => high[i] - x)) || 1;
  // as large as the knot, standing in the middle
  const scale = 2.6 / size;
  mesh.positions = mesh.positions.map((x, i) => (x - (i % 3 === 1 ? low[1] : middle[i % 3])) * scale);
  ground(mesh, diffuse([0.4, 0.385, 0.36]), 0, 60);
  const top = (high[1] - low[1]) * scale;
  const blob = compose(composer, mesh, { ...VIEW, origin: [2.3, top / 2 + 1.5, 5.4], target: [0, top / 2, 0] });
  return { blob, faces };
}
