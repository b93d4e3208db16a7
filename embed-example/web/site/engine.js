// Renders a picture in slices of time: on the page between two frames, in a worker between two messages.

import { Picture, Scene } from './croupier.js';

/** Most samples per pixel of an iteration: error, factors and statistics are renewed after each. */
const LARGEST_ITERATION = 4;

/** An instance of the module with a scene and a picture of it. The clock is here, not in the module. */
export class Engine {
  constructor(core) {
    this.core = core;
    /** Rays per millisecond of steps, measured; and of merging and learning, which counts its work as rays. */
    this.pace = { step: 200, finish: 200 };
    this.picture = null;
  }

  /** Opens a scene; settings as in `Picture`. What was there before is gone. */
  open(blob, settings) {
    this.picture = null;
    this.core.reset();
    this.scene = new Scene(this.core, blob);
    this.picture = new Picture(this.core, this.scene, settings);
    this.begin();
  }

  /** Looks from elsewhere; the picture begins anew, what roulette has learned stays. */
  look(camera) {
    this.scene.look(camera);
    this.picture.restart();
    this.begin();
  }

  begin() {
    this.phase = 'next';
    this.elapsed = 0;
    this.last = performance.now();
    this.samples = 0;
    /** Of the finished iterations, at the end of the last one. */
    this.result = null;
  }

  /** Works for about so many milliseconds; true if an iteration has ended. */
  work(milliseconds) {
    const { picture, pace } = this;
    const start = performance.now();
    const end = start + milliseconds;
    let ended = false;
    // Time between slices counts: the picture takes it. Time in which nobody looked does not.
    this.elapsed += Math.min(start - this.last, 250);
    this.last = start;
    // One call takes the whole slice if its pace was guessed well.
    for (let now = start; now < end - 0.3; ) {
      if (this.phase === 'next') {
        this.iteration = Math.min(Math.max(this.samples, 1), LARGEST_ITERATION);
        picture.begin(this.iteration);
        this.phase = 'step';
      }
      const phase = this.phase;
      const rays = Math.max(64, Math.round(pace[phase] * (end - now)));
      const done = phase === 'step' ? picture.step(rays) : picture.finish(rays);
      const after = performance.now();
      if (!done) {
        // Clocks of browsers are coarse; never more than twice the pace at once.
        const measured = rays / Math.max(after - now, 0.05);
        pace[phase] += 0.3 * (Math.min(measured, 2 * pace[phase]) - pace[phase]);
      } else if (phase === 'step') {
        this.phase = 'finish';
      } else {
        this.samples += this.iteration;
        this.phase = 'next';
        this.result = { ...picture.numbers(), seconds: (this.elapsed + after - start) / 1000 };
        ended = true;
      }
      now = after;
    }
    return ended;
  }

  /** Whether `show` gives a whole picture: not while an iteration is merged. */
  showable() {
    return this.phase !== 'finish';
  }
}
