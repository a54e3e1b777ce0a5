// A picture that draws itself: coarse while the view moves, then as fine as the package's `render`, then at rest.

import { PLAIN, foldsOf, whiteOf } from "./colours.mjs";
import { isSoftware, throwByHand } from "./hand.mjs";
import { DRAW, POOL, Pool, placeIn, shareInView, shareOut } from "./points.mjs";
import { randomNumbers } from "./random.mjs";
import { COUNTING, Renderer } from "./renderer.mjs";
import { exposureOf, toneOf } from "./tone.mjs";
import { windowOf } from "./view.mjs";
import { addressTree, cut } from "./words.mjs";

const PER_SUBPIXEL = 50e6 / (1024 * 1024 * 64); // points in view, as `render` throws them by default
const FINE = [8, 4, 2, 1]; // subpixels along a side of a pixel, the first that fits
const COARSE = 2;
const MOST_SUBPIXELS = { lit: 2 ** 26, colour: 2 ** 25, count: 2 ** 26 };
const KINDS = { plain: "lit", density: "count" }; // of canvas, by choice; the others need colours
const REST = 160; // ms after the last movement, until the fine picture begins
const FIRST_SHOWN = 1 / 16; // of the fine picture's points: from then on it is no noisier than the coarse one
const SHARPER = 1.6; // times as many points between one showing and the next
const SOON = { coarse: 20, fine: 40 }; // ms that a batch of draws may take
const SLOW = 60; // ms for one draw: then the processor is quicker than the GPU
const MOST_DRAWS = 32, FOLLOWING = 4; // the latter for the first picture of another code
const EFFORT = { coarse: { visits: 60_000, most: 128 }, fine: { visits: 600_000, most: 512 } }; // of a cut
const CUTS = { coarse: 2, fine: 24 }; // of a picture where words are drawn by lot, if they take no longer than this:
const CUTTING = { coarse: 30, fine: 1000 }; // ms of cutting for a picture
const HEAVIEST = 8; // times as many points for a heavy cut
const LEAST_SHARE = 1e-3; // of the points in view, taken for the goal where hardly any is found
const MOST_THROWN = 40; // times the goal, where most points miss the view

/**
 * Draws a code into a canvas. `told` is called with what is known of the picture whenever that changes. thrower: "gpu"
 * or "cpu" throws the points; by default the GPU, where it is one and quick enough.
 */
export class Picture {
  constructor(canvas, code, told, thrower = null) {
    Object.assign(this, { canvas, told, thrower });
    Object.assign(this, { code, choice: PLAIN });
    this.tree = addressTree(code);
    this.random = randomNumbers(20_251);
    this.pool = new Pool(this.tree);
    this.colours = { ground: [0, 0, 0], ink: [1, 1, 1] };
    this.view = null;
    this.shown = null;
    this.draws = 4;
    canvas.addEventListener("webglcontextlost", (event) => {
      event.preventDefault();
      this.renderer = null;
    });
    canvas.addEventListener("webglcontextrestored", () => this.begin());
    this.begin();
  }

  /** What belongs to the GPU, made anew after a context was lost too. */
  begin() {
    this.renderer = new Renderer(this.canvas);
    this.renderer.setPoints(this.pool.points, this.pool.shades);
    this.software = this.thrower ? this.thrower === "cpu" : isSoftware(this.renderer.name);
    this.targets = {};
    this.busy = null;
    this.stage = null;
    this.shown = null;
    this.wake();
  }

  /** The kind of canvas that the choice of colours needs. */
  get kind() {
    if (this.tree.folds) return this.tone ? "tinted" : "colour";
    return this.tone ? "count" : KINDS[this.choice.by] ?? "lit";
  }

  /** The tone with which the code is drawn: its own, or where it has colours, that of its cover; null for none. */
  get tone() {
    const { plain } = this.code, tone = this.choice.by === "own" ? toneOf(plain) : null;
    if (!plain.colours) return tone;
    return tone?.cover ? { ...tone, light: tone.cover } : null;
  }

