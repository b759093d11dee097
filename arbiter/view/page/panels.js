// The panels of text: camera, decision, log, latency, sensors, parameters and the player.

import { drawMark } from "/map.js";

const PALETTE = ["#0b84d8", "#e0812b", "#8e5bd0", "#14936b", "#c4417a", "#8a6d1d", "#2aa5b8", "#7a7f87"];
const STAGE_COLORS = ["#7aa7e0", "#e0a95b", "#9d8bd0", "#6fb58f"];
const STAGES = ["captured to received", "received to proposed", "proposed to accepted", "accepted to sent"];

export class Panels {
  constructor(command) {
    this.command = command;
    this.order = [];
    this.colors = (name) => {
      let index = this.order.indexOf(name);
      if (index < 0) index = this.order.push(name) - 1;
      return PALETTE[index % PALETTE.length];
    };
    window.yamabicoColor = this.colors;
    this.camera = new Camera();
    this.parameters = new Parameters(command);
    this.isDragging = false;
    this.rows = new Map();
  }

  /** Takes in the description of the robot. */
  setup(memory) {
    const { setup } = memory;
    document.getElementById("robot").textContent = setup.title || setup.robot || "recording";
    document.title = `${setup.robot || "recording"} - Yamabico`;
    this.parameters.setup(setup, document.body.classList.contains("live"));
    this.setupTimeline(memory);
  }

  update(memory, hasEvents) {
    const { state } = memory;
    for (const behavior of state.behaviors) this.colors(behavior.name);
    this.headline(state);
    this.axes(state);
    this.behaviors(state);
    this.sensors(state);
    this.latency(state);
    if (hasEvents) this.log(memory);
    this.player(memory);
    this.camera.update(state);
  }

  headline(state) {
    const isOver = state.source.source === "robot" && !state.source.is_running;
    const isStopped = ["emergency stop", "critical behavior or sensor silent"].includes(state.mode);
    const mode = element("mode");
    mode.textContent = isOver ? "not running" : state.mode || "waiting";
    mode.className = `pill ${isOver ? "lost" : isStopped ? "stopped" : state.mode}`;
    set("headline", isOver ? "the robot has ended; waiting until it runs again" : state.headline);
    set("time", `${state.time_s.toFixed(1)} s`);
    element("estop").classList.toggle("latched", state.mode === "emergency stop");
    element("reset").classList.toggle("latched", state.mode === "emergency stop");
  }

  axes(state) {
    const cells = state.axes.flatMap((axis) => [
      node("span", axis.axis), node("b", `${axis.commanded.toFixed(2)} ${axis.unit}`), node("span", axis.why.join("; "), "chain"),
    ]);
    element("axes").replaceChildren(...cells);
  }

  behaviors(state) {
    const body = element("behaviors").tBodies[0];
    const names = state.behaviors.map((behavior) => behavior.name).join("|");
    if (body.dataset.names !== names) {
      body.dataset.names = names;
      this.rows = new Map(state.behaviors.map((behavior) => [behavior.name, this.row(behavior)]));
      body.replaceChildren(...[...this.rows.values()].map((row) => row.element));
    }
    for (const behavior of state.behaviors) this.fill(this.rows.get(behavior.name), behavior);
  }

  /** Row of a behavior; its cells are filled in later, so that the switch stays under the finger. */
  row(behavior) {
    const tr = document.createElement("tr");
    tr.dataset.behavior = behavior.name;
    const name = node("td", "", "name"), swatch = node("span", "", "swatch");
    swatch.style.background = this.colors(behavior.name);
    const small = node("small", "");
    name.append(swatch, behavior.name, " ", small);
    const outcome = node("td", ""), badge = node("span", "", "badge");
    outcome.append(badge);
    const why = node("td", "", "why"), text = node("span", ""), process = node("div", "", "process");
    why.append(text, process);
    const bars = node("td", "", "bars"), age = bar(), evidence = bar(), ages = node("small", "");
    bars.append(age.element, evidence.element, ages);
    const [share, rate, calls] = ["", "", ""].map(() => node("td", "", "number"));
    const toggle = node("td", "", "live-only");
    const box = Object.assign(document.createElement("input"), { type: "checkbox", title: `enable or disable ${behavior.name}` });
    box.onchange = () => this.command({ command: box.checked ? "enable" : "disable", behavior: behavior.name });
    toggle.append(box);
    tr.append(name, outcome, why, bars, share, rate, calls, toggle);
    return { element: tr, small, badge, text, process, age, evidence, ages, share, rate, calls, box };
  }

