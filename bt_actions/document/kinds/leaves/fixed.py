"""`success`, `failure` and `running`: always one status."""

from bt_actions.document.kinds.given import Behaviour, Context, TreeNode, py_trees
from bt_actions.document.language.kinds import SUCCEEDS, Can, Kind, Settings, leaf
from bt_actions.document.language.scalars import NodeName


def _build(node: TreeNode, _context: Context) -> Behaviour:
    them = py_trees.behaviours
    makes = {"success": them.Success, "failure": them.Failure, "running": them.Running}
    return makes[node.kind.name](name=node.name or node.kind.name)


def _fixed(name: str, doc: str, can: Can, *, slow: bool = False) -> Kind:
    def ends(_values: Settings, _inner: list[Can], _at_once: bool) -> Can:
        return can

    value, example = NodeName(optional=True), f"{name}: As it is"
    return leaf(name, value, doc, example, build=_build, ends=ends, slow=slow)


KINDS = (
    _fixed("success", "Succeeds at once.", SUCCEEDS),
    _fixed("failure", "Fails at once.", Can(False, True)),
    _fixed("running", "Never ends.", Can(False, False), slow=True),
)
