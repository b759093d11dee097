// Strips of the last two minutes: control of each axis, and the speeds.

const SPAN_S = 120;
const AXES = ["linear", "lateral", "angular"];

export class Strips {
  constructor() {
    this.canvas = document.getElementById("owners");
    this.plots = [
      this.plot("linear-plot", "forward", "m/s"),
      this.plot("angular-plot", "turn", "rad/s"),
    ];
    window.addEventListener("resize", () => {
      for (const plot of this.plots) plot.setSize({ width: plot.root.parentElement.clientWidth, height: 130 });
    });
  }

  plot(id, name, unit) {
    const host = document.getElementById(id);
    const css = (name) => () => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
    const line = (label, color, width, dash) => ({
      label, stroke: css(color), width, dash, points: { show: false },
    });
    const axis = { stroke: css("--faint"), grid: { stroke: css("--grid"), width: 1 }, ticks: { show: false }, font: "11px system-ui" };
    return new uPlot({
      width: host.clientWidth || 600,
      height: 130,
      cursor: { drag: { x: false, y: false } },
      legend: { live: false },
      scales: { x: { time: false }, y: { range: (_, min, max) => [Math.min(min, -0.05), Math.max(max, 0.1) * 1.05] } },
      axes: [{ ...axis, size: 22 }, { ...axis, size: 52, label: `${name}, ${unit}`, labelSize: 16, labelFont: "11px system-ui" }],
      series: [
        { label: "" },
        line("wanted", "--faint", 1, [4, 3]), line("allowed", "--warn", 1), line("commanded", "--accent", 2),
      ],
    }, [[], [], [], []], host);
  }

  update(memory, colors) {
    const end = memory.samples.length ? memory.samples[memory.samples.length - 1][0] : 0;
    const samples = memory.samples.filter((sample) => sample[0] >= end - SPAN_S);
    const times = samples.map((sample) => sample[0]);
    const range = { min: Math.max(0, end - SPAN_S), max: Math.max(end, Math.min(SPAN_S, end + 1)) };
    this.plots.forEach((plot, i) => {
      const speeds = [0, 1, 2].map((which) => samples.map((sample) => sample[3 + i][which]));
      plot.setData([times, ...speeds], false);
      plot.setScale("x", range);
    });
    this.owners(samples, range, memory, colors);
  }

  /** One bar an axis: the color of the behavior in control, red where a halt stops it. */
  owners(samples, { min, max }, memory, colors) {
    const canvas = this.canvas, ratio = window.devicePixelRatio || 1;
    const width = canvas.clientWidth, height = canvas.clientHeight;
    if (!width) return;
    canvas.width = width * ratio;
    canvas.height = height * ratio;
    const context = canvas.getContext("2d");
    context.scale(ratio, ratio);
    const style = getComputedStyle(document.documentElement);
    const css = (name) => style.getPropertyValue(name).trim();
    const shown = [0, 1, 2].filter((axis) => axis !== 1 || samples.some((sample) => sample[1][1] >= 0));
    const left = 68, row = height / shown.length;
    const x = (at) => left + ((at - min) / Math.max(max - min, 1e-3)) * (width - left);
    shown.forEach((axis, index) => {
      const top = index * row + 4, tall = row - 8;
      context.fillStyle = css("--faint");
      context.font = "12px system-ui, sans-serif";
      context.textBaseline = "middle";
      context.fillText(AXES[axis], 0, top + tall / 2);
      context.fillStyle = css("--track");
      context.fillRect(left, top, width - left, tall);
      let begin = 0;
      for (let i = 1; i <= samples.length; i++) {
        const isSame = i < samples.length && samples[i][1][axis] === samples[begin][1][axis] &&
          ((samples[i][2] ^ samples[begin][2]) & (1 << axis)) === 0 && samples[i][0] - samples[i - 1][0] < 1;
        if (isSame) continue;
        const until = i < samples.length && samples[i][0] - samples[i - 1][0] < 1 ? samples[i][0] : samples[i - 1][0] + 0.05;
        const [from, to] = [x(samples[begin][0]), x(until)];
        const owner = samples[begin][1][axis];
        if (owner >= 0) {
          context.fillStyle = colors(memory.names[owner]);
          context.fillRect(from, top, Math.max(to - from, 0.5), tall);
        }
        if (samples[begin][2] & (1 << axis)) {
          context.fillStyle = css("--bad");
          context.fillRect(from, top + tall * 0.6, Math.max(to - from, 1.5), tall * 0.4);
        }
        begin = i;
      }
    });
    const legend = document.getElementById("strip-legend");
    const names = memory.names.join("|");
    if (legend.dataset.names !== names) {
      legend.dataset.names = names;
      legend.replaceChildren(...memory.names.map((name) => entry(colors(name), name)), entry(css("--bad"), "stopped"));
    }
  }
}

function entry(color, text) {
  const span = document.createElement("span");
  const swatch = Object.assign(document.createElement("span"), { className: "swatch" });
  swatch.style.background = color;
  span.append(swatch, ` ${text}  `);
  return span;
}