  fill(row, behavior) {
    put(row.small, `(${behavior.priority})`);
    put(row.badge, behavior.outcome);
    row.badge.className = `badge ${badgeClass(behavior)}`;
    put(row.text, behavior.because ? `${behavior.why}: ${behavior.because}` : behavior.why);
    const restarts = behavior.restarts ? `restarted ${behavior.restarts}×` : "";
    put(row.process, behavior.process || restarts);
    row.age.set(behavior.age_s, behavior.max_age_s ?? 0.2);
    row.evidence.set(behavior.evidence_age_s, behavior.max_evidence_age_s ?? 1);
    put(row.ages, `${millis(behavior.age_s)} / ${millis(behavior.evidence_age_s)}`);
    put(row.share, `${Math.round(100 * behavior.control_share)} %`);
    put(row.rate, `${behavior.rate_hz.toFixed(1)} Hz`);
    const calls = behavior.calls;
    const over = calls && calls.overruns ? `, ${calls.overruns} over budget` : "";
    put(row.calls, calls ? `${calls.p50_ms.toFixed(1)} / ${calls.p99_ms.toFixed(1)} ms${over}` : "");
    if (document.activeElement !== row.box) row.box.checked = behavior.enabled;
  }

  sensors(state) {
    const rows = state.sensors.map((sensor) => {
      const tr = document.createElement("tr");
      tr.append(node("td", sensor.topic), node("td", sensor.kind), node("td", `${sensor.rate_hz.toFixed(1)} Hz`, "number"),
        node("td", millis(sensor.age_s), "number"));
      return tr;
    });
    element("sensors").tBodies[0].replaceChildren(...rows);
  }

  latency(state) {
    const box = element("latency");
    if (!state.latency) {
      box.replaceChildren(node("span", "no command of a behavior yet", "note"));
      return;
    }
    const { stages, whole } = state.latency;
    const strip = node("div", "", "stages"), list = node("div", "", "stage-list");
    const scale = Math.max(whole.p99_ms, 1);
    stages.forEach((stage, i) => {
      const part = document.createElement("i");
      part.style.width = `${(100 * stage.p50_ms) / scale}%`;
      part.style.background = STAGE_COLORS[i];
      part.title = STAGES[i];
      strip.append(part);
      const swatch = node("span", "", "swatch");
      swatch.style.background = STAGE_COLORS[i];
      list.append(swatch, node("span", STAGES[i]), node("span", `${stage.p50_ms.toFixed(1)}`), node("span", `${stage.p99_ms.toFixed(1)} ms`));
    });
    list.append(node("span", ""), node("b", "all, p50 and p99"), node("b", whole.p50_ms.toFixed(1)), node("b", `${whole.p99_ms.toFixed(1)} ms`));
    box.replaceChildren(strip, list);
  }

  log(memory) {
    const list = element("log");
    const isAtEnd = list.scrollHeight - list.scrollTop - list.clientHeight < 30;
    const items = memory.events.slice(-400).map((event) => {
      const item = node("li", "", event.kind);
      item.append(node("time", `${event.at_s.toFixed(2)} s`), node("span", event.kind, "kind"), node("span", event.text));
      item.onclick = () => document.body.classList.contains("recording") && this.command({ command: "seek", at_s: event.at_s });
      item.dataset.at = event.at_s;
      return item;
    });
    list.replaceChildren(...items);
    if (isAtEnd && document.body.classList.contains("live")) list.scrollTop = list.scrollHeight;
  }

  player({ state, events, setup }) {
    const { source } = state;
    if (source.source !== "recording") return;
    const slider = element("position");
    if (!this.isDragging && document.activeElement !== slider) slider.value = source.position_s;
    if (!this.isDragging) slider.value = source.position_s;
    set("position-text", `${source.position_s.toFixed(2)} of ${(setup.duration_s ?? 0).toFixed(1)} s`);
    set("play", source.is_playing ? "❚❚" : "▶");
    let now = null;
    for (const item of element("log").children) {
      const isPast = Number(item.dataset.at) <= source.position_s + 0.01;
      item.style.opacity = isPast ? 1 : 0.5;
      if (isPast) now = item;
    }
    if (now !== this.nowItem) {
      this.nowItem?.classList.remove("now");
      now?.classList.add("now");
      this.nowItem = now;
      if (now) element("log").scrollTop = now.offsetTop - element("log").offsetTop - 120;
    }
    if (this.tickCount !== events.length) this.setupTimeline({ setup, events });
  }

