"""The world, its score and the maps. Those that simulate need MuJoCo, and are skipped without it."""

import importlib.util
import sys
import tempfile
import unittest
from math import pi
from pathlib import Path

FOLDER = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(FOLDER))

from hall import table  # noqa: E402
from hall.job import Results, jobs  # noqa: E402
from hall.plan import Plan  # noqa: E402
from hall.scenario import FLOORS, TASKS, Surface, draw  # noqa: E402
from hall.wire_frame import MAPS, text  # noqa: E402

simulates = unittest.skipUnless(importlib.util.find_spec("mujoco"), "MuJoCo is not installed")


class Maps(unittest.TestCase):
    def test_the_maps_in_configs_are_those_of_the_plan(self):
        for name, crosses in MAPS.items():
            written = (FOLDER / f"../../configs/maps/{name}.toml").read_text()
            self.assertEqual(written, text(name, Plan(crosses=crosses)), "write it anew: python -m hall.wire_frame")

    def test_the_walls_close_the_building(self):
        for crosses in (False, True):
            walls = Plan(crosses=crosses).walls()
            for wall, following in zip(walls, walls[1:] + walls[:1], strict=True):
                self.assertEqual(wall.end, following.begin)


class Scenarios(unittest.TestCase):
    def test_a_seed_gives_the_same_boxes_and_person_in_every_task(self):
        for seed in range(1, 30):
            drawn = {task: draw(task, seed) for task in TASKS}
            self.assertEqual(drawn["empty"].boxes, ())
            self.assertEqual(drawn["boxes"].boxes[0], drawn["full"].boxes[0])
            self.assertEqual(drawn["person"].crossing, drawn["full"].crossing)
            self.assertTrue(all(abs(y) <= 0.6 for _, y, _ in drawn["boxes"].boxes))


class Comparison(unittest.TestCase):
    def test_results_are_found_again_and_counted(self):
        wanted = jobs(["map", "truth"], ["empty", "full"], list(FLOORS), [1, 2], [1, 2, 3, 4])
        self.assertEqual(len(set(wanted)), 2 * 2 * 4 * 2)
        with tempfile.TemporaryDirectory() as folder:
            results = Results(Path(folder, "results.jsonl"))
            results.add(wanted[0].result("error", "it broke"))
            again = Results(results.path)
            self.assertTrue(again.has(wanted[0]))
            self.assertFalse(again.has(wanted[1]))
            self.assertIn("0, 0, 1", table.markdown(again.runs))
            self.assertIn("it broke", table.line(again.runs[0]))

    def test_the_interval_of_a_proportion(self):
        low, high = table.wilson_interval(9, 10)
        self.assertAlmostEqual(low, 0.596, places=3)
        self.assertAlmostEqual(high, 0.982, places=3)
        self.assertEqual(table.wilson_interval(0, 0), (0.0, 1.0))


@simulates
class Simulation(unittest.TestCase):
    def episode(self, task, seed, floor="linoleum"):
        from hall.episode import Episode
        from hall.world import World

        scenario, surface = draw(task, seed), Surface(floor, 1)
        world = World(scenario, surface, seed)
        self.addCleanup(world.close)
        return Episode(scenario, surface, seed, world)

    def test_the_same_seed_gives_the_same_poses_images_and_ranges(self):
        def trace(seed):
            episode = self.episode("boxes", seed)
            poses = []
            for _ in range(10):
                episode.step(0.4, 0.1)
                poses.append(episode.pose)
            return poses, episode.world.image().tobytes(), episode.world.ranges(), episode.world.odometry()

        self.assertEqual(trace(3), trace(3))
        self.assertNotEqual(trace(3), trace(4))

    def test_images_draw_no_noise_from_the_drive(self):
        first, second = self.episode("empty", 1), self.episode("empty", 1)
        for _ in range(10):
            first.world.image()
            first.world.ranges()
            first.step(0.4, 0.0)
            second.step(0.4, 0.0)
        self.assertEqual(first.pose, second.pose)

    def test_a_box_ahead_is_heard_and_touched(self):
        episode = self.episode("boxes", 1)
        x, y, color = episode.scenario.boxes[0]
        nearest = 9.0
        while episode.outcome is None:
            pose = episode.pose
            nearest = min(nearest, episode.world.ranges()[1])
            episode.step(0.6, 3 * (y - pose.y) - 3 * pose.theta if pose.x < x - 0.6 else 0.0)
        result = episode.result()
        self.assertEqual((result["outcome"], result["contact"], result["passive"]), ("contact", f"box_{color}", False))
        self.assertLess(nearest, 0.5)
        self.assertLess(abs(episode.pose.x - x), 0.5)

    def test_a_robot_that_stands_is_stuck(self):
        episode = self.episode("empty", 1)
        while episode.outcome is None:
            episode.step(0.0, 0.0)
        self.assertEqual(episode.outcome, "stuck")
        self.assertAlmostEqual(episode.time_s, 30, delta=1)

    def test_a_person_who_walks_into_the_standing_robot_is_no_fault_of_the_robot(self):
        episode = self.episode("person", 3)
        crossing = episode.scenario.crossing
        while episode.outcome is None:
            pose = episode.pose
            episode.step(0.8 if pose.x < crossing.x_m - 0.2 else 0.0, -2 * pose.theta - 1.5 * pose.y)
        result = episode.result()
        self.assertEqual((result["outcome"], result["contact"], result["passive"]), ("contact", "person", True))

    def test_a_command_that_is_not_finite_is_refused(self):
        episode = self.episode("empty", 1)
        with self.assertRaisesRegex(ValueError, "finite"):
            episode.world.step(float("nan"), 0.0, 0.02)

    def test_floors_look_different(self):
        levels = {floor: self.episode("empty", 1, floor).world.gray_image()[200:].mean() for floor in FLOORS}
        self.assertEqual(len({round(level, 1) for level in levels.values()}), len(FLOORS))

    def test_odometry_is_relative_to_the_start(self):
        episode = self.episode("empty", 2)
        self.assertEqual(episode.world.odometry(), (0.0, 0.0, 0.0))
        for _ in range(100):
            episode.step(0.4, 0.0)
        x, y, theta = episode.world.odometry()
        self.assertAlmostEqual(x, episode.score.path_m, delta=0.05)
        self.assertTrue(-pi < theta <= pi and abs(y) < 0.2)


if __name__ == "__main__":
    unittest.main()
