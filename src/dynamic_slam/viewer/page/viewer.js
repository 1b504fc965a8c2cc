// What the server tells, and what the user wishes. docs/viewer.md has the bytes of the messages.
"use strict";

const HELLO = 1, FRAME = 2, MAP = 3, EVENT = 4, PLAYER = 5, HEADER = 12;
const STATES = ["initialising", "tracking", "lost"];
const STATE_COLOURS = ["#f2b84b", "#3ddc84", "#ff5a4f"];
const MAX_EVENTS = 200, SEEK_MS = 120;

const $ = (id) => document.getElementById(id);
const page = {live: null, map: null, video: null, hello: {}, paused: false, lastSeek: 0, seekTimer: 0, events: 0, scrubbing: false, newest: null, frameTimer: 0, lastFrame: 0, sharesProcessors: false};

function setState(state, reason) {
  document.body.dataset.state = state;
  $("state").firstElementChild.textContent = state;
  $("state").lastElementChild.textContent = reason || "";
  $("banner").hidden = state !== "lost";
  $("banner").textContent = `Lost: ${reason}`;
  document.title = `${state} · Dynamic-SLAM`;
}

function setLink(text, isOff) {
  $("link").textContent = text;
  $("link").className = isOff ? "off" : "";
}

function onHello(hello) {
  page.hello = hello;
  const isReplay = hello.mode === "replay";
  $("source").textContent = hello.source || "";
  document.querySelectorAll(".live").forEach((e) => { e.hidden = isReplay; });
  document.querySelectorAll(".replay").forEach((e) => { e.hidden = !isReplay; });
  $("timeline").hidden = !isReplay;
  if (isReplay) {
    $("position").max = hello.states.length - 1;
    drawStates(hello.states);
  }
  setLink(isReplay ? "recording" : `live, ${hello.run}`, false);
  // A browser that draws by software most likely runs beside the SLAM, which needs the processors more.
  page.sharesProcessors = !isReplay && Boolean(page.map) && page.map.isSoftware;
  if (page.map) {
    page.map.sharesProcessors = page.sharesProcessors;
    page.map.camera = hello;
    if (page.known !== hello.source) page.map.clear();
    if (page.map.chases) page.map.placed = false;  // after a jump, at once
    page.map.loops.splice(0).forEach((loop) => page.map.world.remove(loop.tube));
  }
  if (page.known !== hello.source || $("video-canvas").width !== hello.width) page.video.setSize(hello.width, hello.height);
  page.known = hello.source;
  $("events").lastElementChild.replaceChildren();
  page.events = 0;
}

function drawStates(states) {
  const canvas = $("states"), context = canvas.getContext("2d");
  canvas.width = states.length;
  states.forEach((state, i) => {
    context.fillStyle = STATE_COLOURS[state] || "#444";
    context.fillRect(i, 0, 1, canvas.height);
  });
}

function showFacts(facts) {
  const number = (value, digits = 0) => (typeof value === "number" ? value.toFixed(digits) : "–");
  const movers = facts.boxes.filter((box) => box.moves).length;
  const rows = [
    ["Frame", `${facts.frame}${facts.total ? ` <small>of ${facts.total}</small>` : ""}`],
    ["Time", `${number(facts.time % 100000, 2)} <small>s</small>`],
    ["Landmarks seen", `${number(facts.inliers)} <small>of ${number(facts.keypoints)}</small>`],
    ["Culled", `${number(facts.culled)} <small>${number(facts.kept)} kept</small>`],
    ["Objects", `${facts.boxes.length} <small>${movers} move</small>`],
    ["Detector", `<small></small>`],
    ["Keyframes", number(facts.keyframes)],
    ["Landmarks", number(facts.landmarks)],
  ];
  $("facts").innerHTML = rows.map(([name, value]) => `<div><dt>${name}</dt><dd>${value}</dd></div>`).join("");
  // Texts of files and detectors are never taken for markup.
  const detector = $("facts").children[5].lastElementChild.firstElementChild;
  detector.textContent = [facts.detector, facts.detection].filter(Boolean).join(", ");
  detector.title = facts.detection_reason || "";
  $("counts").textContent = `${number(facts.landmarks)} landmarks, ${number(facts.keyframes)} keyframes`;
  const times = Object.entries(facts.ms || {}), longest = Math.max(33, ...times.map(([, ms]) => ms));
  $("times").innerHTML = times.map(([name]) => `<span>${name}</span><div></div><b></b>`).join("");
  times.forEach(([, ms], i) => {
    $("times").children[3 * i + 1].style.setProperty("--share", `${100 * ms / longest}%`);
    $("times").children[3 * i + 2].textContent = `${number(ms, 1)} ms`;
  });
}

function onEvent(event) {
  const list = $("events").lastElementChild, line = document.createElement("li"), when = document.createElement("b");
  line.className = ["good", "bad", "loop"].includes(event.kind) ? event.kind : "info";
  when.textContent = `${event.frame}`;
  line.append(when, String(event.text));
  list.prepend(line);
  while (list.children.length > MAX_EVENTS) list.lastElementChild.remove();
  page.events++;
  if (event.keyframes && page.map) page.map.flashLoop(...event.keyframes);
}

