// Positions and faces of an OBJ file: what a demonstration needs, and no more. Normals are smoothed where faces meet at
// less than 30 degrees; materials, texture coordinates and the file's own normals are not read.

const SMOOTH = Math.cos(30 * Math.PI / 180);

/** @returns { positions, normals, triangles } flat arrays, one vertex for each corner */
export function parseObj(text) {
  const points = [];
  const faces = [];
  let line = 0;
  for (const row of text.split('\n')) {
    line++;
    const [key, ...rest] = row.trim().split(/\s+/);
    if (key === 'v') {
      const [x, y, z] = rest.map(Number);
      if (!Number.isFinite(x + y + z)) throw new Error(`line ${line}: a vertex needs three numbers`);
      points.push([x, y, z]);
    } else if (key === 'f') {
      const corners = rest.map((corner) => {
        const n = parseInt(corner, 10);
        const index = n < 0 ? points.length + n : n - 1;
        if (!(index >= 0 && index < points.length)) throw new Error(`line ${line}: there is no vertex ${corner}`);
        return index;
      });
      for (let i = 2; i < corners.length; i++) faces.push([corners[0], corners[i - 1], corners[i]]);
    }
  }
  if (!faces.length) throw new Error('the file has no faces');
  return { ...smoothed(points, faces), faces: faces.length };
}

const sub = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = (a) => {
  const length = Math.sqrt(dot(a, a));
  return length > 0 ? a.map((x) => x / length) : [0, 0, 0];
};

function smoothed(points, faces) {
  // by length twice the area: large faces count more
  const areas = faces.map(([a, b, c]) => cross(sub(points[b], points[a]), sub(points[c], points[a])));
  const units = areas.map(unit);
  const around = points.map(() => []);
  faces.forEach((face, i) => face.forEach((p) => around[p].push(i)));
  const [positions, normals, triangles] = [[], [], []];
  faces.forEach((face, i) => {
    for (const p of face) {
      const sum = [0, 0, 0];
      for (const j of around[p]) {
        if (dot(units[i], units[j]) > SMOOTH) sum.forEach((x, k) => { sum[k] = x + areas[j][k]; });
      }
      triangles.push(positions.length / 3);
      positions.push(...points[p]);
      normals.push(...unit(sum));
    }
  });
  return { positions, normals, triangles };
}
