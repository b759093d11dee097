// The top view: map, poses, path, ranges, obstacles and proposals. Meters, x right and y up on the screen.

const LAYERS = [
  ["map", "map"], ["scan", "ranges"], ["path", "path"], ["obstacles", "obstacles"], ["free", "free space"],
  ["proposals", "proposals"], ["trail", "trail"], ["truth", "true pose"], ["overlay", "drawn by behaviors"],
];
const PREVIEW_S = 2;

export class MapView {
  constructor(canvas, onClick) {
    this.canvas = canvas;
    this.center = [0, 0];
    this.scale = 40;
    this.isFitted = false;
    this.shown = Object.fromEntries(LAYERS.map(([key]) => [key, true]));
    this.overlays = [];
    this.bind(onClick);
    const legend = document.getElementById("legend");
    for (const [key, text] of LAYERS) {
      const label = document.createElement("label");
      const box = Object.assign(document.createElement("input"), { type: "checkbox", checked: true });
      box.onchange = () => { this.shown[key] = box.checked; };
      label.append(box, text);
      legend.append(label);
    }
  }

  bind(onClick) {
    const canvas = this.canvas;
    const pointers = new Map();
    let moved = 0;
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      pointers.set(event.pointerId, [event.offsetX, event.offsetY]);
      if (pointers.size === 1) moved = 0;
    });
    canvas.addEventListener("pointermove", (event) => {
      const last = pointers.get(event.pointerId);
      if (!last) return;
      const at = [event.offsetX, event.offsetY];
      const [dx, dy] = [at[0] - last[0], at[1] - last[1]];
      moved += Math.hypot(dx, dy);
      if (pointers.size === 2) {
        const other = [...pointers].find(([id]) => id !== event.pointerId)[1];
        const before = Math.hypot(last[0] - other[0], last[1] - other[1]);
        this.zoom(Math.hypot(at[0] - other[0], at[1] - other[1]) / Math.max(before, 1), other);
      } else if (moved > 6) {
        document.getElementById("follow").checked = false;
        this.center = [this.center[0] - dx / this.scale, this.center[1] + dy / this.scale];
      }
      pointers.set(event.pointerId, at);
    });
    const release = (event) => {
      const isClick = pointers.size === 1 && moved <= 6 && event.type === "pointerup";
      pointers.delete(event.pointerId);
      if (isClick) onClick(...this.toMap(event.offsetX, event.offsetY));
    };
    canvas.addEventListener("pointerup", release);
    canvas.addEventListener("pointercancel", release);
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.zoom(Math.exp(-event.deltaY * 0.0015), [event.offsetX, event.offsetY]);
    }, { passive: false });
  }

  zoom(factor, [px, py]) {
    const before = this.toMap(px, py);
    this.scale = Math.min(400, Math.max(4, this.scale * factor));
    const after = this.toMap(px, py);
    this.center = [this.center[0] + before[0] - after[0], this.center[1] + before[1] - after[1]];
  }

  toMap(px, py) {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    return [this.center[0] + (px - width / 2) / this.scale, this.center[1] - (py - height / 2) / this.scale];
  }

  toScreen(x, y) {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    return [width / 2 + (x - this.center[0]) * this.scale, height / 2 - (y - this.center[1]) * this.scale];
  }

  /** Shows the whole map, or everything that was driven. */
  fit(memory) {
    const points = [];
    for (const [a, b] of memory.setup.map || []) points.push(a, b);
    for (const line of memory.setup.walls || []) points.push(...line);
    for (const sample of memory.samples) for (const at of [sample[5], sample[6]]) if (at) points.push(at);
    const robot = robotPose(memory);
    if (robot) points.push([robot.x, robot.y]);
    if (!points.length) return false;
    const xs = points.map((p) => p[0]), ys = points.map((p) => p[1]);
    const min = [Math.min(...xs), Math.min(...ys)], max = [Math.max(...xs), Math.max(...ys)];
    const size = [Math.max(2, max[0] - min[0]), Math.max(2, max[1] - min[1])];
    const { clientWidth: width, clientHeight: height } = this.canvas;
    this.scale = Math.min(160, 0.92 * Math.min(width / size[0], height / size[1]));
    this.center = [(min[0] + max[0]) / 2, (min[1] + max[1]) / 2];
    document.getElementById("follow").checked = false;
    return true;
  }

  draw(memory) {
    const canvas = this.canvas, ratio = window.devicePixelRatio || 1;
    const { clientWidth: width, clientHeight: height } = canvas;
    if (!memory.state || !width) return;
    if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(height * ratio);
    }
    const scene = memory.state.scene, robot = robotPose(memory);
    if (!this.isFitted && robot) {
      this.scale = Math.min(80, width / 9);
      this.isFitted = true;
    }
    if (document.getElementById("follow").checked && robot) this.center = [robot.x, robot.y];
    const style = getComputedStyle(document.documentElement);
    const color = (name) => style.getPropertyValue(name).trim();
    const context = canvas.getContext("2d");
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, height);
    const pen = new Pen(context, this, color);
    pen.grid(width, height);
    if (this.shown.map) pen.walls(memory.setup);
    if (this.shown.trail) pen.trail(memory.samples);
    if (this.shown.path) pen.path(scene);
    if (robot) {
      if (this.shown.free) pen.freeSpace(robot, scene.free_space);
      if (this.shown.scan) for (const scan of scene.scans) pen.scan(robot, scan);
      if (this.shown.obstacles) pen.obstacles(robot, scene.obstacles);
      if (this.shown.overlay) pen.overlays(robot, this.overlays);
      if (this.shown.proposals) pen.proposals(robot, memory);
    }
    if (this.shown.truth && scene.truth) pen.robot(scene.truth, memory.setup.radius_m, color("--good"), [4, 3]);
    if (scene.pose) pen.ellipse(scene.pose);
    if (robot) pen.robot(robot, memory.setup.radius_m, color("--text"), []);
    pen.scaleBar(height);
    const note = robot ? `${robot.source} (${robot.x.toFixed(2)}, ${robot.y.toFixed(2)}) m, ${(robot.theta * 180 / Math.PI).toFixed(0)}°${robot.status ? ", " + robot.status : ""}` : "no pose";
    document.getElementById("map-note").textContent = note;
  }
}

