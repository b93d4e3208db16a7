// A worker renders the page's scene and view with a seed of its own, in memory of its own.
//
// from the page: { module, blob, settings, camera, generation }, { camera, generation }, { plane }, { stop }
// to the page:   { generation, result?, shown?, pace } or { error }

import { Core } from './croupier.js';
import { Engine } from './engine.js';

/** Milliseconds between two looks at the messages, and between two pictures for the page. */
const SLICE = 12;
const SHOW_EVERY = 400;

let engine = null;
let generation = -1;
let plane = 0;
let shownAt = 0;
let busy = false;

// Messages of a channel come between slices without the delay of timers.
const channel = new MessageChannel();
channel.port1.onmessage = slice;

// One message after the other, also where one has to wait for the module.
let turn = Promise.resolve();
onmessage = ({ data }) => {
  turn = turn.then(() => take(data)).catch(complain);
};

function complain(error) {
  postMessage({ error: error.message });
}

async function take(data) {
  if (data.module) engine = new Engine(await Core.create(data.module));
  if (data.plane !== undefined) [plane, shownAt] = [data.plane, 0];
  if (data.blob) engine.open(data.blob, data.settings);
  if (data.camera) engine.look(data.camera);
  if (data.generation !== undefined) [generation, shownAt] = [data.generation, 0];
  if (data.stop) return close();
  if (engine?.picture && !busy) {
    busy = true;
    channel.port2.postMessage(null);
  }
}

function slice() {
  try {
    // no picture: the last scene was refused
    busy = engine.picture !== null;
    if (!busy) return;
    work();
    channel.port2.postMessage(null);
  } catch (error) {
    // the next scene begins anew
    busy = false;
    complain(error);
  }
}

function work() {
  const ended = engine.work(SLICE);
  const message = { generation, pace: engine.pace.step };
  if (ended) message.result = engine.result;
  // the first picture as soon as there is one
  if (engine.samples > 0 && engine.showable() && performance.now() - shownAt > SHOW_EVERY) {
    const shown = engine.picture.show(plane);
    if (shown) [message.shown, message.plane, shownAt] = [shown.slice(), plane, performance.now()];
  }
  if (message.result || message.shown) postMessage(message, message.shown ? [message.shown.buffer] : []);
}
