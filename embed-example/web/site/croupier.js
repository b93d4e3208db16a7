// The renderer's module as objects: memory, scenes, pictures. Nothing here knows the page; workers and tests use it as
// well.
//
// Modules have no allocator: this file hands out their memory from `__heap_base` upwards.

/** Planes of `Picture.show`: mean radiance, denoised estimate, factors by depth of the vertex. */
export const PLANE = { picture: 0, denoised: 1, factor1: 2, factor2: 3, factor3: 4, factor4: 5 };

const SCENE = 0, PICTURE = 1;
const align = (n) => (n + 63) & ~63;

/** Why the renderer refuses something (`Refused` in renderer/src/lib.rs). */
const REFUSED = [
  '',
  'these bytes are no scene',
  'the camera cannot be used',
  'a setting is unknown or out of its range',
  'the settings do not fit together',
  'the scene calls for effects that this build lacks',
];

/** An instance of a module with its memory. */
export class Memory {
  constructor(exports) {
    this.exports = exports;
    this.base = align(exports.__heap_base.value);
    this.top = this.base;
  }

  /** Gives all memory back. What was in it must not be used any more. */
  reset() {
    this.top = this.base;
  }

  /** Address of so many bytes, at a multiple of 64. Views of the memory from before may be detached. */
  take(bytes) {
    const at = this.top;
    this.top = align(at + bytes);
    const { memory } = this.exports;
    const missing = this.top - memory.buffer.byteLength;
    if (missing > 0) memory.grow(Math.ceil(missing / 65536));
    return at;
  }

  bytes(at, length) { return new Uint8Array(this.exports.memory.buffer, at, length); }
  words(at, length) { return new Uint32Array(this.exports.memory.buffer, at, length); }
  floats(at, length) { return new Float32Array(this.exports.memory.buffer, at, length); }

  /** Copies bytes into memory of their own. */
  put(bytes) {
    const at = this.take(bytes.length);
    this.bytes(at, bytes.length).set(bytes);
    return at;
  }
}

/** An instance of the renderer. */
export class Core extends Memory {
  /** @param {WebAssembly.Module} module compiled once, posted to workers */
  static async create(module) {
    return new Core((await WebAssembly.instantiate(module, {})).exports);
  }

  check(status) {
    if (status !== 0) throw new Error(REFUSED[status] ?? `refused: ${status}`);
  }
}

/** A scene whose camera can change. */
export class Scene {
  /** @param {Uint8Array} blob a baked scene */
  constructor(core, blob) {
    this.core = core;
    this.record = core.take(23 * 4);
    this.at = core.take(core.exports.control_bytes(SCENE));
    core.check(core.exports.scene_open(this.at, core.put(blob), blob.length));
  }

  /** The camera's 17 words as floats (words 0, 15 and 16 are integers), and the corners of the scene's box. */
  view() {
    const { core } = this;
    core.exports.scene_view(this.at, this.record);
    const floats = core.floats(this.record, 23).slice();
    const size = [...core.words(this.record + 15 * 4, 2)];
    return { camera: floats.slice(0, 17), size, low: [...floats.slice(17, 20)], high: [...floats.slice(20, 23)] };
  }

  /** Replaces the camera. Pictures of the scene are to be restarted. */
  look(camera) {
    this.core.floats(this.record, 17).set(camera);
    this.core.check(this.core.exports.scene_look(this.at, this.record));
  }
}

/** A picture of a scene that grows by iterations. */
export class Picture {
  /** @param {Object} settings names and values of Croupier's settings */
  constructor(core, scene, settings) {
    this.core = core;
    this.scene = scene;
    const { exports } = core;
    const text = new TextEncoder().encode(Object.entries(settings).map((pair) => pair.join('=')).join(' '));
    const at = core.put(text);
    const sizes = core.take(8);
    core.check(exports.picture_sizes(scene.at, at, text.length, sizes));
    const blocks = [...core.words(sizes, 2)].map((size) => core.take(size));
    core.words(sizes, 2).set(blocks);
    this.at = core.take(exports.control_bytes(PICTURE));
    core.check(exports.picture_open(this.at, scene.at, at, text.length, sizes));
    this.numbersAt = core.take(12 * 8);
    const { width, height } = this.numbers();
    [this.width, this.height] = [width, height];
    this.shown = core.take(width * height * 16);
  }

