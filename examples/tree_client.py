"""A client of a server of trees in plain rclpy: run a tree by its name, and say how it ended.

With `bt-actions serve` or examples/tree_server.py in another terminal:
    python examples/tree_client.py pick_and_place "{place_at: 4.5}"
"""

import sys

import rclpy
from bt_actions_interfaces.action import RunTree
from rclpy.action import ActionClient
from rclpy.signals import SignalHandlerOptions


def main(tree: str, inputs: str = "") -> int:
    """Return an exit code: 0 where the tree has succeeded and nothing of it runs any more."""
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)  # Ctrl-C is for the goal, see below
    node = rclpy.create_node("tree_client")
    client = ActionClient(node, RunTree, "run_tree")
    client.wait_for_server()
    sent = client.send_goal_async(RunTree.Goal(tree=tree, inputs=inputs))
    rclpy.spin_until_future_complete(node, sent)
    if not sent.result().accepted:
        print("rejected; the server's log and its topic ~/rejections say why")
        return 2
    ended = sent.result().get_result_async()
    try:
        rclpy.spin_until_future_complete(node, ended)
    except KeyboardInterrupt:  # the result tells what became of it
        rclpy.spin_until_future_complete(node, sent.result().cancel_goal_async())
        rclpy.spin_until_future_complete(node, ended)
    result = ended.result().result
    for action in result.actions:
        print(f"{action.path}: attempts {action.attempts}")
    print(result.outputs if not result.error_code else result.error_msg)
    if not result.settled:
        return 3
    return 1 if result.error_code else 0


if __name__ == "__main__":
    raise SystemExit(main(*sys.argv[1:]))
