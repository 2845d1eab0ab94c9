"""Topics and services on the virtual network, as leaves of a YAML tree use them."""

from pathlib import Path

from py_trees.common import Status
from std_msgs.msg import String
from std_srvs.srv import Trigger

from bt_actions import load_tree
from bt_actions.testing import VirtualNetwork, VirtualRunner

TREE = """
tree: door
root:
  sequence: Through the door
  children:
    - wait_for_message: The door is near
      topic: at_door
      type: std_msgs/msg/String
      timeout: 5 s
    - publish: knock
      type: std_msgs/msg/String
      message: {data: knock}
      subscribers: 1
    - service: Open
      type: std_srvs/srv/Trigger
      server: door
      timeout: 5 s
"""


def test_leaves_hear_speak_and_call(tmp_path: Path) -> None:
    (tmp_path / "door.yaml").write_text(TREE)
    network, heard = VirtualNetwork("/house"), list[str]()
    network.subscribe(String, "knock", lambda message: heard.append(message.data))
    network.provide(Trigger, "door", lambda request: Trigger.Response(success=True), takes=2.0)
    runner = VirtualRunner(load_tree(tmp_path / "door.yaml"), network)
    runner.start()
    assert runner.advance(1.0) is None
    network.publisher(String, "/house/at_door").publish(String(data="here"))
    assert runner.advance(1.0) is None
    assert heard == ["knock"]
    assert runner.advance(2.0) is Status.SUCCESS
