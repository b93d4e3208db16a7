// The page of `croupier report` in headless Chromium: every figure is there, shown in one width, and none is wider than
// its place, on a desktop and on a phone, in light and in dark; nothing is asked from elsewhere. Pictures of it go to a
// folder, to be looked at.
//
// node report.mjs REPORT [FOLDER]      with the browser of $CHROMIUM, /usr/bin/chromium otherwise
import { mkdirSync, mkdtempSync, readdirSync, rmSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join, resolve } from 'node:path';
import { pathToFileURL } from 'node:url';
import { chromium } from 'playwright-core';

const report = resolve(process.argv[2] ?? 'report');
const shots = resolve(process.argv[3] ?? join(report, 'shots'));
mkdirSync(shots, { recursive: true });
const figures = readdirSync(report).filter((name) => name.endsWith('.svg')).map((name) => name.slice(0, -4));

function expect(holds, what) {
  if (!holds) throw new Error(`not so: ${what}`);
  console.log(`  ${what}`);
}

/** Everything that is wrong with the page as it is shown now. Runs in the page. */
function faults(names) {
  const wrong = [];
  const shown = (e) => getComputedStyle(e).display !== 'none';
  const width = document.documentElement.clientWidth;
  if (document.documentElement.scrollWidth > width) {
    const wide = [...document.querySelectorAll('main *, header *')].filter((e) => !e.closest('.table')
      && e.getBoundingClientRect().right > width + 1).slice(0, 5).map((e) => `${e.tagName}.${e.className}`);
    wrong.push(`the page is ${document.documentElement.scrollWidth} wide: ${wide}`);
  }
  for (const name of names) {
    const figure = document.getElementById(name);
    if (!figure) { wrong.push(`no figure ${name}`); continue; }
    const plots = [...figure.querySelectorAll('svg')].filter(shown);
    if (plots.length !== 1) { wrong.push(`${name}: ${plots.length} of its widths are shown`); continue; }
    const box = plots[0].getBoundingClientRect();
    if (box.width < 250 || box.height < 60) wrong.push(`${name}: ${box.width}x${box.height} pixels`);
    if (box.left < 0 || box.right > width + 1) wrong.push(`${name}: from ${box.left} to ${box.right} of ${width}`);
    const marks = plots[0].querySelectorAll('polyline, circle, rect, polygon, line').length;
    if (marks < 5) wrong.push(`${name}: ${marks} marks`);
    const texts = [...plots[0].querySelectorAll('text')].filter((e) => e.textContent.trim()).map((e) => [e.textContent.trim(), e.getBoundingClientRect()]);
    if (texts.length < 4) wrong.push(`${name}: ${texts.length} texts`);
    for (const [text, t] of texts) {
      if (t.left < box.left - 2 || t.right > box.right + 2 || t.top < box.top - 2 || t.bottom > box.bottom + 2) {
        wrong.push(`${name}: "${text}" is cut off`);
      }
      if (t.height < 8) wrong.push(`${name}: "${text}" is ${t.height} pixels high`);
    }
    // neighbours that cannot be read
    for (const [i, [a, s]] of texts.entries()) {
      for (const [b, t] of texts.slice(i + 1)) {
        const across = Math.min(s.right, t.right) - Math.max(s.left, t.left);
        const down = Math.min(s.bottom, t.bottom) - Math.max(s.top, t.top);
        const small = Math.min(s.width * s.height, t.width * t.height);
        if (across > 0 && down > 0 && across * down > 0.4 * small && name !== 'kernels') {
          wrong.push(`${name}: "${a}" lies on "${b}"`);
        }
      }
    }
    if (/var\(|#[0-9a-f]{6}"/i.test(plots[0].outerHTML.replace(/"var\(--\w+\)"/g, ''))) {
      wrong.push(`${name}: a colour without a variable`);
    }
  }
  return wrong;
}

const profile = mkdtempSync(join(tmpdir(), 'croupier-report-'));
const context = await chromium.launchPersistentContext(profile, {
  executablePath: process.env.CHROMIUM ?? '/usr/bin/chromium',
  headless: true,
  args: [
    '--no-sandbox', '--disable-gpu', '--disable-quic', '--no-first-run', '--disable-background-networking',
    '--disable-component-update', '--disable-sync', '--allow-file-access-from-files',
  ],
});
const complaints = [];
try {
  const needed = ['error-0', 'times-0', 'settings-0', 'depth-0', 'reliability', 'kernels', 'primitives',
    ...['scattering', 'lights', 'media'].flatMap((group) => [`components-${group}`, `twins-${group}`])];
  const missing = needed.filter((name) => !figures.includes(name));
  const there = `there are ${figures.length} figures, and all that must be`;
  expect(missing.length === 0, missing.length ? `no ${missing}` : there);
  for (const [device, size] of [['desktop', { width: 1280, height: 900 }], ['phone', { width: 390, height: 844 }]]) {
    for (const colorScheme of ['light', 'dark']) {
      console.log(`${device}, ${colorScheme}`);
      const page = await context.newPage();
      page.on('console', (m) => { if (['error', 'warning'].includes(m.type())) complaints.push(m.text()); });
      page.on('pageerror', (e) => complaints.push(e.message));
      page.on('request', (r) => { if (!/^(file|data):/.test(r.url())) complaints.push(`asks for ${r.url()}`); });
      page.setDefaultTimeout(240_000);
      await page.setViewportSize(size);
      await page.emulateMedia({ colorScheme });
      await page.goto(pathToFileURL(join(report, 'index.html')).href);
      await page.evaluate(() => document.querySelectorAll('details').forEach((d) => { d.open = true; }));
      const wrong = await page.evaluate(faults, figures);
      expect(wrong.length === 0, wrong.length ? wrong.join('\n    ') : 'every figure is there and in its place');
      // what is said in tables: every section has its rows, and only tables scroll
      const empty = await page.evaluate(() => [...document.querySelectorAll('main .table')]
        .filter((t) => t.querySelectorAll('tbody tr').length === 0).map((t) => t.closest('section').id));
      expect(empty.length === 0, empty.length ? `empty tables in ${empty}` : 'every table has rows');
      const says = await page.evaluate(() => document.querySelector('main').textContent);
      const needed = ['time to 1 %', 'bias floor', 'right, of all', 'within 25 %', 'missed', 'against f64',
        'instructions / 8 lanes'];
      for (const text of needed) {
        if (!says.includes(text)) throw new Error(`the page does not say "${text}"`);
      }
      const [paper, ink] = await page.evaluate(() => {
        const { backgroundColor, color } = getComputedStyle(document.body);
        return [backgroundColor, color].map((c) => c.match(/\d+/g).map(Number).reduce((a, b) => a + b));
      });
      expect(colorScheme === 'dark' ? paper < 150 && ink > 500 : paper > 600 && ink < 200, 'paper and ink are of the theme');
      const drawn = await page.evaluate(() => getComputedStyle(document.querySelector('figure svg text')).fill);
      expect((drawn.match(/\d+/g).map(Number)[0] > 128) === (colorScheme === 'dark'), 'figures are of it, too');
      await page.evaluate(() => document.querySelectorAll('details').forEach((d) => { d.open = false; }));
      await page.screenshot({ path: join(shots, `${device}-${colorScheme}.png`), fullPage: true });
      await page.screenshot({ path: join(shots, `${device}-${colorScheme}-top.png`) });
      await page.close();
    }
  }
  if (complaints.length) throw new Error(`the browser complains:\n${complaints.join('\n')}`);
  console.log('no complaints');
} finally {
  await context.close();
  rmSync(profile, { recursive: true, force: true });
}
