"""Trees as an action of a node of your own, beside whatever else that node does.

In one terminal:    bt-actions sim
In another:         python examples/tree_server.py
In a third:         python examples/tree_client.py pick_and_place "{place_at: 4.5}"
"""

import rclpy
from rclpy.executors import ExternalShutdownException, MultiThreadedExecutor

from bt_actions.serving import TreeServer


def main() -> None:
    """Serve the trees of this checkout until Ctrl-C."""
    rclpy.init()
    node = rclpy.create_node("robot")
    executor = MultiThreadedExecutor(num_threads=2)
    executor.add_node(node)
    server = TreeServer(node, trees="trees", policy="queue")
    print(f"ready: {', '.join(entry.name for entry in server.catalog.entries())}", flush=True)
    try:
        executor.spin()
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        server.close()  # cancels what still runs, and waits until it has ended
        executor.shutdown()
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
