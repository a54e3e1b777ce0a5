// The page: a picture of the code, the hands on it, and the bar that tells where one is.

import { ready, unpacked } from "./code.mjs";
import { Colouring } from "./colouring.mjs";
import { PLAIN, fromLink, hasOwn, ownGround, rgbOf, toLink } from "./colours.mjs";
import { Editor } from "./editor.mjs";
import { keyMove, listenToPointers } from "./gestures.mjs";
import { Notebook } from "./notebook.mjs";
import { Picture } from "./picture.mjs";
import { plain } from "./reading.mjs";
import { asAddress, copy, download, isSandboxed } from "./taking.mjs";
import {
  between, fromFragment, panned, shownAddress, shownZoom, toFragment, zoomed,
} from "./view.mjs";

const GLIDE = 220; // ms of a smooth zoom
const FURTHEST = 1 / 16; // of the first view's zoom
const ADDRESS_EVERY = 400; // ms between writes of the page's address: browsers refuse more
const MILLION = 1e6;

const $ = (id) => document.getElementById(id);
const given = JSON.parse($("given").textContent);
const surface = $("picture");
const usual = { ...PLAIN, by: hasOwn(given.code) ? "own" : "plain" }; // choice of colours
const calm = matchMedia("(prefers-reduced-motion: reduce)"), dark = matchMedia("(prefers-color-scheme: dark)");
let home = given.home;
let view = fromFragment(location.hash, least()) ?? given.view;
let glide = null, swapped = false, picture = null, editor = null, colouring = null, notebook = null;
let found = null; // the ground of the code's own colours
let writing = 0;

/** The least zoom. */
function least() {
  return home.zoom * FURTHEST;
}

function sides() {
  const box = surface.getBoundingClientRect();
  return [box.width, box.height];
}

function go(next) {
  view = next;
  $("zoom").textContent = `×\u202f${shownZoom(view.zoom / home.zoom)}`;
  picture?.look(view);
  editor?.show();
  writing ||= setTimeout(writeAddress, ADDRESS_EVERY);
}

function writeAddress() {
  writing = 0;
  $("said").textContent = `Zoom ${shownZoom(view.zoom / home.zoom)}`;
  try {
    history.replaceState(null, "", toFragment(view) + toLink(colouring.choice, usual));
  } catch {
    // a sandboxed frame may have no address of its own; the link is still offered as text
  }
}

function glideTo(to) {
  if (calm.matches) return stopGliding(), go(to);
  glide = { from: view, to, since: performance.now() };
  requestAnimationFrame(glideOn);
}

function glideOn(now) {
  if (!glide) return;
  const t = Math.min(1, Math.max(0, (now - glide.since) / GLIDE));
  go(between(glide.from, glide.to, t * (2 - t)));
  if (t < 1) requestAnimationFrame(glideOn);
  else glide = null;
}

function stopGliding() {
  if (glide) go(glide.to);
  glide = null;
}

const moves = {
  pan(dx, dy) {
    stopGliding();
    go(panned(view, dx, dy, ...sides()));
  },
  zoom(factor, column, row, smooth) {
    stopGliding();
    const to = zoomed(view, factor, column, row, ...sides(), least());
    if (smooth) glideTo(to);
    else go(to);
  },
  home() {
    stopGliding();
    home = editor?.home() ?? home;
    glideTo(home);
  },
  swap() {
    swapped = !swapped;
    paint();
  },
  async save() {
    if (!picture) return;
    picture.showAgain();
    const blob = await new Promise((resolve) => surface.toBlob(resolve, "image/png"));
    if (!isSandboxed()) return download(blob, `${given.file}.png`);
    $("still").src = await asAddress(blob);
    $("still").hidden = false;
    offer("This frame lets no page save files. The picture is below: save it from its own menu (right click, or press "
      + "it long).", viewText());
  },
  async link() {
    writeAddress();
    const text = location.protocol === "about:" || isSandboxed() ? viewText() : location.href;
    const edited = editor?.steps.past.length ? ", without the changes of the maps: export those" : "";
    if (await copy(text)) return note(`Copied: the link to this view${edited}`);
    $("still").hidden = true;
    offer("The clipboard is refused here. Copy the text below.", text);
  },
  help() {
    $("help").showModal();
  },
  edit() {
    editor?.toggle();
  },
  colour() {
    colouring?.toggle();
  },
};

/** What the editor knows of the page and makes of it. */
const page = {
  look: () => ({ view, sides: sides() }),
  draw(code) {
    picture.follow(ready(code));
    colouring.offer(hasOwn(code));
    stand(code);
    notebook?.send(code);
  },
  open(to, { meta, rows }) {
    const title = [meta.title, meta.name].find((each) => typeof each === "string" && each.trim());
    named(plain(title ?? `a code of ${rows.length} map${rows.length > 1 ? "s" : ""}`, 120));
    if (!to) return;
    home = to;
    stopGliding();
    go(home);
  },
  scene(box) {
    const [width, height] = sides(), namespace = $("maps").namespaceURI;
    const seen = () => {
      picture.showAgain();
      return surface.toDataURL("image/png");
    };
    return { file: given.file, scene: { view, width, height, box, namespace, picture: seen } };
  },
};