  /** Begins a new picture of the scene as it is now; what roulette has learned stays. */
  restart() {
    this.core.check(this.core.exports.picture_restart(this.at, this.scene.at));
  }

  begin(samples) { this.core.exports.picture_begin(this.at, samples); }

  /** Traces about so many rays; true at the end of the iteration. */
  step(rays) { return this.core.exports.picture_step(this.at, this.scene.at, rays) !== 0; }

  /** Merges and learns, about as long as so many rays take; true when the next iteration can begin. */
  finish(rays) { return this.core.exports.picture_finish(this.at, rays) !== 0; }

  /** Four floats for each pixel, a view of the memory; null if there is no such plane (yet). */
  show(plane) {
    const pixels = this.width * this.height;
    const there = this.core.exports.picture_show(this.at, this.scene.at, plane, this.shown, pixels);
    return there ? this.core.floats(this.shown, pixels * 4) : null;
  }

  numbers() {
    this.core.exports.picture_numbers(this.at, this.numbersAt);
    const n = new Float64Array(this.core.exports.memory.buffer, this.numbersAt, 12);
    const [relMse, low, high, relMseAll, iterations, spp, rays, cost, splits, terminated, width, height] = n;
    return { relMse, low, high, relMseAll, iterations, spp, rays, cost, splits, terminated, width, height };
  }
}

/** Colours of pixels: averages pictures of several instances, and makes bytes of a canvas. */
export class Painter {
  constructor(core) {
    this.core = core;
  }

  /** @param {Float32Array[]} pictures of `Picture.show`, all of one size @returns {ImageData} */
  paint(pictures, width, height, { factors = false, gain = 1 } = {}) {
    const { core } = this;
    const { exports } = core;
    const pixels = width * height;
    core.reset();
    const [sum, more, out] = [core.take(pixels * 16), core.take(pixels * 16), core.take(pixels * 4)];
    core.floats(sum, pixels * 4).set(pictures[0]);
    for (const picture of pictures.slice(1)) {
      core.floats(more, pixels * 4).set(picture);
      exports.average(sum, more, pixels);
    }
    if (factors) exports.false_colors(sum, pixels, out);
    else exports.tone_map(sum, pixels, gain, out);
    return new ImageData(new Uint8ClampedArray(exports.memory.buffer, out, pixels * 4), width, height);
  }
}

/** 64-bit FNV-1a over the bytes of the mean R, G and B of every pixel, as all examples of embedding hash pictures. */
export function hash(shown) {
  const bytes = new Uint8Array(shown.buffer, shown.byteOffset, shown.byteLength);
  // two 32-bit halves: BigInt is slow
  let [lo, hi] = [0x84222325, 0xcbf29ce4];
  for (let i = 0; i < bytes.length; i++) {
    if ((i & 15) >= 12) continue;
    lo = (lo ^ bytes[i]) >>> 0;
    // times 2^40 + 0x1b3
    const product = lo * 0x1b3;
    hi = (Math.imul(hi, 0x1b3) + Math.floor(product / 2 ** 32) + (lo << 8)) >>> 0;
    lo = product >>> 0;
  }
  return [hi, lo].map((x) => x.toString(16).padStart(8, '0')).join('');
}

/** Settings and iterations of the picture that every host renders; its hash is in embed-example/hashes.txt. */
export const REFERENCE = {
  settings: {
    rrs: 'ears', ring: 64, ledger: 256, 'cache-bytes': 65536, 'split-budget': 64, 'pixel-estimator': 'blocks',
    shards: 1,
  },
  iterations: [2, 2, 4],
};

/** Renders that picture in short calls, between which it yields; its hash. */
export function* referenceSteps(core, blob) {
  const picture = new Picture(core, new Scene(core, blob), REFERENCE.settings);
  for (const samples of REFERENCE.iterations) {
    picture.begin(samples);
    while (!picture.step(1000)) yield;
    while (!picture.finish(1000)) yield;
  }
  return hash(picture.show(PLANE.picture));
}

/** Renders that picture at once; its hash. */
export function renderReference(core, blob) {
  const steps = referenceSteps(core, blob);
  for (;;) {
    const { done, value } = steps.next();
    if (done) return value;
  }
}