  /** Marks the events on the time line. */
  setupTimeline({ setup, events }) {
    if (!setup.duration_s) return;
    const slider = element("position");
    slider.max = setup.duration_s;
    const canvas = element("ticks");
    if (!canvas.clientWidth) return;
    this.tickCount = events.length;
    canvas.width = canvas.clientWidth;
    canvas.height = canvas.clientHeight;
    const context = canvas.getContext("2d");
    const style = getComputedStyle(document.documentElement);
    const colors = { halt: "--bad", contact: "--bad", failure: "--bad", late: "--warn", "hand-over": "--accent", release: "--good", operator: "--text" };
    for (const event of events) {
      context.fillStyle = style.getPropertyValue(colors[event.kind]).trim();
      const isBig = ["halt", "contact", "failure"].includes(event.kind);
      context.fillRect((event.at_s / setup.duration_s) * canvas.width, isBig ? 0 : 5, 2, isBig ? 14 : 9);
    }
  }
}

/** The camera picture with what the behaviors drew over it. */
class Camera {
  constructor() {
    this.choice = element("camera-choice");
    this.shown = null;
    this.isBusy = false;
    this.hidden = new Set();
    this.layerNames = "";
  }

  async update(state) {
    const { pictures } = state;
    const topics = pictures.map((picture) => picture.topic);
    if (this.choice.dataset.topics !== topics.join("|")) {
      this.choice.dataset.topics = topics.join("|");
      const before = this.choice.value;
      this.choice.replaceChildren(...topics.map((topic) => new Option(topic)));
      if (topics.includes(before)) this.choice.value = before;
      this.choice.hidden = topics.length < 2;
    }
    const picture = pictures.find((picture) => picture.topic === this.choice.value) || pictures[0];
    if (!picture) return set("camera-age", "no picture");
    set("camera-age", `${picture.topic}  ${picture.width}×${picture.height}  ${millis(picture.age_s)} old`);
    const stamp = picture.overlaid ?? picture.stamp;
    const key = `${picture.topic}@${stamp}`;
    if (this.isBusy || key === this.shown) return;
    this.isBusy = true;
    try {
      await this.show(picture.topic, stamp);
      this.shown = key;
    } catch {
      // The picture is gone: the next one comes soon.
    } finally {
      this.isBusy = false;
    }
  }

  /** Loads the picture and the overlays of the same frame, and draws both. */
  async show(topic, wanted) {
    const answer = await fetch(`/picture/${topic}?${wanted}`);
    if (!answer.ok) return;
    const stamp = answer.headers.get("x-stamp");
    const [bitmap, overlays] = await Promise.all([
      answer.blob().then(createImageBitmap),
      fetch(`/overlay/${topic}?${stamp}`).then((answer) => (answer.ok ? answer.json() : [])),
    ]);
    this.layers(overlays);
    const canvas = element("camera");
    const scale = bitmap.width < 500 ? 2 : 1;
    if (canvas.width !== bitmap.width * scale) {
      canvas.width = bitmap.width * scale;
      canvas.height = bitmap.height * scale;
    }
    const context = canvas.getContext("2d");
    context.imageSmoothingEnabled = false;
    context.drawImage(bitmap, 0, 0, canvas.width, canvas.height);
    for (const overlay of overlays) {
      for (const layer of overlay.layers) {
        layer.isHidden = this.hidden.has(`${overlay.behavior}: ${layer.name}`);
        if (layer.space !== "image" || layer.isHidden) continue;
        for (const [kind, x, y, x2, y2, text] of layer.marks) {
          const at = (x, y) => [(x + 0.5) * scale, (y + 0.5) * scale];
          drawMark(context, kind, at(x, y), at(x2, y2), x2 * scale, text, layer.color);
        }
      }
    }
    canvas.dataset.stamp = stamp;
    window.yamabico.map.overlays = overlays;
  }

  /** One check box a layer. */
  layers(overlays) {
    const names = overlays.flatMap(({ behavior, layers }) => layers.map((layer) => [`${behavior}: ${layer.name}`, layer.color]));
    const known = new Map([...(this.known ?? new Map()), ...names]);
    const text = [...known.keys()].sort().join("|");
    if (text === this.layerNames) return;
    [this.known, this.layerNames] = [known, text];
    const boxes = [...known].sort().map(([name, color]) => {
      const label = document.createElement("label"), swatch = node("span", "", "swatch");
      swatch.style.background = color;
      const box = Object.assign(document.createElement("input"), { type: "checkbox", checked: !this.hidden.has(name) });
      box.onchange = () => { box.checked ? this.hidden.delete(name) : this.hidden.add(name); this.shown = null; };
      label.append(box, swatch, name);
      return label;
    });
    element("layers").replaceChildren(...boxes);
  }
}

