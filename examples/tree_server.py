"""Trees as an action of a node of your own, beside whatever else that node does.

In one terminal:    bt-actions sim
In another:         python examples/tree_server.py
In a third:         python examples/tree_client.py pick_and_place "{place_at: 4.5}"
"""

import threading

import rclpy
from rclpy.executors import MultiThreadedExecutor
from rclpy.signals import SignalHandlerOptions

from bt_actions.serving import TreeServer


def main() -> None:
    """Serve the trees of this checkout until Ctrl-C."""
    # At Ctrl-C, rclpy's own handler would cut off the clients that have to be answered.
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node("robot")
    executor = MultiThreadedExecutor(num_threads=2)
    executor.add_node(node)
    spinning = threading.Thread(target=executor.spin, daemon=True)
    spinning.start()
    server = TreeServer(node, trees="trees", policy="queue")
    print(f"ready: {', '.join(entry.name for entry in server.catalog.entries())}", flush=True)
    try:
        threading.Event().wait()
    except KeyboardInterrupt:
        pass
    finally:
        server.close()  # cancels what still runs, waits until it has ended, and answers the clients
        executor.shutdown()
        spinning.join()
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