function named(title) {
  $("title").textContent = title;
  document.title = title;
  surface.setAttribute("aria-label", `The attractor of ${title}`);
}

/** The view for the Python package, which goes where a link cannot. */
function viewText() {
  return `View(center=(${view.x}, ${view.y}), zoom=${view.zoom})`;
}

function offer(why, text) {
  $("why").textContent = why;
  $("text").value = text;
  $("offer").showModal();
  $("text").select();
}

let noteTimer = 0;
function note(text) {
  $("note").textContent = text;
  clearTimeout(noteTimer);
  noteTimer = setTimeout(() => { $("note").textContent = ""; }, 2500);
}

/** Draw in the colours chosen. */
function coloured(choice) {
  picture.choose(choice);
  paint();
  writing ||= setTimeout(writeAddress, ADDRESS_EVERY);
}

/** Take the ground of a code's own colours. */
function stand(code) {
  const before = found;
  found = ownGround(code);
  if (found !== before) paint();
}

function paint() {
  const light = dark.matches === swapped;
  document.documentElement.style.colorScheme = light ? "light" : "dark";
  const [ground, ink] = light ? [[1, 1, 1], [0, 0, 0]] : [[0, 0, 0], [1, 1, 1]], choice = colouring?.choice;
  const own = choice?.ground ?? (choice?.by === "own" ? found : null);
  picture?.paint(own ? rgbOf(own) : ground, ink);
  $("do-swap").setAttribute("aria-pressed", String(swapped));
}

function told({ drawing, empty, kept, thrown, goal, common, heaviest }) {
  document.documentElement.dataset.state = drawing ? "drawing" : "done";
  $("points").textContent = empty ? "nothing here" : `${points(thrown)} points`;
  $("progress").style.transform = `scaleX(${empty ? 1 : Math.min(1, kept / goal)})`;
  const word = shownAddress(heaviest), head = shownAddress(common);
  $("address").textContent = head || (word ? "whole" : "–");
  $("address").title = word ? `Every point here begins with: ${head || "–"}. The heaviest word: ${word}` : "";
  if (empty) note("No point of the attractor is in this view; press 0 for the whole");
}

function points(count) {
  return count < MILLION ? `${Math.round(count / 1000)}\u202f000` : `${(count / MILLION).toFixed(1)} million`;
}

function fit() {
  const ratio = window.devicePixelRatio || 1;
  const [width, height] = given.size ?? sides().map((side) => Math.max(1, Math.round(side * ratio)));
  picture?.resize(width, height);
  editor?.show();
}

function onKey(event) {
  if (document.querySelector("dialog[open]")) return;
  const types = event.target.closest?.("input, select, textarea");
  if (types && !event.ctrlKey && !event.metaKey) return;
  const move = editor.key(event) ? () => {} : keyMove(event);
  if (!move) return;
  event.preventDefault();
  move(moves, ...sides());
}

/** Let the picture have its own size in pixels, scaled to fit into the window. */
function frame([width, height]) {
  const { style, dataset } = document.documentElement;
  dataset.sized = "";
  style.setProperty("--ratio", width / height);
}

function start() {
  if (given.size) frame(given.size);
  $("title").textContent = given.title;
  for (const name of ["home", "edit", "colour", "swap", "link", "save", "help"]) {
    $(`do-${name}`).addEventListener("click", moves[name]);
  }
  const middle = (factor) => () => moves.zoom(factor, sides()[0] / 2, sides()[1] / 2, true);
  $("closer").addEventListener("click", middle(2));
  $("further").addEventListener("click", middle(1 / 2));
  for (const dialog of document.querySelectorAll("dialog")) {
    dialog.querySelector("form button").addEventListener("click", () => dialog.close());
    dialog.addEventListener("close", () => surface.focus());
  }
  $("text").addEventListener("focus", () => $("text").select());
  const code = unpacked(given.code);
  try {
    picture = new Picture(surface, ready(code), told, new URLSearchParams(location.search).get("thrower"));
  } catch (error) {
    surface.hidden = true;
    $("do-edit").hidden = true;
    $("do-colour").hidden = true;
    note(`A still picture only: ${error.message}`);
    clearTimeout(noteTimer);
    return;
  }
  const chosen = fromLink(location.hash, usual, hasOwn(code));
  colouring = new Colouring(chosen, hasOwn(code), coloured);
  picture.choose(chosen);
  stand(code);
  editor = new Editor(code, home, surface, page);
  if (given.live) {
    notebook = new Notebook({ show: (read, first) => editor.replace(read, { undoable: !first }), refuse: note });
  }
  listenToPointers(surface, moves);
  document.addEventListener("keydown", onKey);
  addEventListener("hashchange", () => {
    const to = fromFragment(location.hash, least());
    if (!to) return;
    stopGliding();
    go(to);
    colouring.choose(fromLink(location.hash, usual, colouring.hasOwn));
  });
  dark.addEventListener("change", paint);
  new ResizeObserver(fit).observe(surface);
  paint();
  fit();
  go(view);
}

start();
