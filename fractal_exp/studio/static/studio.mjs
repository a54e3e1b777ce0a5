// The studio's page: what the studio tells is shown, and what hands want is asked of it.

import { Channel } from "./channel.mjs";
import { Crop } from "./crop.mjs";
import { Stage } from "./stage.mjs";

const ACTS = ["stop", "go_on", "save", "back", "forth", "mend", "resume", "discard"]; // that take nothing more
const SEARCHES = ["find", "polish"];
const DOING = {
  read: "The picture is being read …", judge: "The code is being judged …", save: "Saving …", find: "Searching …",
  polish: "Polishing …",
};

const $ = (id) => document.getElementById(id);
/** What a change of an argument is called on a button: "Search with 20 maps". */
const REMEDIES = {
  seconds: (seconds) => `Search for ${seconds} s`, maps: (maps) => `Search with ${maps} maps`,
  levels: (levels) => `Search with grey levels: ${optionText("levels", levels)}`,
  resolution: (side) => `Read at ${side} × ${side} px and search`,
  invert: (dark) => `Read as ${optionText("read-invert", dark)} and search`,
};
const optionText = (id, value) => $(id).querySelector(`option[value="${value}"]`).textContent;
let state = null, mine = new Set(); // the marks of codes that hands have made here

const channel = new Channel(heard, (open, reason) => {
  $("lost").hidden = open;
  $("lost").textContent = reason || "The studio does not answer. What was found is kept there; this page goes on as soon "
    + "as it is back.";
  if (!open) disable(true);
});
const stage = new Stage((code) => {
  const mark = crypto.randomUUID();
  mine.add(mark); // what comes back of it is on the stage already
  if (!channel.ask("edit", { code, mark })) say("The studio does not answer: the change was not kept");
}, say, (meta) => {
  const { name, sha256 } = meta?.picture ?? {};
  return sha256 && sha256 !== state?.picture?.digest ? String(name) : "";
});
const crop = new Crop(read);

function heard(word) {
  if (word.told === "progress") return progress(word);
  if (word.told === "refused") {
    say(word.why);
    if (state) show(state, true);
    return;
  }
  const before = state;
  state = word;
  show(before, false);
}

function say(text) {
  $("said").textContent = text;
}

function show(before, again) {
  const { task, picture, version, why } = state, searching = SEARCHES.includes(task);
  if (!again && (why || before?.task !== task)) say(why);
  if (before?.version.picture !== version.picture || again) showPicture();
  if ((before?.version.code !== version.code && !mine.has(state.mark)) || again) {
    mine = new Set();
    stage.showCode(state.code);
  }
  showScores();
  showSaved();
  showOffer();
  $("stage-said").textContent = state.stopping ? "Stopping: the best code is kept …" : DOING[task]
    ?? (state.ready || !picture ? "" : "The search gets ready …");
  $("status").textContent = state.verdict?.words ?? DOING[task] ?? "";
  $("bar").hidden = !searching;
  if (!searching) $("bar").value = 0;
  disable(false);
}

function disable(all) {
  const { task, picture, code, can_go_on: on, stopping, judged, back, forth } = state ?? {};
  const free = !all && task === "", searching = SEARCHES.includes(task), nearly = !all && (free || task === "judge");
  $("do-find").disabled = !(nearly && picture);
  $("do-stop").disabled = all || !searching || stopping;
  $("do-go_on").disabled = !(nearly && on);
  $("do-polish").disabled = !(nearly && code);
  $("do-back").disabled = !(nearly && back);
  $("do-forth").disabled = !(nearly && forth);
  $("do-mend").disabled = !free;
  $("do-save").disabled = !(free && code && judged);
  $("reading").disabled = !(free && picture);
  $("settings").disabled = !(nearly && picture);
  $("file").disabled = !free;
  stage.allow(!all && Boolean(code) && !searching && task !== "read");
}

function showPicture() {
  const { picture, version } = state;
  document.body.classList.toggle("has-picture", Boolean(picture));
  $("understood").hidden = !picture;
  stage.showPicture(picture && `target.png?version=${version.picture}`);
  if (!picture) return;
  $("given").src = `given.png?version=${version.picture}`;
  const { width, height, square, reading } = picture;
  crop.show([width, height], square, reading.crop);
  $("picture-name").textContent = `${picture.name}, ${width} × ${height} px`;
  const line = (text, kind) => Object.assign(document.createElement("li"), { textContent: text, className: kind });
  $("notes").replaceChildren(...picture.warnings.map((text) => line(text, "warning")),
    ...picture.notes.map((text) => line(text, "")));
  $("read-invert").value = String(reading.invert);
  $("read-frame").value = reading.frame;
  $("read-threshold").value = reading.threshold ?? "";
  $("read-clean").checked = reading.clean;
  $("upload-said").textContent = "";
}