/** The best known pose: estimated, else true, else by odometry. */
function robotPose(memory) {
  const scene = memory.state?.scene;
  if (!scene) return null;
  const { pose, truth, odometry } = scene;
  if (pose && !["lost", "unknown"].includes(pose.status)) return { ...pose, source: "pose" };
  if (truth) return { ...truth, source: "true pose" };
  if (pose) return { ...pose, source: "pose" };
  if (odometry) return { x: odometry[0], y: odometry[1], theta: odometry[2], source: "odometry" };
  return null;
}

class Pen {
  constructor(context, view, color) {
    Object.assign(this, { context, view, color });
  }

  line(points, isClosed = false) {
    this.context.beginPath();
    points.forEach(([x, y], i) => {
      const at = this.view.toScreen(x, y);
      i ? this.context.lineTo(...at) : this.context.moveTo(...at);
    });
    if (isClosed) this.context.closePath();
  }

  stroke(color, width = 1, dash = []) {
    this.context.strokeStyle = color;
    this.context.lineWidth = width;
    this.context.setLineDash(dash);
    this.context.stroke();
    this.context.setLineDash([]);
  }

  fill(color, alpha) {
    this.context.globalAlpha = alpha;
    this.context.fillStyle = color;
    this.context.fill();
    this.context.globalAlpha = 1;
  }

  grid(width, height) {
    const [left, top] = this.view.toMap(0, 0), [right, bottom] = this.view.toMap(width, height);
    const step = this.view.scale > 18 ? 1 : 5;
    this.context.beginPath();
    for (let x = Math.ceil(left / step) * step; x <= right; x += step) {
      const [px] = this.view.toScreen(x, 0);
      this.context.moveTo(px, 0);
      this.context.lineTo(px, height);
    }
    for (let y = Math.ceil(bottom / step) * step; y <= top; y += step) {
      const [, py] = this.view.toScreen(0, y);
      this.context.moveTo(0, py);
      this.context.lineTo(width, py);
    }
    this.stroke(this.color("--line"), 0.5);
  }

