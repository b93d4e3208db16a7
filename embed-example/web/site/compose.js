// Scenes from triangles: the composer, a module of its own, makes the blob with its tree. Pages that show baked scenes
// only need neither.

import { Memory } from './croupier.js';

/** An instance of the composer. */
export class Composer extends Memory {
  static async create(module) {
    return new Composer((await WebAssembly.instantiate(module, {})).exports);
  }

  /** Throws the message of so many bytes, if there is one. */
  check(message, length) {
    if (length > 0) throw new Error(new TextDecoder().decode(this.bytes(message, length)));
  }
}

/** Words of a material record (`Material` in core/src/scene/blob/materials.rs). */
const DIFFUSE = 0, ROUGH_CONDUCTOR = 3, ROUGH_PLASTIC = 8;
const TWO_SIDED = 1;
const NONE = 0xffffffff;

/** Materials by their parameters; colours are linear. */
export const diffuse = (reflectance) => ({ kind: DIFFUSE, reflectance });
export const glazed = (reflectance, alpha) => ({ kind: ROUGH_PLASTIC, reflectance, alpha, eta: [1.5, 0, 0] });
export const metal = (eta, k, alpha) => ({ kind: ROUGH_CONDUCTOR, reflectance: [1, 1, 1], alpha, eta, k });
export const lamp = (emission) => ({ ...diffuse([0, 0, 0]), emission });

/** Eta and k at 630, 530 and 465 nm. */
export const copper = (alpha) => metal([0.2004, 0.924, 1.1022], [3.9129, 2.4528, 2.1421], alpha);
export const gold = (alpha) => metal([0.1431, 0.3749, 1.4424], [3.9831, 2.3857, 1.6032], alpha);

/** Triangles with materials, to be added to. */
export class Mesh {
  constructor() {
    this.materials = [];
    this.positions = [];
    this.normals = [];
    this.triangles = [];
    this.triangleMaterials = [];
  }

  /** Flat arrays of coordinates and of indices from 0; without normals the triangles are flat. */
  add(material, positions, triangles, normals) {
    const first = this.positions.length / 3;
    const number = this.materials.push(material) - 1;
    for (const x of positions) this.positions.push(x);
    for (let i = 0; i < positions.length; i++) this.normals.push(normals ? normals[i] : 0);
    for (const v of triangles) this.triangles.push(first + v);
    for (let i = 0; i < triangles.length; i += 3) this.triangleMaterials.push(number);
  }

  /** Smallest and largest coordinates. */
  bounds() {
    const [low, high] = [[Infinity, Infinity, Infinity], [-Infinity, -Infinity, -Infinity]];
    this.positions.forEach((x, i) => {
      low[i % 3] = Math.min(low[i % 3], x);
      high[i % 3] = Math.max(high[i % 3], x);
    });
    return [low, high];
  }
}

/**
 * Composes a scene; its blob. All memory of the composer is used.
 * @param view { origin, target, fieldOfView, sun: { direction, irradiance, angle }, sky: { width, height, texels } }
 */
export function compose(composer, mesh, view) {
  composer.reset();
  const { exports } = composer;
  const message = composer.take(exports.message_bytes());
  const bytes = (array) => composer.put(new Uint8Array(array.buffer));
  const floats = (values) => bytes(Float32Array.from(values));
  const words = (values) => bytes(Uint32Array.from(values));
  const materials = mesh.materials.map((m) => {
    const record = new Uint32Array(16);
    const numbers = new Float32Array(record.buffer);
    record.set([m.kind, TWO_SIDED, NONE, NONE]);
    numbers.set(m.reflectance, 4);
    numbers[7] = m.alpha ?? 0;
    numbers.set(m.eta ?? [0, 0, 0], 8);
    numbers.set(m.k ?? [0, 0, 0], 12);
    record[15] = NONE;
    return record;
  });
  const { sky, sun } = view;
  const record = composer.take(26 * 4);
  const fields = [
    floats(mesh.positions), floats(mesh.normals), mesh.positions.length / 3,
    words(mesh.triangles), words(mesh.triangleMaterials), mesh.triangles.length / 3,
    words(materials.flatMap((m) => [...m])), floats(mesh.materials.flatMap((m) => m.emission ?? [0, 0, 0])),
    mesh.materials.length, floats(sky.texels), sky.width, sky.height,
  ];
  composer.words(record, 12).set(fields);
  const numbers = [...view.origin, ...view.target, view.fieldOfView, ...sun.direction, ...sun.irradiance, sun.angle];
  composer.floats(record + 12 * 4, 14).set(numbers);

  const sizes = composer.take(8);
  composer.check(message, exports.compose_sizes(record, sizes, message));
  const blocks = [...composer.words(sizes, 2)].map((size) => composer.take(size));
  const at = composer.take(8);
  composer.words(at, 2).set(blocks);
  const length = composer.take(4);
  composer.check(message, exports.compose(record, at, sizes, length, message));
  return composer.bytes(blocks[0], composer.words(length, 1)[0]).slice();
}
