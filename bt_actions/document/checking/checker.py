"""The common ground of all checks of names and types: what a document declares, writes and reads.

This file checks single values and expressions; `check.py` has the order of all checks. With
`types=False` the checker does not import ROS, and accepts every part that only ROS could check.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Container
from collections.abc import Mapping as MappingType
from functools import lru_cache
from typing import TYPE_CHECKING

from bt_actions.document.checking.infer import Wrong, infer
from bt_actions.document.checking.unmarked import marked_here, warn_unmarked
from bt_actions.document.checking.value_types import (
    BOOL,
    TEXT,
    common_type,
    infer_variables,
    items_inside,
    named,
    type_of_literal,
)
from bt_actions.document.findings import Related, Span
from bt_actions.document.findings.elsewhere import notation_here
from bt_actions.document.language.kinds import ACTION, Interface
from bt_actions.document.language.types import (
    Either,
    TypeNameError,
    fits,
    interface_of,
    misfits,
    parse_type,
)
from bt_actions.document.language.values import (
    BAD,
    Computed,
    Interpolated,
    computed_in,
    constant_of,
    locate,
    names_file,
)
from bt_actions.document.reading.inputs import refuse_infinite
from bt_actions.document.reading.tree import (
    SAVES,
    Declared,
    Document,
    TreeNode,
    Write,
    table_of,
    when_of,
    writes_of,
)
from bt_actions.document.reading.unread import Doubts
from bt_actions.document.yaml.mistaken import warn_bare_angle, warn_bare_duration
from bt_actions.document.yaml.nodes import Node, Scalar, span_of
from bt_actions.document.yaml.source import Source
from bt_actions.expressions.expression import Expression
from bt_actions.expressions.text import ExpressionError
from bt_actions.messages.conversion import ANGLE, examine
from bt_actions.messages.fields import FieldType, Listing, Message, describe
from bt_actions.messages.interfaces import DURATION, interface_name
from bt_actions.utilities.suggest import closest, listing

if TYPE_CHECKING:
    from bt_actions.document.language.classes import Python

Types = MappingType[str, FieldType | None]


@lru_cache(maxsize=1024)
def _parts(cls: type | None, interface: Interface) -> tuple[FieldType | None, Types]:
    """Return the type of the sent message, and the root of expressions over the received one."""
    more: Types = dict.fromkeys(interface.more)
    if cls is None:
        return None, {interface.root: None, **more}
    received = Message(interface.part(cls, interface.received))
    return Message(interface.part(cls, interface.sent)), {interface.root: received, **more}


def _feedback(cls: type | None) -> FieldType | None:
    """Return the type of an action's feedback; None of what is no action, or not known."""
    feedback = getattr(cls, "Feedback", None)
    return None if feedback is None else Message(feedback)


def _all_computed(
    kind: FieldType, value: object, types: MappingType[int, FieldType | None]
) -> bool:
    """Return whether a message's fields are all read from variables that fit."""
    if not isinstance(value, dict) or not isinstance(kind, Message):
        return False
    given = []
    for part in value.values():
        if type(part) is not Computed or not part.expression.variables:
            return False
        given.append(types[id(part)])
    return _fill(kind, tuple(value), *given)


@lru_cache(maxsize=4096)
def _fill(kind: Message, names: tuple[str, ...], *given: FieldType | None) -> bool:
    """Return whether values of such types fit the fields of these names."""
    wanted = describe(kind.cls)
    return all(
        name in wanted and fits(one, wanted[name]) and not misfits(one, wanted[name])
        for name, one in zip(names, given, strict=True)
    )


@lru_cache(maxsize=4096)
def _noted(*_key: object) -> list[tuple[FieldType | None, list[Wrong]]]:
    """Return the list for the type of right expressions with one form and the same read types.

    The list is kept for other trees, as the form is.
    """
    return []