  walls(setup) {
    this.context.beginPath();
    for (const line of [...(setup.walls || []), ...(setup.map || [])]) {
      line.forEach(([x, y], i) => {
        const at = this.view.toScreen(x, y);
        i ? this.context.lineTo(...at) : this.context.moveTo(...at);
      });
    }
    this.stroke(this.color("--wall"), 1.5);
  }

  trail(samples) {
    this.line(samples.filter((sample) => sample[6]).map((sample) => sample[6]));
    this.stroke(this.color("--good"), 1.2, [4, 3]);
    this.line(samples.filter((sample) => sample[5]).map((sample) => sample[5]));
    this.stroke(this.color("--faint"), 1.2);
  }

  path(scene) {
    if (scene.path.length > 1) {
      this.line(scene.path);
      this.stroke(this.color("--accent"), 2, [8, 4]);
    }
    if (scene.goal) {
      const [x, y, tolerance] = scene.goal, at = this.view.toScreen(x, y);
      this.context.beginPath();
      this.context.arc(...at, Math.max(5, tolerance * this.view.scale), 0, 7);
      this.stroke(this.color("--accent"), 2);
      this.context.beginPath();
      this.context.arc(...at, 3, 0, 7);
      this.fill(this.color("--accent"), 1);
    }
  }

  freeSpace(robot, ends) {
    if (ends.length < 3) return;
    this.line([[robot.x, robot.y], ...ends.map((end) => fromRobot(robot, end))], true);
    this.fill(this.color("--good"), 0.12);
    this.stroke(this.color("--good"), 0.8);
  }

  scan(robot, scan) {
    for (const [azimuth, cone, range, x, y] of scan.beams) {
      const hasEcho = range >= 0, reach = hasEcho ? range : scan.max_m;
      const points = [[x, y]];
      const steps = cone > 0.03 ? 8 : 1;
      for (let i = 0; i <= steps; i++) {
        const direction = azimuth + cone * (i / steps - 0.5);
        points.push([x + reach * Math.cos(direction), y + reach * Math.sin(direction)]);
      }
      this.line(points.map((point) => fromRobot(robot, point)), true);
      this.fill(hasEcho ? this.color("--warn") : this.color("--faint"), hasEcho ? 0.22 : 0.06);
      if (hasEcho) {
        this.line(points.slice(1).map((point) => fromRobot(robot, point)));
        this.stroke(this.color("--warn"), 2);
      }
    }
  }

  obstacles(robot, obstacles) {
    for (const obstacle of obstacles) {
      const at = this.view.toScreen(...fromRobot(robot, [obstacle.x, obstacle.y]));
      this.context.beginPath();
      this.context.arc(...at, Math.max(3, obstacle.radius_m * this.view.scale), 0, 7);
      this.fill(this.color("--bad"), 0.15 + 0.35 * obstacle.confidence);
      this.stroke(this.color("--bad"), 1.5);
    }
  }

  proposals(robot, memory) {
    for (const behavior of memory.state.behaviors) {
      if (!behavior.motion) continue;
      const points = motionPath(robot, behavior.motion);
      this.line(points);
      const color = window.yamabicoColor(behavior.name);
      this.stroke(color, behavior.drives ? 4 : 1.8, behavior.drives ? [] : [3, 3]);
      this.arrowHead(points, color, behavior.drives ? 10 : 7);
    }
  }

