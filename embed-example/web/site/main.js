// The page: canvas, controls, and where rays are traced. Frames and workers share `Engine`; `Crowd` speaks to the
// workers.

import { Core, PLANE, Painter, referenceSteps } from './croupier.js';
import { Engine } from './engine.js';
import { Crowd } from './crowd.js';
import { Composer } from './compose.js';
import { Orbit, attach } from './orbit.js';
import { draw, short } from './chart.js';
import { fromObj, knot } from './scenes.js';

const $ = (id) => document.getElementById(id);

/** Milliseconds of a frame that go to rays: 60 frames a second leave the browser the rest. */
const SLICE = 11;
/** Milliseconds between two pictures of the canvas, and after the last move until the fine picture begins. */
const SHOW_EVERY = 120;
const REST = 160;
/** Milliseconds in which a preview is to be done. */
const PREVIEW = 45;
/** Most pixels, CSS pixels otherwise. */
const MOST_PIXELS = 300_000;

const STRATEGIES = {
  ears: ['#e7b65a', 'Learns where paths should end and where split, for the least product of variance and cost.'],
  adrrs: ['#6fb7e8', 'Learns what paths will bring, and ends or splits those that are too faint or too strong.'],
  classic: ['#8fcf9a', 'Paths survive by throughput from the fifth bounce on. Nothing is learned, nothing splits.'],
  none: ['#c99be0', 'Every path goes on to the scene’s largest depth.'],
};
const LEARNS = (rrs) => rrs === 'ears' || rrs === 'adrrs';

const state = {
  scene: null, blob: null, about: '', gain: 1, orbit: null,
  rrs: 'ears', plane: 'picture', depth: 1, workers: 0, target: 0.01,
  size: [0, 0], moved: 0, moving: false, shownAt: 0, paints: 0, previews: 0, pictures: 0,
  /** Whether the preview does not show the plane that is asked for. */
  stale: false,
};
let module, preview, fine, painter, crowd, composer;
/** Finished curves of this view by strategy. */
let curves = {};
let previewPixels = 9000;
/** What works in place of the fine picture, up to a time. */
let aside = null;

// --- what is rendered ---

function plane() {
  if (state.plane === 'factors') return PLANE.factor1 + state.depth - 1;
  return state.plane === 'denoised' && LEARNS(state.rrs) ? PLANE.denoised : PLANE.picture;
}

function settings(size, seed, more) {
  const own = { size: size.join('x'), rrs: state.rrs, seed };
  return { ...own, aovs: 'albedo,normal,factors', 'cache-bytes': 12 << 20, ...more };
}

/** The picture's size for the stage: the same shape, at most so many pixels. */
function sizeFor(most) {
  const { clientWidth: w, clientHeight: h } = $('stage');
  const scale = Math.min(1, Math.sqrt(most / (w * h)));
  return [w, h].map((x) => Math.max(16, Math.round(x * scale)));
}

/** Opens everything anew: another scene, strategy, size or number of workers. */
function open() {
  state.size = sizeFor(MOST_PIXELS);
  if (state.workers === 0) {
    crowd?.stop();
    crowd = null;
    fine.open(state.blob, settings(state.size, 0));
  } else {
    fine.picture = null;
    if (crowd?.count !== state.workers) {
      crowd?.stop();
      crowd = new Crowd(module, state.workers, problem);
    }
    crowd.open(state.blob, (k) => settings(state.size, k + 1));
    crowd.show(plane());
  }
  openPreview();
  turned();
}

function openPreview() {
  // a denoised picture needs a strategy that learns
  const rrs = state.plane === 'factors' || LEARNS(state.rrs) ? state.rrs : 'ears';
  preview.open(state.blob, settings(sizeFor(previewPixels), 0, { rrs, 'cache-bytes': 3 << 20 }));
  preview.look(state.orbit.camera(...state.size));
}

/** Another view. */
function turned() {
  state.moved = performance.now();
  state.moving = true;
  $('fine').classList.remove('there');
  curves = {};
}

/** The view stays: the fine picture of it begins. */
function rest() {
  state.moving = false;
  const camera = state.orbit.camera(...state.size);
  if (crowd) crowd.look(camera);
  else fine.look(camera);
  curves[state.rrs] = [];
  state.shownAt = 0;
  report(null);
  document.documentElement.dataset.pictures = ++state.pictures;
}

