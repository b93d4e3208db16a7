// What the page shows: a scene without files, and the room that a dropped mesh is put into.

import { Mesh, compose, copper, diffuse, glazed, gold } from './compose.js';
import { parseObj } from './obj.js';

const TAU = 2 * Math.PI;
const GROUND = diffuse([0.075, 0.077, 0.085]);

/** A dusky studio: dim all around, a large soft light from the upper left, a smaller one from behind at the right. */
function sky() {
  const [width, height] = [64, 33];
  const lights = [
    { from: unit([-0.75, 0.75, 0.35]), sharp: 9, rgb: [5.2, 4.7, 4.0] },
    { from: unit([0.8, 0.32, -0.75]), sharp: 16, rgb: [1.5, 2.1, 2.9] },
  ];
  const texels = [];
  for (let row = 0; row < height; row++) {
    const [sin, y] = [Math.sin(Math.PI * row / (height - 1)), Math.cos(Math.PI * row / (height - 1))];
    for (let column = 0; column < width; column++) {
      // column u * width - 0.5, u = atan2(x, -z) / 2 pi
      const angle = TAU * (column + 0.5) / width;
      const d = [sin * Math.sin(angle), y, -sin * Math.cos(angle)];
      const haze = y < -0.01 ? 0.04 : 0.075 - 0.055 * Math.sqrt(Math.max(y, 0));
      for (let c = 0; c < 3; c++) {
        const of = (l) => l.rgb[c] * Math.exp(l.sharp * (d[0] * l.from[0] + y * l.from[1] + d[2] * l.from[2] - 1));
        texels.push(haze * [0.9, 1, 1.2][c] + lights.reduce((sum, l) => sum + of(l), 0));
      }
    }
  }
  return { width, height, texels };
}

const sun = { direction: [0.66, -0.7, -0.34], irradiance: [2.6, 2.35, 2.0], angle: 5 };

const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];

function unit(a) {
  return a.map((x) => x / Math.hypot(...a));
}

/** View and light of the knot. */
export const VIEW = { origin: [1.9, 1.75, 5.2], target: [0, 0.87, 0.1], fieldOfView: 30, sun, sky: sky() };

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
      normals.push(...unit(cross(a, b)));
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
  ground(mesh, GROUND, 0, 60);
  const scale = 0.34;
  const curve = (t) => {
    const [r, a] = [2 + Math.cos(3 * t), 2 * t + TAU / 4];
    return [r * Math.cos(a), r * Math.sin(a), Math.sin(3 * t)];
  };
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
  ball(mesh, glazed([0.03, 0.24, 0.27], 0.08), [-1.02, 0.32, 0.85], 0.32);
  ball(mesh, gold(0.09), [1.08, 0.26, 0.85], 0.26);
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
  ground(mesh, GROUND, 0, 60);
  const top = (high[1] - low[1]) * scale;
  const blob = compose(composer, mesh, { ...VIEW, origin: [2.3, top / 2 + 1.5, 5.4], target: [0, top / 2, 0] });
  return { blob, faces };
}
