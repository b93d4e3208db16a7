// The page in headless Chromium: it renders, its hash is the native one, orbit, strategies, views, workers and a
// dropped OBJ work, nothing is complained of. Pictures of it go to a folder, to be looked at.
//
// node browser.mjs [FOLDER] [--limits]      with the browser of $CHROMIUM, /usr/bin/chromium otherwise
import { mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { chromium } from 'playwright-core';
import { serve } from '../serve.mjs';

const here = (path) => fileURLToPath(new URL(path, import.meta.url));
const site = here('../site');
const limits = process.argv.includes('--limits');
const shots = process.argv.slice(2).find((argument) => !argument.startsWith('--')) ?? here('../target/web-shots');
mkdirSync(shots, { recursive: true });
const hashes = readFileSync(join(site, 'hashes.txt'), 'utf8');
const NATIVE = hashes.match(/^A (\w+)$/m)[1];

/** Patience with machines that do other things as well. */
const LONG = { timeout: 240_000 };

/**
 * Milliseconds that a task of the page's thread may take with `--limits`: what browsers call long begins there, and a
 * frame's rays take 11. For quiet machines: a virtual one counts in it what its host did in between.
 */
const LONGEST_TASK = 50;

function expect(holds, what) {
  if (!holds) throw new Error(`not so: ${what}`);
  console.log(`  ${what}`);
}

/** Hash of what a canvas shows, and how much of it differs from its first pixel. */
const look = (page, id = 'fine') => page.evaluate((id) => {
  const canvas = document.getElementById(id);
  const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
  let [hash, different] = [0, 0];
  for (let i = 0; i < data.length; i += 4) {
    hash = (Math.imul(hash ^ data[i] ^ data[i + 1] << 8 ^ data[i + 2] << 16, 0x9e3779b1) >>> 0);
    if (Math.abs(data[i] - data[0]) + Math.abs(data[i + 1] - data[1]) > 12) different++;
  }
  return { hash, different: different / (data.length / 4) };
}, id);

/** Waits until the fine picture has so many samples and was painted since. */
async function rendered(page, samples) {
  await page.waitForFunction((n) => Number(document.documentElement.dataset.spp) >= n, samples, LONG);
  const before = await page.evaluate(() => Number(document.documentElement.dataset.paints ?? 0));
  await page.waitForFunction((n) => Number(document.documentElement.dataset.paints ?? 0) > n, before, LONG);
}

/** Does something and waits until the fine picture was begun anew since. */
async function anew(page, action) {
  const before = await page.evaluate(() => Number(document.documentElement.dataset.pictures ?? 0));
  await action();
  await page.waitForFunction((n) => Number(document.documentElement.dataset.pictures ?? 0) > n, before, LONG);
}

async function drag(page, dx, dy) {
  const box = await page.locator('#stage').boundingBox();
  const [x, y] = [box.x + box.width / 2, box.y + box.height / 2];
  await page.mouse.move(x, y);
  await page.mouse.down();
  for (let i = 1; i <= 6; i++) await page.mouse.move(x + dx * i / 6, y + dy * i / 6);
  await page.mouse.up();
}

/** One finger across the picture. */
async function swipe(page) {
  const cdp = await page.context().newCDPSession(page);
  const touch = (type, x) => cdp.send('Input.dispatchTouchEvent', { type, touchPoints: x ? [{ x, y: 200 }] : [] });
  await touch('touchStart', 150);
  for (let x = 160; x <= 230; x += 10) await touch('touchMove', x);
  await touch('touchEnd');
}

/** Frames per second and the longest task of the page's thread, while something happens. */
async function measure(page, what, during) {
  const cdp = await page.context().newCDPSession(page);
  const events = [];
  cdp.on('Tracing.dataCollected', ({ value }) => events.push(...value));
  const includedCategories = ['devtools.timeline', 'disabled-by-default-devtools.timeline'];
  const traceConfig = { includedCategories, excludedCategories: ['*'] };
  await cdp.send('Tracing.start', { transferMode: 'ReportEvents', traceConfig });
  await during();
  const complete = new Promise((resolve) => { cdp.once('Tracing.tracingComplete', resolve); });
  await cdp.send('Tracing.end');
  await complete;
  await cdp.detach();
  // another page, which is empty, is there, too
  const frames = events.filter((e) => e.name === 'FireAnimationFrame').sort((a, b) => a.ts - b.ts);
  const { pid, tid } = frames[frames.length >> 1];
  const tasks = events.filter((e) => e.name === 'RunTask' && e.pid === pid && e.tid === tid && e.tdur);
  const longest = (key) => Math.max(...tasks.map((e) => e[key])) / 1000;
  const rate = (frames.length - 1) / (frames.at(-1).ts - frames[0].ts) * 1e6;
  console.log(`  ${what}: ${rate.toFixed(1)} frames per second, ${longest('dur').toFixed(1)} ms the longest task`);
  const most = longest('tdur');
  const allowed = limits ? LONGEST_TASK : Infinity;
  expect(most > 1 && most < allowed, `${what}: ${most.toFixed(1)} ms of the processor, ${allowed} allowed`);
}

/** Some seconds. */
const seconds = (n) => new Promise((resolve) => { setTimeout(resolve, 1000 * n); });

/** Presses a plane's button; whether the page made the preview before it took the next event. */
const blocks = (page, plane) => page.evaluate((plane) => {
  const { previews } = document.documentElement.dataset;
  document.querySelector(`[data-plane=${plane}]`).click();
  return document.documentElement.dataset.previews !== previews;
}, plane);

/** A pyramid on a block, faces of three and four corners. */
const OBJ = `# made by the test
v -1 0 -1\nv 1 0 -1\nv 1 0 1\nv -1 0 1\nv -1 1 -1\nv 1 1 -1\nv 1 1 1\nv -1 1 1\nv 0 2.4 0
f 4 3 2 1\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8
f 5/1/1 6/1/1 9/1/1\nf 6 7 9\nf 7 8 9\nf -2 -5 -1\n`;

const drop = (page, name, text) => page.evaluate(([name, text]) => {
  const transfer = new DataTransfer();
  transfer.items.add(new File([text], name));
  dispatchEvent(new DragEvent('drop', { dataTransfer: transfer, bubbles: true, cancelable: true }));
}, [name, text]);

const { server, url } = await serve(site);
const profile = mkdtempSync(join(tmpdir(), 'croupier-web-'));
const context = await chromium.launchPersistentContext(profile, {
  executablePath: process.env.CHROMIUM ?? '/usr/bin/chromium',
  headless: true,
  viewport: { width: 1280, height: 800 },
  args: [
    '--no-sandbox', '--disable-gpu', '--disable-quic', '--no-first-run', '--disable-background-networking',
    '--disable-component-update', '--disable-sync',
  ],
});
// several workers, also where there are few processors
await context.addInitScript(() => Object.defineProperty(navigator, 'hardwareConcurrency', { get: () => 4 }));
const complaints = [];

async function open(size) {
  const page = await context.newPage();
  page.on('console', (m) => {
    // reading canvases back is what this test does, not the page
    if (['error', 'warning'].includes(m.type()) && !m.text().includes('getImageData')) complaints.push(m.text());
  });
  page.on('pageerror', (e) => complaints.push(e.message));
  page.on('requestfailed', (r) => complaints.push(`${r.url()}: ${r.failure()?.errorText}`));
  page.on('response', (r) => { if (r.status() >= 400) complaints.push(`${r.url()}: ${r.status()}`); });
  page.setDefaultTimeout(LONG.timeout);
  await page.setViewportSize(size);
  await page.goto(url);
  return page;
}

try {
  console.log('desktop');
  const page = await open({ width: 1280, height: 800 });
  await rendered(page, 1);
  expect((await look(page)).different > 0.2, 'the page renders its first scene');
  expect((await look(page, 'preview')).different > 0.2, 'a preview lies below');
  await rendered(page, 8);
  expect(/^[\d.e\u2212]+$/.test(await page.locator('#relmse').textContent()), 'the error is estimated');
  expect(/^(in about|reached)/.test(await page.locator('#remaining').textContent()), 'the time to the target is given');
  await page.screenshot({ path: join(shots, 'desktop-knot.png') });

  const checked = page.locator('#checked');
  const other = NATIVE.replace(/./g, (digit) => (digit === '0' ? '1' : '0'));
  await page.route('**/hashes.txt', (route) => route.fulfill({ body: `A ${other}\n` }));
  await page.click('#check');
  await page.waitForSelector('#checked.same, #checked.different', LONG);
  expect(await checked.getAttribute('class') === 'note different', 'another hash is not taken for the native one');
  await page.unroute('**/hashes.txt');
  await page.click('#check');
  await page.waitForSelector('#checked.same, #checked.different', LONG);
  const [verdict, said] = [await checked.getAttribute('class'), await checked.textContent()];
  expect(verdict === 'note same' && said.includes(`the hash ${NATIVE}`), `the hash is the native one, ${NATIVE}`);

  await rendered(page, 16);
  await measure(page, 'rendering', () => seconds(3));
  await measure(page, 'turning', async () => {
    for (let i = 0; i < 6; i++) await drag(page, i % 2 ? -80 : 80, 10);
  });
  await rendered(page, 4);
  await measure(page, 'other planes', async () => {
    for (const plane of ['factors', 'denoised', 'picture']) {
      const before = await page.evaluate(() => Number(document.documentElement.dataset.previews));
      expect(!await blocks(page, plane), `the preview of plane ${plane} is made between frames`);
      await page.waitForFunction((n) => Number(document.documentElement.dataset.previews) > n, before, LONG);
    }
  });

  await anew(page, () => page.click('[data-scene=box]'));
  await rendered(page, 4);
  const before = await look(page);
  await page.screenshot({ path: join(shots, 'desktop-box.png') });
  await anew(page, () => drag(page, 90, 25));
  await rendered(page, 1);
  expect((await look(page)).hash !== before.hash, 'a drag turns the camera');
  await anew(page, () => page.dblclick('#stage'));
  await rendered(page, 4);

  await anew(page, () => page.click('[data-rrs=classic]'));
  await rendered(page, 4);
  expect(await page.locator('[data-plane=denoised]').isDisabled(), 'a strategy that does not learn denoises nothing');
  const curves = await page.locator('#chart .curve').count();
  expect(curves === 2, 'the chart compares two strategies');
  await anew(page, () => page.click('[data-rrs=ears]'));
  await rendered(page, 8);
  const picture = await look(page);
  await page.click('[data-plane=factors]');
  await rendered(page, 8);
  const factors = await look(page);
  expect(factors.hash !== picture.hash && factors.different > 0.02, 'factors are shown in false colours');
  await page.screenshot({ path: join(shots, 'desktop-factors.png') });
  await page.click('[data-plane=denoised]');
  await rendered(page, 8);
  expect((await look(page)).hash !== factors.hash, 'the denoised picture is shown');
  await page.click('[data-plane=picture]');

  await anew(page, () => page.locator('#places button').last().click());
  await rendered(page, 4);
  expect(await page.locator('#places button').last().textContent() === '3 workers', 'there are three workers');
  expect((await look(page)).different > 0.2, 'workers render');
  await page.waitForFunction(() => document.documentElement.dataset.relmse !== '', null, LONG);
  const ofAll = Number(await page.evaluate(() => document.documentElement.dataset.relmse));
  expect(ofAll > 0 && ofAll < 0.1, `their mean has an error like that of one picture: ${ofAll.toFixed(4)}`);
  await page.screenshot({ path: join(shots, 'desktop-workers.png') });
  await anew(page, () => page.locator('#places button').first().click());

  await drop(page, 'broken.obj', 'v 0 0 0\nf 1 2 3\n');
  await page.waitForSelector('#problem:not([hidden])', LONG);
  expect((await page.locator('#problem').textContent()).includes('line 2'), 'a broken file is refused by line');
  await drop(page, 'broken.crp', 'nothing');
  await page.waitForFunction(() => document.getElementById('problem').textContent.includes('no scene'), null, LONG);
  await anew(page, () => drop(page, 'roof.obj', OBJ));
  expect(await page.evaluate(() => document.documentElement.dataset.scene) === 'obj', 'a dropped file is the scene');
  await rendered(page, 4);
  expect((await look(page)).different > 0.2, 'a dropped file is rendered');
  expect((await page.locator('#about').textContent()).includes('roof.obj: 14 triangles'), 'it is named');
  await page.evaluate(() => { document.getElementById('problem').hidden = true; });
  await page.screenshot({ path: join(shots, 'desktop-obj.png') });
  await page.close();

  console.log('phone');
  const phone = await open({ width: 390, height: 844 });
  await rendered(phone, 4);
  const fits = await phone.evaluate(() => document.documentElement.scrollWidth <= innerWidth);
  expect(fits, 'nothing is wider than the screen');
  const still = await look(phone);
  await anew(phone, () => swipe(phone));
  await rendered(phone, 4);
  expect((await look(phone)).hash !== still.hash, 'a finger turns the camera');
  await phone.screenshot({ path: join(shots, 'phone.png') });
  await phone.screenshot({ path: join(shots, 'phone-whole.png'), fullPage: true });

  if (complaints.length) throw new Error(`the browser complains:\n${complaints.join('\n')}`);
  console.log('no complaints');
  writeFileSync(join(shots, 'hash.txt'), `${NATIVE}\n`);
} finally {
  await context.close();
  server.close();
  rmSync(profile, { recursive: true, force: true });
}
