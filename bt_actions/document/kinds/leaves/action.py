"""`action`: a goal, with type and server in place or by a name under `actions`."""

from bt_actions.document.kinds.given import Behaviour, Context, TreeNode, action, parts, reading
from bt_actions.document.language.keys import ACTION_NAME, ACTION_TYPE, DOING, GATES
from bt_actions.document.language.kinds import ACTION, leaf
from bt_actions.document.language.scalars import NodeName
from bt_actions.document.language.values import computed_in
from bt_actions.document.reading.tree import SAVES, settings_of, text_of


def _build(node: TreeNode, context: Context) -> Behaviour:
    settings = settings_of(node, context.document)
    overrides_alias = not node.values.keys() <= {node.key.text, *_OWN}
    shared = None if overrides_alias else context.shared.get(node.alias)
    if shared is None:
        shared = {
            "action_type": parts.interface_in(settings, "action", context),
            "action_name": context.name(settings, "server"),
            **parts.goal_settings(settings, context, reading.of_result),
            "until": context.condition(settings.get("until"), reading.of_feedback),
        }
        if not overrides_alias:
            context.shared[node.alias] = shared
    goal = settings.get("goal", {})
    result = shared["action_type"].Result if context.types else None
    return action.ActionBehaviour(
        node.name,
        goal=context.value(goal) if computed_in(goal) else goal,
        save=context.saved(settings.get("save"), reading.of_result, result),
        save_on_failure=context.saved(settings.get("save_on_failure"), reading.of_failure),
        save_feedback=context.saved(settings.get("save_feedback"), reading.of_feedback),
        on_change=text_of(settings, "on_change") or "ignore",
        **shared,
    )


_OWN = ("goal", *SAVES, *GATES)
"""Keys of an action's node that leave the rest to be shared with others of the action."""
KIND = leaf(
    "action",
    NodeName(),
    "Sends a goal to an action; as a name under `actions`, but with type and server in the node.",
    "action: To the part\ntype: robot_control_interfaces/action/MoveRobot\n"
    "server: move_robot\ngoal: {distance: 2.0}\ntimeout: 30 s",
    ACTION_TYPE, ACTION_NAME, *DOING, interface=ACTION, build=_build, begun=True,
)  # fmt: skip