  arrowHead(points, color, size) {
    const tip = this.view.toScreen(...points[points.length - 1]);
    const before = this.view.toScreen(...points[points.length - 2]);
    const direction = Math.atan2(tip[1] - before[1], tip[0] - before[0]);
    if (Math.hypot(tip[0] - before[0], tip[1] - before[1]) < 0.05) return;
    this.context.beginPath();
    this.context.moveTo(tip[0] + size * Math.cos(direction), tip[1] + size * Math.sin(direction));
    for (const side of [2.5, -2.5]) {
      this.context.lineTo(tip[0] + size * Math.cos(direction + side), tip[1] + size * Math.sin(direction + side));
    }
    this.context.closePath();
    this.fill(color, 1);
  }

  overlays(robot, overlays) {
    for (const { layers } of overlays) {
      for (const layer of layers) {
        if (layer.space !== "robot" || layer.isHidden) continue;
        for (const [kind, x, y, x2, y2, text] of layer.marks) {
          const a = this.view.toScreen(...fromRobot(robot, [x, y]));
          const b = this.view.toScreen(...fromRobot(robot, [x2, y2]));
          drawMark(this.context, kind, a, b, x2 * this.view.scale, text, layer.color);
        }
      }
    }
  }

  ellipse(pose) {
    if (!pose.ellipse) return;
    const [a, b, direction] = pose.ellipse;
    this.context.beginPath();
    const size = (axis) => Math.max(0.5, 3 * axis * this.view.scale);
    this.context.ellipse(...this.view.toScreen(pose.x, pose.y), size(a), size(b), -direction, 0, 7);
    this.fill(this.color("--accent"), 0.2);
    this.stroke(this.color("--accent"), 1);
  }

  robot(pose, radius, color, dash) {
    const at = this.view.toScreen(pose.x, pose.y), size = Math.max(5, (radius || 0.2) * this.view.scale);
    this.context.beginPath();
    this.context.arc(...at, size, 0, 7);
    if (!dash.length) this.fill(this.color("--panel"), 0.6);
    this.stroke(color, 2, dash);
    this.context.beginPath();
    this.context.moveTo(...at);
    this.context.lineTo(at[0] + size * Math.cos(pose.theta), at[1] - size * Math.sin(pose.theta));
    this.stroke(color, 2);
  }

  scaleBar(height) {
    const length = this.view.scale > 60 ? 1 : this.view.scale > 18 ? 2 : 5;
    this.context.beginPath();
    this.context.moveTo(12, height - 12);
    this.context.lineTo(12 + length * this.view.scale, height - 12);
    this.stroke(this.color("--text"), 2);
    this.context.fillStyle = this.color("--text");
    this.context.font = "12px system-ui, sans-serif";
    this.context.fillText(`${length} m`, 14, height - 18);
  }
}

/** A mark of an overlay on the screen. */
export function drawMark(context, kind, a, b, radius, text, color) {
  context.strokeStyle = context.fillStyle = color;
  context.lineWidth = 1.6;
  context.beginPath();
  switch (kind) {
    case 2: context.arc(...a, 2, 0, 7); context.fill(); break;
    case 3: context.moveTo(...a); context.lineTo(...b); context.stroke(); break;
    case 4: context.arc(...a, Math.max(1, radius), 0, 7); context.stroke(); break;
    case 5: context.font = "12px system-ui, sans-serif"; context.textBaseline = "top"; context.fillText(text, ...a); context.textBaseline = "alphabetic"; break;
  }
}

/** A point of the robot frame on the map. */
function fromRobot({ x, y, theta }, [forward, left]) {
  const [sin, cos] = [Math.sin(theta), Math.cos(theta)];
  return [x + forward * cos - left * sin, y + forward * sin + left * cos];
}

/** The path that a motion leads along in two seconds. */
function motionPath(robot, { linear, lateral, angular }) {
  const points = [];
  let [x, y, theta] = [0, 0, 0];
  const steps = 16, dt = PREVIEW_S / steps;
  for (let i = 0; i <= steps; i++) {
    points.push(fromRobot(robot, [x, y]));
    x += (linear * Math.cos(theta) - lateral * Math.sin(theta)) * dt;
    y += (linear * Math.sin(theta) + lateral * Math.cos(theta)) * dt;
    theta += angular * dt;
  }
  return points;
}
