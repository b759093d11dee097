"""Draws a recorded run of configs/hallway.toml as an animated GIF: camera image with map edges and obstacles, and the map.

    python3 -m venv venv && . venv/bin/activate && pip install mcap pillow numpy
    cargo run --release -- run configs/hallway.toml --seed 1
    python configs/pictures/hallway_gif.py out/hallway/latest/run.mcap configs/pictures/hallway.gif
"""

import io
import json
import math
import sys
import tomllib
from pathlib import Path

import numpy as np
from mcap.reader import make_reader
from PIL import Image, ImageDraw, ImageFilter, ImageFont

CONFIGS = Path(__file__).resolve().parent.parent
WIDTH, HEIGHT, FOV_DEG = 256, 240, 60.0  # the camera of robots/sim-hallway.toml
MOUNT_Z_M, TILT_RAD = 0.6, math.radians(6.0)
STEP_S = 0.9
COLORS = {
    "map-localizer": (142, 56, 168),
    "stationary-obstacle-avoider": (16, 140, 84),
    "wall-follower": (222, 128, 20),
    "sonar-halt": (204, 28, 28),
}
HALT = (204, 28, 28)
GRAY = (126, 126, 126)
EDGE = (70, 130, 255)
OBSTACLE = (240, 40, 40)
MAP_WIDTH = 540


def read(path):
    """The messages that are drawn, by topic: a list of (time in seconds, value)."""
    images = "/sensors/front/image"
    topics = {
        "pose": "behaviors/map-localizer/pose",
        "obstacles": "behaviors/stationary-obstacle-avoider/obstacles",
        "decision": "decision",
        "sonar": "sensors/sonar",
    }
    messages = {name: [] for name in (*topics, "image")}
    with open(path, "rb") as file:
        for _, channel, message in make_reader(file).iter_messages():
            if channel.topic == images:
                start = message.data.find(b"\x89PNG")
                image = Image.open(io.BytesIO(message.data[start:])).convert("L")
                messages["image"].append((message.log_time * 1e-9, image))
            for name, topic in topics.items():
                if channel.topic == topic:
                    messages[name].append((message.log_time * 1e-9, json.loads(message.data)))
    return messages


def latest(messages, time_s):
    """The newest value at an instant."""
    found = None
    for stamp_s, value in messages:
        if stamp_s > time_s:
            break
        found = value
    return found


def pixel(pose, point):
    """The pixel of a point in the map frame, or None behind the camera."""
    x, y, theta = pose
    dx, dy = point[0] - x, point[1] - y
    ahead = math.cos(theta) * dx + math.sin(theta) * dy
    left = -math.sin(theta) * dx + math.cos(theta) * dy
    up = point[2] - MOUNT_Z_M
    forward = math.cos(TILT_RAD) * ahead - math.sin(TILT_RAD) * up
    down = -(math.sin(TILT_RAD) * ahead + math.cos(TILT_RAD) * up)
    if forward < 0.15:
        return None
    focal = 0.5 * WIDTH / math.tan(math.radians(FOV_DEG) / 2)
    return (0.5 * (WIDTH - 1) - focal * left / forward, 0.5 * (HEIGHT - 1) + focal * down / forward)


def clipped(pose, start, end):
    """The part of a map edge in front of the camera, in pixels."""
    points = [np.array(start) + (np.array(end) - np.array(start)) * share for share in np.linspace(0, 1, 24)]
    pixels = [pixel(pose, point) for point in points]
    return [p for p in pixels if p is not None]


def camera(image, pose, edges, obstacles):
    """The camera image with the edges that the map expects and the obstacles that the avoider reports."""
    picture = image.filter(ImageFilter.MedianFilter(3)).convert("RGB")
    draw = ImageDraw.Draw(picture)
    for edge in edges:
        line = clipped(pose, edge["from_m"], edge["to_m"])
        if len(line) > 1 and math.dist(edge["from_m"][:2], pose[:2]) < 9.0:
            draw.line(line, fill=EDGE, width=1)
    for obstacle in obstacles:
        x, y, theta = pose
        center = (
            x + math.cos(theta) * obstacle["x"] - math.sin(theta) * obstacle["y"],
            y + math.sin(theta) * obstacle["x"] + math.cos(theta) * obstacle["y"],
        )
        ring = [
            pixel(pose, (center[0] + obstacle["radius_m"] * math.cos(a), center[1] + obstacle["radius_m"] * math.sin(a), 0.0))
            for a in np.linspace(0, 2 * math.pi, 25)
        ]
        ring = [p for p in ring if p is not None]
        if len(ring) > 2:
            draw.line(ring, fill=OBSTACLE, width=2)
    return picture