/** The parameters of one behavior. */
class Parameters {
  constructor(command) {
    this.command = command;
    this.choice = element("parameter-behavior");
    this.choice.onchange = () => this.show();
    this.all = [];
  }

  setup(setup, isLive) {
    this.isLive = isLive;
    this.all = setup.parameters || [];
    const names = this.all.map((entry) => entry.behavior);
    const before = this.choice.value;
    this.choice.replaceChildren(...names.map((name) => new Option(name)));
    if (names.includes(before)) this.choice.value = before;
    set("parameter-note", !names.length ? "none known" : isLive ? "Enter or release the slider to set" : "values of the recording");
    this.show();
  }

  show() {
    const behavior = this.all.find((entry) => entry.behavior === this.choice.value);
    const simple = (behavior?.parameters || []).filter((entry) => !entry.takes.includes("table"));
    element("parameters").replaceChildren(...simple.map((entry) => this.field(behavior.behavior, entry)));
  }

  field(behavior, entry) {
    const box = node("div", "", "parameter");
    box.dataset.key = `${behavior}.${entry.key}`;
    const key = node("div", entry.key, "key");
    const range = [entry.range, entry.unit].filter(Boolean).join(" ");
    if (range) key.append(" ", node("small", range));
    const isNumber = /^(number|integer)/.test(entry.takes);
    const words = entry.takes.match(/"[^"]*"/g);
    const set = async (value) => {
      const result = await this.command({ command: "set", behavior, key: entry.key, value });
      box.classList.toggle("changed", !result.error);
      setTimeout(() => box.classList.remove("changed"), 1500);
    };
    const input = document.createElement(words ? "select" : "input");
    input.className = "entry";
    input.disabled = !this.isLive;
    if (words) {
      input.append(...words.map((word) => new Option(JSON.parse(word))));
      input.value = entry.value ?? "";
      input.onchange = () => set(input.value);
    } else if (entry.takes === "boolean") {
      input.type = "checkbox";
      input.checked = entry.value === true;
      input.onchange = () => set(input.checked);
    } else {
      input.type = isNumber ? "number" : "text";
      input.step = "any";
      input.value = typeof entry.value === "object" ? JSON.stringify(entry.value ?? "") : entry.value ?? "";
      if (entry.value == null) input.value = "";
      input.onchange = () => set(isNumber ? Number(input.value) : parseText(input.value));
    }
    box.append(key, input);
    const bounds = isNumber && entry.range?.match(/^(\S+) to (\S+)$/);
    if (bounds && entry.value != null) {
      const [min, max] = [Number(bounds[1]), Number(bounds[2])];
      const slider = Object.assign(document.createElement("input"), {
        type: "range", min, max, step: entry.takes === "integer" ? 1 : niceStep(max - min), value: entry.value, disabled: !this.isLive,
      });
      slider.style.gridColumn = "1 / -1";
      slider.oninput = () => { input.value = slider.value; };
      slider.onchange = () => set(Number(slider.value));
      box.append(slider);
    }
    box.append(node("div", entry.summary, "summary"));
    return box;
  }
}

function parseText(text) {
  try {
    const value = JSON.parse(text);
    return value === null ? text : value;
  } catch {
    return text;
  }
}

const niceStep = (span) => 10 ** Math.floor(Math.log10(span / 100));
const element = (id) => document.getElementById(id);
const millis = (seconds) => (seconds == null ? "-" : seconds < 1.5 ? `${Math.round(seconds * 1000)} ms` : `${seconds.toFixed(1)} s`);

function set(id, text) {
  put(element(id), text);
}

/** Writes a text only if it differs, so that selections survive. */
function put(node, text) {
  if (node.textContent !== text) node.textContent = text;
}

function node(tag, text, className = "") {
  const made = document.createElement(tag);
  made.textContent = text;
  if (className) made.className = className;
  return made;
}

function bar() {
  const outer = node("div", "", "bar"), inner = document.createElement("i");
  outer.append(inner);
  return {
    element: outer,
    set: (value, max) => {
      inner.style.width = value == null ? "0" : `${Math.min(100, Math.max(0, (100 * value) / max))}%`;
      inner.className = value > max ? "old" : "";
    },
  };
}

function badgeClass({ outcome }) {
  if (["won", "won in part", "blended"].includes(outcome)) return "won";
  if (["halting", "held"].includes(outcome)) return "halting";
  if (outcome === "limiting") return "limiting";
  return ["stale", "stale evidence", "malformed", "from the future", "disabled", "silent"].includes(outcome) ? "fault" : "";
}