class Checker:
    """The knowledge about one document; each included tree has a checker of its own."""

    def __init__(
        self,
        document: Document,
        *,
        types: bool,
        python: Python = True,
        used: Container[int] | None = None,
    ) -> None:
        """Check a document; a ``python:`` node outside of `python` is an error, never imported.

        Of a library that trees import, `used` are the ids of the nodes that declare their actions.
        """
        self.document = document
        self.source = document.source
        self.doubts = Doubts(document)
        self._doubts_of: dict[int, Doubts] = {}
        self.types = types
        self.python = python
        self.variables: dict[str, FieldType | None] = {}
        self.declared_at: dict[str, Declared] = {}
        self.reads = defaultdict[int, list[Computed]](list)
        """The expressions that read variables, by the node's id (or by that of the alias)."""
        self.reader: object = document
        self.writes = defaultdict[int, list[Write]](list)
        """The writes of each node, by the node's id, in the order of the text."""
        self._items: dict[int, dict[str, Write]] = {}
        self._interfaces: dict[str, type | None] = {}
        self._classes: dict[str, type | None] = {}
        self._used = used

    def interface(
        self, name: str, kind: str, node: Node, source: Source | None = None
    ) -> type | None:
        """Return the class of a type name; None after a report, or where types are not checked.

        A mistake in another source is reported by the checker of that source.
        """
        if not self.types:
            return None
        known = f"{kind}:{name}"
        if known not in self._interfaces:
            try:
                self._interfaces[known] = interface_of(name, kind)  # type: ignore[arg-type]
            except TypeNameError as error:
                self._interfaces[known] = None
                if source is None or source is self.source:
                    self.source.report("BT205", span_of(node), str(error))
        return self._interfaces[known]

    def doubts_of(self, included: Document) -> Doubts:
        """Return the doubts about a tree that this one includes."""
        known = self._doubts_of.get(id(included))
        if known is None:
            known = self._doubts_of[id(included)] = Doubts(included)
        return known

    def _types_at(self, reader: object) -> Callable[[str], FieldType | None]:
        """Return a function for the type of a variable as a node reads it."""
        items = self._items.get(id(reader))
        if items is None:
            return self.variables.get
        return lambda name: (
            self._type_of(items[name]) if name in items else self.variables.get(name)
        )

    def collect_writes(self) -> None:
        """Find the variables that nodes write, with their types as far as they are known."""
        writers = defaultdict[str, list[Write]](list)
        for node in self.document.nodes():
            for write in writes_of(node, self.document):
                self.writes[id(node)].append(write)
                writers[write.name].append(write)
        self._items = items_inside(writers, self.declared_at)
        infer_variables(writers, self.variables, self._type_of)

    def action_class(self, declared: Declared) -> type | None:
        name = declared.name
        if name not in self._classes:
            text, at = declared.values.get("type"), declared.written("type")
            self._classes[name] = None
            is_used = self._used is None or id(declared.node) in self._used
            if isinstance(text, str) and is_used:
                self._classes[name] = self.interface(text, "action", at, declared.source)
        return self._classes[name]

    def written_by(self, node: TreeNode) -> frozenset[str]:
        """Return the names of the variables that a node itself writes."""
        writes = self.writes.get(id(node))
        return frozenset([write.name for write in writes]) if writes else frozenset()

    def class_of(self, node: TreeNode) -> type | None:
        """Return the class of a node's interface, or None after a report."""
        if node.alias is not None:
            return self.action_class(self.document.actions[node.alias])
        interface = node.kind.interface
        name = interface and (interface.type or node.values.get("type"))
        if interface is None or not isinstance(name, str):
            return None
        return self.interface(name, interface.kind, node.written.get("type", node.key))

    def received(self, node: TreeNode, root: str = "") -> FieldType | None:
        """Return the type of what a node receives: a result, feedback, an answer, a message."""
        cls, interface = self.class_of(node), node.kind.interface
        if root == "feedback":
            return _feedback(cls)
        return _parts(cls, interface)[1][interface.root] if interface is not None else None

    def declared_type(self, declared: Declared | None) -> FieldType | None:
        """Return the type of an input or an output; None without one, reported elsewhere."""
        text = declared.values.get("type") if declared is not None else None
        try:
            return parse_type(text, types=self.types) if isinstance(text, str) else None
        except TypeNameError:
            return None

    def output_type(self, node: TreeNode, name: object) -> FieldType | None:
        """Return the type of an output of a declared kind; None without one."""
        outputs = table_of(self.document.kinds[node.key.text].values.get("outputs"))
        try:
            return parse_type(str(table_of(outputs.get(str(name))).get("type")), types=self.types)
        except TypeNameError:
            return None

    def _type_of(self, write: Write) -> FieldType | None:
        """Return the type of a written value, without any report."""
        node, value = write.node, write.value
        if node.kind.includes:
            outputs = node.included.outputs if node.included is not None else {}
            return self.declared_type(outputs.get(str(value)))
        if node.key.text in self.document.kinds and node.alias is None:
            return self.output_type(node, value)
        if write.root == "item of" and isinstance(value, list):
            return common_type([type_of_literal(item) for item in value])
        if isinstance(value, Interpolated):
            return TEXT
        if not isinstance(value, Computed):
            return type_of_literal(value) if write.root != "item of" else None
        roots = {write.root: self.received(node, write.root)} if write.root else {}
        kind = self.infer(value.expression, roots, node)[0]
        if write.root == "item of":
            return kind.item if isinstance(kind, Listing) else None
        return kind

    def call(
        self,
        values: MappingType[str, object],
        written: MappingType[str, Node],
        cls: type | None,
        interface: Interface = ACTION,
    ) -> None:
        """Check the settings that all kinds with an interface share."""
        key = interface.fields
        asked, roots = _parts(cls, interface)
        fed: Types = {"feedback": _feedback(cls)}
        if key in values and key in written:
            self.value(asked, values[key], written[key])
        self.condition(values.get("expect"), roots)
        if "until" in values:
            self.condition(values["until"], fed if interface.kind == "action" else roots)
        if "retry" in values:
            self.condition(when_of(values), roots)
        for key in SAVES:
            if key not in values:
                continue
            saved = {"save": roots, "save_feedback": fed}.get(key, {**roots, "outcome": TEXT})
            for name, place in table_of(values[key]).items():
                if isinstance(place, Computed):
                    self.assigns(name, self.expression(place, saved), place.node)
        own, *others = (table_of(values.get(key)) for key in SAVES)
        for key, other in zip(SAVES[1:], others, strict=True):
            for name in own.keys() & other.keys() if other else ():
                text = f"{name!r} is also saved after a success: its value would not tell which"
                self.source.report("BT216", span_of(written[key]), text)

    def assigns(self, name: str, kind: FieldType | None, node: Node) -> None:
        """Check that a value of a type may be written to a variable."""
        declared = self.declared_at.get(name)
        if declared is None:
            return
        if name in self.document.topics:
            message = f"{name!r} is a topic: nothing can be written to it"
            related = Related(declared.place, "declared here")
            self.source.report("BT204", span_of(node), message, related=related)
            return
        wanted = self.variables.get(name)
        texts = [f"{name}{text}" for text in misfits(kind, wanted)]
        if not fits(kind, wanted):
            texts = [f"{name!r} is {named(wanted)}, and this is {named(kind)}"]
        for text in texts:
            related = Related(declared.place, "declared here")
            self.source.report("BT204", span_of(node), text, related=related)

    # Values

    def value(
        self, kind: FieldType | None, value: object, node: Node, *, prose: bool = False
    ) -> None:
        """Check a value against the type it must have; without a type, only the variables it reads.

        In `prose` a variable's bare name is a word like any other.
        """
        errors = self.source.errors
        self.fit(kind, value, node, self.variables)
        if value is not BAD and self.source.errors == errors:
            warn_unmarked(node, self.source, self.variables, prose=prose)

    def fit(self, kind: FieldType | None, value: object, node: Node, known: Container[str]) -> None:
        """Check as `value`; a bare name may mean one of `known` where the value does not fit."""
        if value is BAD:
            return
        types = {id(part): self.expression(part, {}) for part in computed_in(value)}
        if kind is None or _all_computed(kind, value, types):
            return

        def hole(item: object, wanted: FieldType, path: tuple[str | int, ...]) -> bool:
            if isinstance(item, Computed):
                given = types[id(item)]
                if not fits(given, wanted):
                    verb = "is"
                    if isinstance(given, Either):
                        given = next(kind for kind in given.kinds if not fits(kind, wanted))
                        verb = "may be"
                    said = f"{item.expression.text.strip()} {verb} {named(given)}"
                    text = f"{named(wanted)} is needed, and {said}"
                    self.source.report("BT204", span_of(item.node), text)
                elif texts := misfits(given, wanted):
                    for text in texts:
                        text = f"{item.expression.text.strip()}{text}"
                        self.source.report("BT204", span_of(item.node), text)
                elif (constant := constant_of(item)) is not None:
                    for problem in examine(wanted, constant):
                        self.source.report("BT204", span_of(item.node), problem.text)
                return True
            if isinstance(item, Interpolated):
                if not fits(TEXT, wanted):
                    text = f"{named(wanted)} is needed, and this is a text"
                    self.source.report("BT204", span_of(item.node), text)
                return True
            may_need_more = wanted == TEXT or wanted is ANGLE or isinstance(wanted, Message)
            if may_need_more and isinstance(item, (int, float)):
                at = locate(node, path)
                if isinstance(at, Scalar) and at.value == item:  # else the item comes from a file
                    return self._needs_unit_or_quotes(at, item, wanted)
            return item is BAD

        for problem in examine(kind, value, hole):
            at = locate(node, problem.path, at_key=problem.at_key)
            code = "BT203" if problem.at_key else "BT204"
            text = problem.text
            if isinstance(at, Scalar) and names_file(at.text):
                text = f"{at.text}: {problem}"
            meant = None if problem.at_key else marked_here(at, self.source, known)
            self.source.report(code, span_of(at), text, hint=_trap(at) or meant)

    def _needs_unit_or_quotes(self, at: Scalar, number: float, wanted: FieldType) -> bool:
        """Warn of a number that is likely to need a unit; report one in the place of a text."""
        if wanted == TEXT:
            self.source.report(
                "BT204", span_of(at), f"a text is needed, not {at.text}",
                hint=f'put it in quotes: "{at.text}"',
            )  # fmt: skip
            return True
        if wanted is ANGLE:
            warn_bare_angle(at, number, self.source)
        elif isinstance(wanted, Message) and interface_name(wanted.cls) == DURATION:
            warn_bare_duration(at, number, self.source)
        return False

    def finite(self, value: object, node: Node) -> None:
        """Check that no number of an input's value is infinite."""
        try:
            refuse_infinite(value)
        except ValueError as error:
            self.source.report("BT110", span_of(node), str(error))

    def condition(self, value: object, roots: Types) -> None:
        """Check an expression that must be true or false."""
        if not isinstance(value, Computed):
            return
        kind = self.expression(value, roots)
        if kind is not None and kind != BOOL:
            text = f"a condition is true or false, and this is {named(kind)}"
            self.source.report("BT206", span_of(value.node), text)

    def number(
        self, value: Computed, wanted: FieldType, least: float, *, zero: bool = True
    ) -> None:
        """Check an expression that must be a number, of at least `least`."""
        given = self.expression(value, {})
        number = constant_of(value)
        if not fits(given, wanted):
            text = f"{named(wanted)} is needed, and this is {named(given)}"
            self.source.report("BT204", span_of(value.node), text)
        elif isinstance(number, (int, float)) and not least <= number < float("inf"):
            text = f"at least {least:g} is needed, not {number}"
            self.source.report("BT110", span_of(value.node), text)
        elif number == 0 and not zero:
            self.source.report("BT110", span_of(value.node), "more than zero is needed, not 0")

    def expression(self, computed: Computed, roots: Types) -> FieldType | None:
        """Check what an expression reads and computes; return its type, or None."""
        expression = computed.expression
        if expression.variables:
            self.reads[id(self.reader)].append(computed)
            for name in expression.variables:
                if name not in self.variables:
                    self._unknown(computed)
                    break

        elif not expression.form.roots and not expression.form.constants:
            try:
                computed.evaluate(lambda _name: None)
            except ExpressionError as error:
                span = computed.span(self.source, error.column, error.end_column)
                self.source.report("BT206", span, error.message)
                return None
            if not self.types and not roots:
                return None
        kind, wrong = self.infer(expression, roots, self.reader)
        for code, message, start, end in wrong:
            self.source.report(code, computed.span(self.source, start, end), message)
        return kind

    def infer(
        self, expression: Expression, roots: Types, reader: object
    ) -> tuple[FieldType | None, list[Wrong]]:
        variable = self._types_at(reader) if self._items else self.variables.get
        kinds = map(variable, expression.variables)
        noted = _noted(expression.form, self.types, *roots.values(), *kinds)
        if not noted:
            kind, wrong = infer(expression, roots, variable, types=self.types)
            if wrong:
                return kind, wrong
            noted.append((kind, wrong))
        return noted[0]

    def _unknown(self, computed: Computed) -> None:
        """Report the variables that an expression reads and nothing declares or writes."""
        for name, span in computed.expression.variable_spans:
            if name not in self.variables and not self.doubts.declares(name):
                self._report_unknown(name, computed, computed.span(self.source, *span))

    def _report_unknown(self, name: str, computed: Computed, span: Span) -> None:
        if self.document.root is None:
            return  # a library's words are read with the names of whoever imports it
        if name in computed.expression.roots:
            bare = f"write '{name}' without a dollar sign"
            self.source.report("BT202", span, f"there is no variable ${name}", hint=bare)
            return
        maybe = self.doubts.declared
        meant = closest(name, self.variables) or closest(name, maybe)
        near = f"; did you mean '${meant}'?" if meant else ""
        hint = None
        if meant:
            self.source.unread.meant.add(meant)
        else:
            self.source.unread.variables = True
            known = listing(f"${known}" for known in self.variables)
            nothing = None if maybe else "this tree has no inputs and saves nothing"
            hint = f"this tree has {known}" if known else nothing
            expression = computed.expression
            if name in expression.asked or expression.reads_field_of(name):
                declared = f"topics: {{{name}: {{topic: {name}, type: package/msg/Name}}}}"
                has = f"{hint}; " if known else ""
                hint = f"{has}the messages of a topic are declared: {declared}"
        self.source.report("BT202", span, f"there is no variable ${name}{near}", hint=hint)


def _trap(node: Node) -> str | None:
    """Say what YAML may have made of the text."""
    if isinstance(node, Scalar) and node.text in ("on", "off", "yes", "no"):
        return "YAML 1.2 reads this as a text: write true or false"
    return notation_here(node.text) if isinstance(node, Scalar) else None