def top_view(size, walls, trail, pose, obstacles, scan):
    """The map with the path driven so far, colored by the behavior in control, obstacles and sonar beams."""
    width, height = size
    picture = Image.new("RGB", size, "white")
    draw = ImageDraw.Draw(picture)
    scale = width / 15.4

    def at(x, y):
        return (12 + (x + 0.6) * scale, height / 2 - y * scale)

    for wall in walls:
        draw.line([at(*wall["from_m"][:2]), at(*wall["to_m"][:2])], fill=(90, 90, 90), width=2)
    for start, end, color in trail:
        draw.line([at(*start), at(*end)], fill=color, width=4)
    x, y, theta = pose
    for beam in scan:
        angle = theta + beam["azimuth_rad"]
        reach = beam["range_m"]
        end = (x + reach * math.cos(angle), y + reach * math.sin(angle))
        draw.line([at(x, y), at(*end)], fill=(190, 190, 190), width=1)
    for obstacle in obstacles:
        ox = x + math.cos(theta) * obstacle["x"] - math.sin(theta) * obstacle["y"]
        oy = y + math.sin(theta) * obstacle["x"] + math.cos(theta) * obstacle["y"]
        r = obstacle["radius_m"] * scale
        u, v = at(ox, oy)
        draw.ellipse([u - r, v - r, u + r, v + r], outline=OBSTACLE, width=2)
    u, v = at(x, y)
    r = 0.2 * scale
    draw.ellipse([u - r, v - r, u + r, v + r], outline=(0, 0, 0), width=2)
    draw.line([u, v, u + 2 * r * math.cos(theta), v - 2 * r * math.sin(theta)], fill=(0, 0, 0), width=2)
    return picture


def main(recording, output):
    messages = read(recording)
    world = tomllib.loads((CONFIGS / "maps/hallway.toml").read_text())
    edges = [edge for edge in world["edge"] if edge.get("role") != "detail"]
    walls = [edge for edge in world["edge"] if edge["from_m"][2] == edge["to_m"][2] > 2.5]
    font = ImageFont.load_default(size=13)
    end_s = messages["decision"][-1][0]
    frames, trail, last = [], [], None
    time_s = 1.5
    while time_s <= end_s + STEP_S:
        pose = latest(messages["pose"], time_s)
        decision = latest(messages["decision"], time_s)
        obstacles = (latest(messages["obstacles"], time_s) or {"items": []})["items"]
        scan = latest(messages["sonar"], time_s)["items"]
        here = (pose["x"], pose["y"], pose["theta"])
        halter = decision["halter"][0]
        color = HALT if halter else COLORS.get(decision["source"][0], GRAY)
        if last is not None:
            trail.append((last[:2], here[:2], color))
        last = here
        frame = Image.new("RGB", (WIDTH + MAP_WIDTH, HEIGHT), "white")
        frame.paste(camera(latest(messages["image"], time_s), here, edges, obstacles), (0, 0))
        frame.paste(top_view((MAP_WIDTH, 116), walls, trail, here, obstacles, scan), (WIDTH, HEIGHT - 116))
        draw = ImageDraw.Draw(frame)
        speed = decision["commanded"]["linear"]
        draw.text((WIDTH + 14, 6), f"{time_s:5.1f} s   {speed:.2f} m/s", fill=(0, 0, 0), font=font)
        for row, verdict in enumerate(decision["items"]):
            name = verdict["behavior"]
            acts = verdict["won"] != "none" or halter == name
            ink = (HALT if halter == name else COLORS[name]) if acts else GRAY
            line = f"{verdict['priority']:4d}  {name}"
            draw.text((WIDTH + 14, 28 + 18 * row), line, fill=ink, font=font)
            what = "halts the robot" if halter == name else verdict["outcome_text"].replace("-", "")
            reason = verdict["reason_text"]
            what += f": {reason}" if reason not in ("nominal", "no reason given") else ""
            draw.text((WIDTH + 270, 28 + 18 * row), what, fill=ink, font=font)
        frames.append(frame)
        time_s += STEP_S
    palette = Image.new("P", (1, 1))
    colors = [(level, level, level) for level in range(0, 256, 9)] + [*COLORS.values(), GRAY, EDGE, OBSTACLE]
    palette.putpalette([value for color in colors for value in color])
    frames = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    durations = [170] * (len(frames) - 1) + [2500]
    frames[0].save(output, save_all=True, append_images=frames[1:], duration=durations, loop=0, optimize=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