function frame(now) {
  requestAnimationFrame(frame);
  const started = performance.now();
  meter(now);
  if (!state.orbit) return;
  try {
    if (state.moving) framePreview(started);
    else if (state.stale) framePlane();
    else if (aside) aside(started + SLICE);
    else if (crowd) frameCrowd(started);
    else frameFine(started);
  } catch (error) {
    problem(error.message);
    state.orbit = null;
  }
}

function framePreview(started) {
  const resting = started - state.moved > REST;
  // each preview is finished before the next view counts, so that a turning camera shows pictures
  if (preview.phase === 'next' && preview.seen !== state.moved) {
    preview.seen = state.moved;
    preview.look(state.orbit.camera(...state.size));
    preview.begun = started;
  }
  if (preview.work(SLICE)) {
    paintPreview();
    if (preview.samples === 1 && !resting) fitPreview();
  }
  if (resting && preview.samples >= 2) rest();
}

/** The preview of another plane, before the fine picture goes on. */
function framePlane() {
  if (preview.work(SLICE)) paintPreview();
}

/** As many pixels as can be done in time. */
function fitPreview() {
  const { rays } = preview.result;
  const wanted = preview.picture.width * preview.picture.height * PREVIEW * preview.pace.step / Math.max(rays, 1);
  const pixels = Math.max(2500, Math.min(60_000, wanted));
  if (pixels > 1.7 * previewPixels || pixels < previewPixels / 1.7) {
    previewPixels = pixels;
    openPreview();
  }
}

function paintPreview() {
  const { width, height } = preview.picture;
  const factors = state.plane === 'factors';
  const shown = preview.picture.show(factors ? plane() : PLANE.denoised) ?? preview.picture.show(PLANE.picture);
  put($('preview'), painter.paint([shown], width, height, { factors, gain: state.gain }));
  state.stale = false;
  document.documentElement.dataset.previews = ++state.previews;
}

function frameFine(started) {
  const before = fine.samples;
  const showing = fine.samples > 0 && fine.showable() && started - state.shownAt > SHOW_EVERY;
  if (showing) paint([fine.picture.show(plane())]);
  const left = Math.max(2, SLICE - (performance.now() - started));
  if (fine.work(left)) {
    // a quiet picture shows each iteration at once, the first above all
    if (before === 0) state.shownAt = 0;
    curves[state.rrs].push(fine.result);
    report(fine.result);
  }
  $('pace').textContent = rate(fine.pace.step * 1000 * SLICE / 16.7);
}

function frameCrowd(started) {
  const result = crowd.takeResult();
  if (result) {
    curves[state.rrs].push(result);
    report(result);
  }
  if (crowd.fresh && started - state.shownAt > SHOW_EVERY) paint(crowd.pictures());
  $('pace').textContent = rate(crowd.pace() * 1000);
}

function paint(pictures) {
  const shown = pictures.filter(Boolean);
  if (!shown.length) return;
  put($('fine'), painter.paint(shown, ...state.size, { factors: state.plane === 'factors', gain: state.gain }));
  $('fine').classList.add('there');
  state.shownAt = performance.now();
  document.documentElement.dataset.paints = ++state.paints;
}

function put(canvas, image) {
  if (canvas.width !== image.width || canvas.height !== image.height) {
    [canvas.width, canvas.height] = [image.width, image.height];
  }
  canvas.getContext('2d').putImageData(image, 0, 0);
}

// --- what is said ---

let lastFrame = 0, frameTime = 16.7, metered = 0;

function meter(now) {
  frameTime += 0.08 * (Math.min(now - lastFrame, 500) - frameTime);
  lastFrame = now;
  if (now - metered > 300) {
    metered = now;
    $('fps').textContent = Math.round(1000 / frameTime);
  }
}

const rate = (x) => (x >= 1e6 ? `${(x / 1e6).toFixed(1)} M` : `${Math.round(x / 1e3)} k`);
const number = (x) => (x >= 1e-3 ? String(+x.toPrecision(3)) : x.toExponential(1).replace('e-', 'e\u2212'));

