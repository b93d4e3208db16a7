// Workers that render the same view, each with a seed of its own. Sessions do not share memory, so they share nothing
// that is learned either; pictures of different seeds are independent, and their mean by samples is a picture of all
// of them.

export class Crowd {
  /** @param {(text: string) => void} problem called with messages of workers */
  constructor(module, count, problem) {
    this.count = count;
    this.generation = 0;
    this.workers = Array.from({ length: count }, (_, k) => {
      const worker = new Worker('worker.js', { type: 'module' });
      worker.onmessage = ({ data }) => (data.error ? problem(data.error) : this.take(k, data));
      worker.onerror = (e) => problem(e.message);
      worker.postMessage({ module });
      return worker;
    });
    this.clear();
  }

  clear() {
    this.results = [];
    this.shown = [];
    this.paces = [];
    this.fresh = false;
    this.changed = false;
  }

  open(blob, settingsOf) {
    this.clear();
    this.generation++;
    this.workers.forEach((worker, k) => {
      worker.postMessage({ blob, settings: settingsOf(k), generation: this.generation });
    });
  }

  look(camera) {
    this.clear();
    this.generation++;
    for (const worker of this.workers) worker.postMessage({ camera, generation: this.generation });
  }

  /** Which plane pictures are to show from now on. */
  show(plane) {
    this.plane = plane;
    this.shown = [];
    for (const worker of this.workers) worker.postMessage({ plane });
  }

  stop() {
    for (const worker of this.workers) worker.terminate();
  }

  take(k, { generation, result, shown, plane, pace }) {
    if (generation !== this.generation) return;
    this.paces[k] = pace;
    if (result) [this.results[k], this.changed] = [result, true];
    if (shown && plane === this.plane) [this.shown[k], this.fresh] = [shown, true];
  }

  /** Rays per millisecond of all. */
  pace() {
    return this.paces.reduce((sum, x) => sum + (x ?? 0), 0);
  }

  /** What `Painter` averages. */
  pictures() {
    this.fresh = false;
    return this.shown.filter(Boolean);
  }

  /**
   * Result of the averaged picture, null if nothing is new: the error of a mean of independent pictures with shares w
   * is the sum of w^2 times theirs, and the interval's half widths add up as squares of w^2 times theirs.
   */
  takeResult() {
    const all = this.results.filter(Boolean);
    if (!this.changed || all.length < this.count) return null;
    this.changed = false;
    const spp = all.reduce((sum, r) => sum + r.spp, 0);
    const squares = all.map((r) => (r.spp / spp) ** 2);
    const sum = (of) => all.reduce((total, r, k) => total + of(r, squares[k]), 0);
    const relMse = sum((r, w) => w * r.relMse);
    const half = Math.sqrt(sum((r, w) => (w * (r.high - r.relMse)) ** 2));
    return {
      relMse, low: Math.max(0, relMse - half), high: relMse + half, spp, rays: sum((r) => r.rays),
      seconds: Math.max(...all.map((r) => r.seconds)),
    };
  }
}
