"""`service`: a call of a service."""

from bt_actions.document.kinds.given import Behaviour, Context, TreeNode, parts, reading, service
from bt_actions.document.language.keys import NAMESPACE, RESULT, SERVICE_RETRY, SERVICE_TIMEOUT
from bt_actions.document.language.kinds import Interface, leaf
from bt_actions.document.language.ros_names import RosName
from bt_actions.document.language.scalars import Condition, NodeName, Place, TypeName
from bt_actions.document.language.shapes import Key, Table, Values
from bt_actions.document.reading.tree import table_of


def _build(node: TreeNode, context: Context) -> Behaviour:
    values = node.values
    timeout = table_of(values.get("timeout"))
    return service.CallService(
        node.name,
        parts.interface_in(values, "srv", context),
        context.name(values, "server"),
        context.value(values.get("request", {})),
        server=timeout.get("server", 5.0),
        response=timeout.get("response", 5.0),
        retry=parts.retry_of(values, context),
        read=parts.reader(values, context, "expect", "answer", reading.of_result),
    )


KIND = leaf(
    "service",
    NodeName(),
    "Calls a service.",
    "service: Switch the light on\ntype: std_srvs/srv/SetBool\nserver: light\n"
    "request: {data: true}\nexpect: result.success",
    Key("type", TypeName("srv"), "The service's type.", required=True,
        example="std_srvs/srv/SetBool"),
    Key("server", RosName("the name of a service"), "The service.", required=True,
        example="light"),
    Key("request", Values(), "The fields of the request."),
    Key("timeout", SERVICE_TIMEOUT, "How long to wait; a bare duration is that of the answer."),
    Key("retry", SERVICE_RETRY, "How often to try; a bare number is the number of attempts."),
    Key("expect", Condition(RESULT), "A condition on the answer."),
    Key("save", Table(Place(RESULT)), "Variables for parts of the answer."),
    Key("namespace", NAMESPACE, "Put before a relative name."),
    interface=Interface("srv", "server", "request", "Request", "result", "Response"),
    build=_build, begun=True,
)  # fmt: skip