function report(result) {
  const known = result?.known;
  $('spp').textContent = result ? +result.spp.toFixed(1) : '0';
  $('relmse').textContent = known ? number(result.relMse) : '–';
  // without an end: few pixels cause the error, and more of their kind are probably not found yet
  const interval = () => Number.isFinite(result.high)
    ? `95 % between ${number(result.low)} and ${number(result.high)}` : 'or more: few pixels cause it';
  $('interval').textContent = known
    ? `${interval()}, after ${short(result.seconds)}`
    : crowd ? 'known from four samples per pixel of each worker on' : 'known from four samples per pixel on';
  $('remaining').textContent = known ? remaining(result) : '–';
  chart();
  Object.assign(document.documentElement.dataset, { spp: result?.spp ?? 0, relmse: known ? result.relMse : '' });
}

/** Error falls with 1/N, and samples take the same time. */
function remaining({ relMse, seconds }) {
  const left = seconds * relMse / state.target - seconds;
  if (left <= 0) {
    const first = curves[state.rrs].find((p) => p.known && p.relMse <= state.target);
    return `reached after ${short((first ?? { seconds }).seconds)}`;
  }
  return `in about ${short(left)}`;
}

function chart() {
  const known = Object.entries(curves).map(([rrs, points]) => ({
    color: STRATEGIES[rrs][0], current: rrs === state.rrs, points: points.filter((p) => p.known),
  }));
  draw($('chart'), known, state.target);
}

let problemTimer = 0;

function problem(text) {
  $('problem').textContent = text;
  $('problem').hidden = false;
  clearTimeout(problemTimer);
  problemTimer = setTimeout(() => { $('problem').hidden = true; }, 8000);
}

function press(id, key, value) {
  for (const button of $(id).querySelectorAll('button')) {
    button.setAttribute('aria-pressed', String(button.dataset[key] === String(value)));
  }
}

function describe() {
  press('scenes', 'scene', state.scene);
  press('strategies', 'rrs', state.rrs);
  press('planes', 'plane', state.plane);
  press('depths', 'depth', state.depth);
  press('places', 'workers', state.workers);
  $('about').textContent = state.about;
  $('strategy').textContent = STRATEGIES[state.rrs][1];
  $('factors').hidden = state.plane !== 'factors';
  $('denoised').hidden = state.plane !== 'denoised';
  $('planes').querySelector('[data-plane=denoised]').disabled = !LEARNS(state.rrs);
  $('place').textContent = state.workers === 0
    ? 'Between frames, on the page’s own thread.'
    : state.workers === 1
      ? 'In a worker, so that the page stays free.'
      : 'Workers render the same view with seeds of their own and learn alone; the page averages their pictures.';
}

// --- what is asked for ---

function setScene(scene, blob, about, gain = 1) {
  // the scene's own view
  try {
    preview.open(blob, { size: '16x16', rrs: 'classic' });
  } catch (error) {
    if (state.blob) openPreview();
    throw error;
  }
  Object.assign(state, { scene, blob, about, gain });
  state.orbit = new Orbit(preview.scene.view());
  describe();
  open();
  document.documentElement.dataset.scene = scene;
}

async function choose(scene) {
  if (scene === 'obj') return $('file').click();
  if (scene === 'box') {
    setScene('box', await fetched('scenes/box.crp'), 'Cornell box, baked on another machine.', 1.8);
  } else {
    setScene('knot', knot(composer), 'Copper, gold and glazes; composed just now.');
  }
}

async function openFile(file) {
  if (!file) return;
  try {
    if (file.name.endsWith('.crp')) {
      const blob = new Uint8Array(await file.arrayBuffer());
      return setScene('obj', blob, `${file.name}: ${(blob.length / 1e6).toFixed(1)} MB, baked.`);
    }
    const { blob, faces } = fromObj(composer, await file.text());
    setScene('obj', blob, `${file.name}: ${faces.toLocaleString('en')} triangles of clay.`);
  } catch (error) {
    problem(`${file.name}: ${error.message}`);
  }
}

async function fetched(path) {
  const response = await fetch(path);
  if (!response.ok) throw new Error(`${path}: ${response.status}`);
  return new Uint8Array(await response.arrayBuffer());
}

function onChoice(id, then) {
  $(id).addEventListener('click', (e) => {
    const button = e.target.closest('button');
    if (button && !button.disabled && state.blob) then(button.dataset);
  });
}

