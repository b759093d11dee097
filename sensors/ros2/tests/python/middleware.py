"""Nodes over the middleware that the variable `MIDDLEWARE` names: those of rclpy over `dds`, or with the wire of rmw_zenoh over `zenoh`."""

import os

IS_ZENOH = os.environ.get("MIDDLEWARE") == "zenoh"
# What the run gets. rclpy itself has one middleware only, with which it also encodes the messages that go over Zenoh.
ENVIRONMENT = {**os.environ, "RMW_IMPLEMENTATION": "rmw_zenoh_cpp" if IS_ZENOH else "rmw_fastrtps_cpp"}

if IS_ZENOH:
    from zenoh_node import create_node, foreign_type, init, spin
else:
    import threading

    import rclpy
    from foreign_types import foreign_type
    from rclpy import create_node, init

    def spin(node):
        """Calls the timers and subscriptions of a node from now on, beside this thread."""
        executor = rclpy.executors.SingleThreadedExecutor()
        executor.add_node(node)
        threading.Thread(target=executor.spin, daemon=True).start()


__all__ = ["ENVIRONMENT", "IS_ZENOH", "create_node", "foreign_type", "init", "spin"]
