// Entry of the page: the connection, the commands, and the distribution of the state to the panels.

import { MapView } from "/map.js";
import { Strips } from "/strips.js";
import { Panels } from "/panels.js";

export const $ = (id) => document.getElementById(id);

const token = readToken();
const memory = { setup: {}, samples: [], events: [], names: [], state: null };
const map = new MapView($("map"), goTo);
const strips = new Strips();
const panels = new Panels(command);
let toastTimer;
// For tests and for the curious.
window.yamabico = { memory, map, command };

connect();
bindButtons();
setInterval(() => map.draw(memory), 66);

/** The token of the address; it is kept for reloads and hidden from view. */
function readToken() {
  const found = new URLSearchParams(location.search).get("token");
  if (found) {
    sessionStorage.setItem("token", found);
    history.replaceState(null, "", location.pathname);
  }
  return found || sessionStorage.getItem("token") || "";
}

function connect() {
  const socket = new WebSocket(`ws://${location.host}/ws`);
  socket.onmessage = (event) => receive(JSON.parse(event.data));
  socket.onopen = () => { $("lost").hidden = true; };
  socket.onclose = () => {
    $("lost").hidden = false;
    setTimeout(connect, 1000);
  };
}

/** Takes in a message: the state, and what is new in strips, log and setup. */
function receive(message) {
  if (message.is_new) {
    memory.samples = [];
    memory.events = [];
  }
  memory.names = message.names;
  memory.samples.push(...message.samples);
  memory.events.push(...message.events);
  if (memory.samples.length > 2600) memory.samples.splice(0, memory.samples.length - 2500);
  if (memory.events.length > 2100) memory.events.splice(0, memory.events.length - 2000);
  memory.state = message.state;
  const isLive = message.state.source.source === "robot";
  document.body.classList.toggle("live", isLive);
  document.body.classList.toggle("recording", !isLive);
  $("player").hidden = isLive;
  if (message.setup) {
    memory.setup = message.setup;
    panels.setup(memory);
  }
  panels.update(memory, message.is_new || message.events.length > 0);
  if (message.samples.length || message.is_new) strips.update(memory, panels.colors);
}

/** Sends a command; shows its effect, or why it had none. */
export async function command(body) {
  try {
    const answer = await fetch("/command", {
      method: "POST",
      headers: { "content-type": "application/json", "x-yamabico-token": token },
      body: JSON.stringify(body),
    });
    const result = await answer.json();
    if (result.error) toast(result.error, true);
    else if (!["seek", "play", "pause"].includes(body.command)) toast(result.done, false);
    return result;
  } catch (error) {
    toast(`${body.command}: no answer from the view`, true);
    return { error: String(error) };
  }
}

function toast(text, isBad) {
  const box = $("toast");
  box.textContent = text;
  box.className = isBad ? "shown bad" : "shown";
  clearTimeout(toastTimer);
  toastTimer = setTimeout(() => { box.className = ""; }, isBad ? 8000 : 3500);
}

function goTo(x, y) {
  const isLive = memory.state?.source.source === "robot";
  if (isLive && $("goto").checked) command({ command: "goto", x_m: round(x), y_m: round(y) });
}

const round = (number) => Math.round(number * 100) / 100;

function bindButtons() {
  $("estop").onclick = () => command({ command: "estop" });
  $("reset").onclick = () => command({ command: "reset" });
  $("save").onclick = () => command({ command: "save" });
  $("fit").onclick = () => map.fit(memory);
  const pace = () => Number($("pace").value);
  const isPlaying = () => memory.state?.source.is_playing;
  $("play").onclick = () => command(isPlaying() ? { command: "pause" } : { command: "play", pace: pace() });
  $("pace").onchange = () => isPlaying() && command({ command: "play", pace: pace() });
  const jump = (forward) => command({ command: "jump", forward, kind: $("jump-kind").value || null });
  $("back").onclick = () => jump(false);
  $("forward").onclick = () => jump(true);
  seekBySlider();
  document.addEventListener("keydown", (event) => {
    if (event.target.matches("input, select, button")) return;
    if (event.key === " " && !$("player").hidden) {
      event.preventDefault();
      $("play").click();
    }
  });
}

/** Follows the slider while it is dragged, one request at a time. */
function seekBySlider() {
  const slider = $("position");
  let wanted = null, isBusy = false;
  const seek = async () => {
    if (isBusy) return;
    isBusy = true;
    while (wanted !== null) {
      const at = wanted;
      wanted = null;
      await command({ command: "seek", at_s: at });
    }
    isBusy = false;
  };
  slider.oninput = () => { wanted = Number(slider.value); panels.isDragging = true; seek(); };
  slider.onchange = () => { panels.isDragging = false; };
}