function listen() {
  onChoice('scenes', ({ scene }) => choose(scene).catch((e) => problem(e.message)));
  onChoice('strategies', ({ rrs }) => {
    if (rrs === state.rrs) return;
    state.rrs = rrs;
    if (state.plane === 'denoised' && !LEARNS(rrs)) state.plane = 'picture';
    const kept = curves;
    describe();
    open();
    // same view, other strategy: the curves stay for comparison
    rest();
    curves = { ...kept, [rrs]: [] };
    chart();
  });
  const show = () => {
    describe();
    crowd?.show(plane());
    openPreview();
    state.stale = true;
    // a plane of the fine picture is there at once, of workers with the next message
    if (!crowd && !state.moving && fine.samples > 0 && fine.showable()) paint([fine.picture.show(plane())]);
    else $('fine').classList.remove('there');
  };
  onChoice('planes', ({ plane }) => { state.plane = plane; show(); });
  onChoice('depths', ({ depth }) => { state.depth = Number(depth); show(); });
  onChoice('places', ({ workers }) => { state.workers = Number(workers); describe(); open(); });
  $('target').addEventListener('change', (e) => {
    state.target = Number(e.target.value);
    const last = curves[state.rrs]?.at(-1);
    if (last) report(last);
  });

  const hide = () => $('hint').classList.add('gone');
  attach($('stage'), () => state.orbit, () => { hide(); turned(); });
  $('stage').addEventListener('dblclick', () => { state.orbit?.home(); turned(); });
  if (matchMedia('(pointer: coarse)').matches) $('hint').textContent = 'Drag to orbit, pinch to zoom.';
  setTimeout(hide, 9000);

  addEventListener('dragover', (e) => { e.preventDefault(); document.body.classList.add('dragging'); });
  addEventListener('dragleave', (e) => { if (!e.relatedTarget) document.body.classList.remove('dragging'); });
  addEventListener('drop', (e) => {
    e.preventDefault();
    document.body.classList.remove('dragging');
    openFile(e.dataTransfer.files[0]);
  });
  $('file').addEventListener('change', (e) => { openFile(e.target.files[0]); e.target.value = ''; });

  let resized = 0;
  new ResizeObserver(() => {
    clearTimeout(resized);
    resized = setTimeout(() => {
      if (state.orbit && sizeFor(MOST_PIXELS).join() !== state.size.join()) open();
      chart();
    }, 200);
  }).observe($('stage'));

  $('check').addEventListener('click', () => check().catch((e) => problem(e.message)));
}

/** Renders the picture of every host and compares its hash. */
async function check() {
  $('check').disabled = true;
  $('checked').className = 'note';
  try {
    const expected = new TextDecoder().decode(await fetched('hashes.txt')).match(/^A (\w+)$/m)[1];
    const found = await betweenFrames(referenceSteps(await Core.create(module), await fetched('scenes/box.crp')));
    const same = found === expected;
    $('checked').textContent = same
      ? `A picture of 64 × 64 pixels after three iterations of EARS has the hash ${found} here, as on every host.`
      : `Hash ${found}; the native library has ${expected}.`;
    $('checked').className = `note ${same ? 'same' : 'different'}`;
  } finally {
    $('check').disabled = false;
  }
}

/** Runs what yields between short calls, in place of the fine picture; what it returns. */
function betweenFrames(steps) {
  return new Promise((resolve, reject) => {
    aside = (end) => {
      try {
        for (let step = steps.next(); ; step = steps.next()) {
          if (step.done) {
            aside = null;
            return resolve(step.value);
          }
          if (performance.now() >= end) return;
        }
      } catch (error) {
        aside = null;
        reject(error);
      }
    };
  });
}

function places() {
  const most = Math.max(1, Math.min(8, (navigator.hardwareConcurrency || 2) - 1));
  const counts = [...new Set([0, 1, ...(most >= 4 ? [Math.floor(most / 2)] : []), most])].sort((a, b) => a - b);
  $('places').innerHTML = counts.map((n) => {
    const label = n === 0 ? 'This page' : n === 1 ? '1 worker' : `${n} workers`;
    return `<button data-workers="${n}">${label}</button>`;
  }).join('');
}

async function start() {
  const modules = ['croupier.wasm', 'composer.wasm'].map((path) => WebAssembly.compileStreaming(fetch(path)));
  module = await modules[0];
  composer = await Composer.create(await modules[1]);
  const cores = await Promise.all([0, 1, 2].map(() => Core.create(module)));
  [preview, fine] = [new Engine(cores[0]), new Engine(cores[1])];
  painter = new Painter(cores[2]);
  places();
  listen();
  requestAnimationFrame(frame);
  await choose('knot');
}

start().catch((error) => problem(error.message));