  /** Whether the canvas counts points. */
  get counting() {
    return COUNTING.includes(this.kind);
  }

  /** Whether the processor throws the points: where it is quicker, and where the GPU cannot count. */
  get byHand() {
    return this.software || (this.counting && !this.renderer?.counts);
  }

  /** Draw another code from now on, in the same view. */
  follow(code) {
    const before = this.kind;
    this.code = code;
    this.tree = addressTree(code, foldsOf(code.plain, this.choice));
    this.pool.follow(this.tree);
    if (this.kind !== before) this.forget();
    if (this.renderer && !this.byHand) this.renderer.setPoints(this.pool.points, this.pool.shades);
    this.followed = true;
    if (this.view) this.look(this.view);
  }

  /** Draw in other colours: {by, palette, tone}, see colours.mjs. A density's palette and tone need no new points. */
  choose(choice) {
    const before = this.choice;
    this.choice = choice;
    const same = before.by === choice.by && (before.palette === choice.palette || ["plain", "own", "density"]
      .includes(choice.by));
    if (same) return this.showAgain();
    this.forget();
    return this.follow(this.code);
  }

  /** Look at {x, y, zoom}. */
  look(view) {
    this.view = view;
    this.stage = null;
    this.movedAt = performance.now();
    this.wake();
  }

  resize(width, height) {
    if (this.canvas.width === width && this.canvas.height === height && this.targets.coarse) return;
    Object.assign(this.canvas, { width, height });
    this.forget();
    if (this.view) this.look(this.view);
  }

  /** Colours of the ground and of the attractor, [r, g, b] in [0,1]. */
  paint(ground, ink) {
    this.colours = { ground, ink };
    this.showAgain();
  }

  /** Show once more what was shown last; the canvas can be read until this task ends. */
  showAgain() {
    if (!this.shown || !this.renderer) return;
    const { target, done, ...measured } = this.shown, { palette, tone } = this.choice;
    this.renderer.show(target, done, { ...this.colours, palette, tone, ...measured });
  }

  wake() {
    if (!this.asked) this.asked = requestAnimationFrame(() => this.tick());
  }

  tick() {
    this.asked = 0;
    if (!this.renderer || !this.view || !this.canvas.width) return;
    if (this.busy && !this.busy.passed()) return this.wake();
    this.measure();
    const rested = performance.now() - this.movedAt >= REST;
    if (this.stage === null) this.start("coarse");
    else if (this.stage.name === "coarse" && rested) this.start("fine");
    if (!this.stage.done) this.work();
    if (!this.stage.done || this.stage.name === "coarse") this.wake();
  }

  /** From how long the last batch took, how many draws the next one has, and whether the GPU is worth its while. */
  measure() {
    if (!this.busy) return;
    const took = this.busy.took ?? performance.now() - this.busy.since;
    const { stage, draws } = this.busy, ratio = SOON[stage.name] / took;
    this.busy = null;
    this.draws = Math.min(MOST_DRAWS, Math.max(1, Math.round(this.draws * Math.min(1.6, Math.max(0.4, ratio)))));
    if (this.byHand || this.thrower || took < SLOW * draws || draws > 2) return;
    this.software = true;
    this.forget();
    this.stage = null;
  }

  /** Give the canvases back. */
  forget() {
    if (this.renderer) Object.values(this.targets).forEach((target) => this.renderer.remove(target));
    this.targets = {};
    this.shown = null;
  }

  start(name) {
    const { width, height } = this.canvas;
    if (name === "fine" && this.pool.filled < POOL) {
      this.pool.fill();
      if (!this.byHand) this.renderer.setPoints(this.pool.points, this.pool.shades);
    }
    const { kind, byHand } = this;
    const target = (this.targets[name] ??= this.renderer.target(width, height, this.supersample(name), byHand, kind));
    this.renderer.clear(target);
    const side = this.counting ? { coarse: COARSE, fine: FINE[0] }[name] : target.supersample;
    const goal = PER_SUBPIXEL * width * height * side ** 2;
    this.stage = { name, target, goal, thrown: 0, kept: 0, shownAt: 0, done: false };
    this.cut();
  }

