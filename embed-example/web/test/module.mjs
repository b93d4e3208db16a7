// The modules alone, in Node: size, imports, the hash of the reference picture.
import { readFileSync } from 'node:fs';
import { fileURLToPath } from 'node:url';
import { Composer, Mesh, compose, diffuse } from '../site/compose.js';
import { Core, Picture, Scene, renderReference } from '../site/croupier.js';
import { VIEW, knot } from '../site/scenes.js';

const LARGEST = 400 * 1024;
const site = fileURLToPath(new URL('../site', import.meta.url));

function expect(holds, what) {
  if (!holds) throw new Error(`not so: ${what}`);
  console.log(`  ${what}`);
}

/** Compiles a module that needs nothing. */
async function load(name) {
  const file = readFileSync(`${site}/${name}.wasm`);
  const module = await WebAssembly.compile(file);
  expect(file.length < LARGEST, `${name}: ${file.length} bytes, ${LARGEST} allowed`);
  expect(WebAssembly.Module.imports(module).length === 0, `${name}: no imports`);
  const allocators = WebAssembly.Module.exports(module).filter((e) => /alloc|free/.test(e.name));
  expect(allocators.length === 0, `${name}: no allocator`);
  return module;
}

const module = await load('croupier');
const composer = await Composer.create(await load('composer'));

const expected = readFileSync(`${site}/hashes.txt`, 'utf8').match(/^A (\w+)$/m)[1];
const core = await Core.create(module);
const found = renderReference(core, readFileSync(`${site}/scenes/box.crp`));
expect(found === expected, `hash ${found}, native ${expected}`);

// what is refused says why
const message = (call) => {
  try {
    call();
  } catch (error) {
    return error.message;
  }
  return '';
};
core.reset();
const other = message(() => renderReference(core, new Uint8Array(100)));
expect(other === 'these bytes are no scene', `other bytes are refused: ${other}`);
const mesh = new Mesh();
mesh.add(diffuse([0.5, 2, 0.5]), [0, 0, 0, 1, 0, 0, 0, 1, 0], [0, 1, 2]);
const text = message(() => compose(composer, mesh, VIEW));
expect(/^materials\[0\]: reflectance is 2,/.test(text), `the composer refuses by name and number: ${text}`);

// a scene of the composer is one of the renderer
core.reset();
const picture = new Picture(core, new Scene(core, knot(composer)), { size: '32x32', rrs: 'classic' });
picture.begin(4);
while (!picture.step(1000));
while (!picture.finish(1000));
const { relMse, spp } = picture.numbers();
expect(spp === 4 && relMse > 0 && relMse < 10, `a composed scene renders, relMSE ${relMse.toFixed(3)}`);

// colours: those of `croupier render`, to one step; the ends and the middle of the scale of factors
core.reset();
const values = Float32Array.from({ length: 1024 }, (_, i) => (i / 400) ** 3);
const srgb = (x) => (x <= 0.0031308 ? 12.92 * x : 1.055 * x ** (1 / 2.4) - 0.055);
const curve = (x) => (x <= 0.7 ? x : 1 - 0.3 * Math.exp(-(x - 0.7) / 0.3));
const [from, to] = [core.take(values.length * 16), core.take(values.length * 4)];
values.forEach((x, i) => core.floats(from, 4 * values.length).set([x, 2 * x, NaN, i % 2], 4 * i));
core.exports.tone_map(from, values.length, 0.5, to);
const worst = values.reduce((most, x, i) => {
  const [r, g, b, a] = core.bytes(to + 4 * i, 4);
  const off = [r - 255 * srgb(curve(0.5 * x)), g - 255 * srgb(curve(x)), b].map(Math.abs);
  return Math.max(most, ...off, a === 255 * (i % 2) ? 0 : 255);
}, 0);
expect(worst < 0.8, `bytes are within ${worst.toFixed(2)} of the tone curve`);
const factors = [0.01, 0.05, 1, 20, 100, 0];
factors.forEach((x, i) => core.floats(from, 24).set([x, 0, 0, 1], 4 * i));
core.exports.false_colors(from, factors.length, to);
const ends = [[103, 0, 31], [103, 0, 31], [255, 255, 255], [5, 48, 97], [5, 48, 97], [48, 50, 54]];
const found8 = (i) => core.bytes(to, 24)[Math.floor(i / 3) * 4 + i % 3];
const furthest = Math.max(...ends.flat().map((x, i) => Math.abs(x - found8(i))));
expect(furthest <= 2, 'factors have the colours of the scale');
