// The page's worker in Node: messages that come while it waits for its module, and scenes that it refuses.
import { readFileSync } from 'node:fs';
import { fileURLToPath } from 'node:url';

const site = fileURLToPath(new URL('../site', import.meta.url));
const module = await WebAssembly.compile(readFileSync(`${site}/croupier.wasm`));
const blob = readFileSync(`${site}/scenes/box.crp`);
const settings = { size: '16x16', rrs: 'ears' };

// what a worker has besides
const messages = [];
let look = () => {};
Object.assign(globalThis, {
  onmessage: null,
  postMessage(message) {
    messages.push(message);
    look();
  },
  close: () => process.exit(0),
});
await import('../site/worker.js');
const send = (data) => globalThis.onmessage({ data });

/** The next message that fits; others are thrown away. */
const next = (fits) => new Promise((resolve, reject) => {
  // a worker that is dead says nothing
  const patience = setTimeout(() => reject(new Error('not so: the worker answers')), 240_000);
  look = () => {
    while (messages.length) {
      const message = messages.shift();
      if (!fits(message)) continue;
      clearTimeout(patience);
      look = () => {};
      return resolve(message);
    }
  };
  look();
});

/** Waits for a result of a generation; an error is none. */
async function rendered(generation) {
  const message = await next((m) => m.error || m.generation === generation && m.result);
  if (message.error) throw new Error(`not so: a picture is rendered: ${message.error}`);
}

// the scene comes before the module is ready
send({ module });
send({ blob, settings, generation: 1 });
await rendered(1);
console.log('  a worker keeps the order of its messages');

// the picture was there when a scene was refused
send({ blob: new Uint8Array(100), settings, generation: 2 });
const { error } = await next((m) => m.error);
if (error !== 'these bytes are no scene') throw new Error(`not so: a scene is refused: ${error}`);
// a task later the worker looks for its picture
await new Promise((resolve) => { setTimeout(resolve, 20); });
send({ blob, settings, generation: 3 });
await rendered(3);
console.log('  a worker renders after a scene that it refused');
send({ stop: true });