function onPlayer(player) {
  page.paused = player.paused;
  const button = document.querySelector("[data-command=pause], [data-command=resume]");
  button.dataset.command = player.paused ? "resume" : "pause";
  button.textContent = player.paused ? (page.hello.mode === "replay" ? "Play" : "Resume") : "Pause";
  button.setAttribute("aria-pressed", player.paused);
  if (player.position !== undefined && !page.scrubbing) $("position").value = player.position;
  if (player.speed !== undefined) $("speed").value = player.speed;
}

// Sections of a message: a length in bytes, and the bytes, filled up to four.
function section(buffer, at) {
  const bytes = new DataView(buffer).getUint32(at, true);
  return {bytes: new Uint8Array(buffer, at + 4, bytes), next: at + 4 + 4 * Math.ceil(bytes / 4)};
}
const parse = (bytes) => JSON.parse(new TextDecoder().decode(bytes));

function onMessage(buffer) {
  const view = new DataView(buffer), type = view.getUint32(0, true);
  if (type === MAP) {
    if (page.map) page.map.apply(view, HEADER, view.getUint32(8, true) === 1);
    return;
  }
  if (type === FRAME) return onFrame(buffer);
  const json = parse(section(buffer, HEADER).bytes);
  if (type === HELLO) onHello(json);
  if (type === EVENT) onEvent(json);
  if (type === PLAYER) onPlayer(json);
}

// Shows the frame, or, where processors are shared, the newest one when it is time.
function onFrame(buffer) {
  page.newest = buffer;
  const wait = page.sharesProcessors ? page.lastFrame + 1000 * SHARED_S - performance.now() : 0;
  if (wait <= 0) showNewest();
  else if (!page.frameTimer) page.frameTimer = setTimeout(showNewest, wait);
}

function showNewest() {
  clearTimeout(page.frameTimer);
  page.frameTimer = 0;
  page.lastFrame = performance.now();
  const buffer = page.newest, view = new DataView(buffer), state = view.getUint32(8, true);
  const json = section(buffer, HEADER), points = section(buffer, json.next), jpeg = section(buffer, points.next);
  const facts = parse(json.bytes);
  facts.frame = view.getUint32(4, true);
  page.facts = facts;
  setState(STATES[state] || facts.state, facts.reason);
  showFacts(facts);
  const keypoints = new Uint16Array(buffer, points.bytes.byteOffset, points.bytes.length / 2);
  page.video.show(jpeg.bytes, facts, keypoints).catch(() => {});
  if (page.map) page.map.show(facts.pose, STATES[state]);
}

function connect() {
  const live = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/live${location.search}`);
  live.binaryType = "arraybuffer";
  live.onmessage = (message) => {
    try {
      onMessage(message.data);
    } catch (error) {
      setLink(`a message could not be read: ${error.message}`, true);
    }
  };
  live.onclose = () => {
    setLink("no connection: the run has ended, or the token is wrong", true);
    setTimeout(connect, 1000);
  };
  page.live = live;
}

function send(command) {
  if (page.live && page.live.readyState === WebSocket.OPEN) page.live.send(command);
}

function setFollow(follows) {
  document.querySelector("[data-view=follow]").setAttribute("aria-pressed", follows);
  if (page.map) page.map.setFollow(follows);
}

function act(button) {
  const {command, view} = button.dataset;
  if (command === "reset" && !confirm("Forget the map and all poses?")) return;
  if (command) send(command);
  if (view === "follow") setFollow(button.getAttribute("aria-pressed") !== "true");
  if (view === "top") {
    setFollow(false);
    if (page.map) page.map.top();
  }
}

function seek(frame) {
  clearTimeout(page.seekTimer);
  const wait = Math.max(0, page.lastSeek + SEEK_MS - performance.now());
  page.seekTimer = setTimeout(() => {
    page.lastSeek = performance.now();
    send(`seek ${frame}`);
  }, wait);
}

const press = (selector) => { const button = document.querySelector(selector); if (!button.hidden) act(button); };
const KEYS = {
  " ": () => press("[data-command=pause], [data-command=resume]"), n: () => press("[data-command=step]"),
  f: () => press("[data-view=follow]"), t: () => press("[data-view=top]"), s: () => press("[data-command=save]"), r: () => press("[data-command=reset]"),
  ArrowRight: () => press("[data-command=step]"),
  ArrowLeft: () => { if (page.hello.mode === "replay") { send("pause"); seek(Math.max(0, Number($("position").value) - 1)); } },
};

document.querySelectorAll("button").forEach((button) => button.addEventListener("click", () => { act(button); button.blur(); }));
document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || event.target.matches("input, select")) return;
  const action = KEYS[event.key] || KEYS[event.key.toLowerCase()];
  if (!action) return;
  event.preventDefault();
  action();
});
$("position").addEventListener("input", () => { page.scrubbing = true; seek(Number($("position").value)); });
$("position").addEventListener("change", () => { page.scrubbing = false; });
$("speed").addEventListener("change", () => send(`speed ${$("speed").value}`));

page.video = new VideoView($("video-canvas"));
try {
  page.map = new MapView($("map-canvas"));
} catch (error) {
  $("banner").hidden = false;
  $("map").append("This browser shows no map: it has no WebGL.");
}
connect();