function showOffer() {
  const { offer } = state;
  $("offer").hidden = !offer;
  if (!offer) return;
  const maps = offer.maps ? `a code of ${offer.maps} maps` : "a search that was stopped";
  $("offer-text").textContent = `The session of ${offer.when} over ${offer.name} ended with ${maps} that was not saved.`;
}

function showScores() {
  const { likeness, verdict, code, curve, coloured, apart, judged, settings, version } = state;
  const short = (share) => (typeof share === "number" ? share.toFixed(3) : "–");
  $("scores").hidden = $("legend").hidden = !code;
  $("f1").textContent = short(likeness);
  $("map-count").textContent = code ? code.linear.length : "–";
  $("colour").checked = settings.colour;
  $("apart-line").hidden = !(judged && settings.colour);
  $("apart").textContent = coloured ? apart?.toFixed(1) ?? "–" : "none found";
  $("in-colour").hidden = !coloured;
  const source = `redrawn.png?version=${version.code}`; // none anew for the same code
  if (coloured && $("redrawn").getAttribute("src") !== source) $("redrawn").src = source;
  $("verdict").textContent = verdict?.words ?? "";
  $("remedy").textContent = verdict?.remedy ? `May help: ${verdict.remedy}` : "";
  $("dimension").textContent = state.dimension && `Dimension: ${state.dimension}`;
  const [change] = Object.entries(verdict?.change ?? {});
  $("do-mend").hidden = !change;
  if (change) $("do-mend").textContent = REMEDIES[change[0]](change[1]);
  $("curve-line").hidden = curve.length < 2;
  const options = curve.map(({ maps, likeness: f1 }, i) => new Option(`${maps} maps, F1 ${short(f1)}`, i));
  $("curve").replaceChildren(new Option("as chosen", ""), ...options);
}

function showSaved() {
  const { folder, names = [], run, not_tracked: not } = state.saved;
  $("saved").textContent = !folder ? "" : `Saved in ${folder}. ${run ? `Tracked; see it with ${run}`
    : not ? `Not tracked: ${not}` : "It is being tracked …"}`;
  $("saved-files").replaceChildren(...names.map((name) => {
    const item = document.createElement("li");
    item.append(Object.assign(document.createElement("a"), { href: `saved/${name}`, download: name, textContent: name }));
    return item;
  }));
}

function progress({ seconds, left, stage: name, fraction, error }) {
  if (!state || state.stopping) return;
  $("bar").value = fraction;
  const rest = left === null ? "" : `, about ${left.toFixed(0)} s left`;
  const far = error === null ? "" : `, error ${error.toPrecision(2)}`;
  $("stage-said").textContent = `${name}: ${seconds.toFixed(0)} s${rest}${far}`;
}

/** The number in a field, null where it is empty. */
function numberIn(id) {
  const text = $(id).value.trim();
  return text === "" ? null : Number(text);
}

function settings() {
  const colour = $("colour").checked;
  return { seconds: numberIn("seconds"), maps: numberIn("count"), levels: $("levels").value, colour };
}

function read() {
  const invert = { auto: "auto", true: true, false: false }[$("read-invert").value];
  channel.ask("read", { reading: { invert, frame: $("read-frame").value, threshold: numberIn("read-threshold"),
    clean: $("read-clean").checked, crop: crop.part, resolution: state.picture.reading.resolution } });
}

async function send(file) {
  if (!file) return;
  const unsaved = state?.code && !state.saved.folder;
  if (unsaved && !confirm("The code is not saved, and would go with its picture. Take another picture?")) return;
  $("upload-said").textContent = "";
  $("upload-said").textContent = (await channel.send(file)) ?? "";
  $("file").value = "";
}

function listen() {
  const ask = (act, more) => {
    if (act === "discard" && !confirm("Delete what that session found, for good?")) return;
    stage.flush();
    channel.ask(act, more);
  };
  for (const act of ACTS) $(`do-${act}`).addEventListener("click", () => ask(act));
  for (const act of SEARCHES) $(`do-${act}`).addEventListener("click", () => ask(act, { settings: settings() }));
  $("file").addEventListener("change", () => send($("file").files[0]));
  $("reading").addEventListener("change", ({ target }) => {
    if (!target.closest("#part-fields")) read();
  });
  $("colour").addEventListener("change", () => {
    stage.flush();
    channel.ask("colour", { yes: $("colour").checked });
  });
  $("curve").addEventListener("change", () => {
    if ($("curve").value) channel.ask("choose", { index: Number($("curve").value) });
  });
  addEventListener("dragover", (event) => {
    event.preventDefault();
    document.body.classList.add("dropping");
  });
  addEventListener("dragleave", ({ relatedTarget }) => {
    if (!relatedTarget) document.body.classList.remove("dropping");
  });
  addEventListener("drop", (event) => {
    event.preventDefault();
    document.body.classList.remove("dropping");
    send(event.dataTransfer.files[0]);
  });
  addEventListener("paste", (event) => {
    const [file] = event.clipboardData?.files ?? [];
    if (file) send(file);
  });
}

listen();
disable(true);