  supersample(name) {
    const { width, height } = this.canvas;
    if (this.counting) return 1;
    const most = Math.min(this.renderer.mostTexels / Math.max(width, height),
      Math.sqrt(MOST_SUBPIXELS[this.kind] / (width * height)));
    const fine = FINE.find((side) => side <= most) ?? 1;
    return name === "fine" ? fine : Math.min(COARSE, fine);
  }

  cut() {
    const { width, height } = this.canvas, { stage } = this;
    const since = performance.now();
    stage.words = cut(this.tree, windowOf(this.view, width, height), { random: this.random, ...EFFORT[stage.name] });
    stage.first ??= stage.words.total;
    const cuts = Math.max(1, Math.min(CUTS[stage.name], CUTTING[stage.name] / (performance.now() - since)));
    const weight = Math.min(HEAVIEST, stage.words.total / stage.first);
    stage.left = stage.words.sampled ? (stage.goal / cuts) * weight : Infinity; // points that this cut is good for
    if (stage.words.count === 0) return;
    stage.share = shareInView(stage.words, this.pool, this.random, width, height);
    if (!this.byHand) this.renderer.setWords(stage.words, width, height);
  }

  /** One batch of draws. */
  work() {
    const { stage, random } = this, since = performance.now();
    if (stage.left <= 0) this.cut();
    let draws = 0;
    if (stage.words.count > 0) {
      const missing = Math.min(stage.goal - stage.kept, stage.left) / (DRAW * Math.max(stage.share, LEAST_SHARE));
      draws = Math.max(1, Math.min(this.followed ? FOLLOWING : this.draws, Math.ceil(missing)));
      this.followed = false;
      this.slots = shareOut(stage.words, random, this.slots);
      this.throwPoints(Array.from({ length: draws }, () => placeIn(this.pool, random, DRAW)));
      stage.thrown += draws * DRAW;
      stage.kept += draws * DRAW * stage.share;
      stage.left -= draws * DRAW * stage.share;
    }
    stage.done = stage.words.count === 0 || stage.kept >= stage.goal || stage.thrown >= MOST_THROWN * stage.goal;
    const took = performance.now() - since;
    this.showIfSharper();
    this.busy = { stage, draws, since, passed: this.renderer.fence(), took: this.byHand ? took : undefined };
    this.told(this.facts());
  }

  throwPoints(offsets) {
    const { stage, renderer, pool } = this, renewed = pool.renew();
    if (this.byHand) return throwByHand(stage.target, stage.words, this.slots, pool, offsets);
    renderer.setSlots(this.slots);
    for (const [first, points, shades] of renewed) renderer.setPoints(points, shades, first);
    renderer.throwPoints(stage.target, offsets);
  }

  showIfSharper() {
    const { stage } = this, done = Math.max(stage.kept, 1) / stage.goal;
    const due = done >= SHARPER * stage.shownAt && (stage.name === "coarse" || done >= FIRST_SHOWN);
    if (!(due || stage.done)) return;
    stage.shownAt = done;
    const mean = Math.max(stage.kept, 1) / (stage.target.width * stage.target.height);
    const counts = this.counting ? this.renderer.someCounts(stage.target) : [], { tone: own } = this;
    const exposure = own ? exposureOf(counts, mean, own) : 1, white = own ? 1 : whiteOf(counts, mean);
    this.shown = { target: stage.target, done: stage.done ? 1 : done, mean, white, own, exposure };
    this.showAgain();
  }

  facts() {
    const { words, kept, thrown, goal, done, name } = this.stage;
    return {
      drawing: !(done && name === "fine"), empty: words.count === 0 || (done && kept === 0), kept, thrown, goal,
      common: words.common, heaviest: words.heaviest, words: words.count, sampled: words.sampled,
    };
  }
}
