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
expect(message(() => renderReference(core, new Uint8Array(100))) === 'these bytes are no scene', 'other bytes are refused');
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
