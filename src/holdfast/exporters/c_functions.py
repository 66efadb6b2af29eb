"""Translation of compiled functions to C: one C function for each use of a Python function.

The numbers that are known, and the lengths of arrays, are part of a use. So a branch that a model
never takes is not in its header.
"""

import ast
import inspect
import re
import textwrap
from collections import Counter
from collections.abc import Iterator, Sequence
from functools import cache
from types import FunctionType
from typing import NamedTuple

from holdfast.exporters.c_expressions import Expressions, is_any_order
from holdfast.exporters.c_values import (
    BOOL,
    C_TYPES,
    EXACT_TIME,
    INTEGER,
    REAL,
    CArray,
    CNumber,
    CRecord,
    CTuple,
    CValue,
    element_of,
    known,
    widest,
)

RESERVED = frozenset(
    """auto bool break case char class const continue default delete do double else enum extern
    false float for goto if inline int long new not operator or and private public register
    restrict return short signed sizeof static struct switch template this true typedef union
    unsigned using virtual void volatile while xor d fabs sqrt log exp expm1 tanh
    copysign""".split()  # noqa: SIM905
)
"""Names that a variable of the header must not have."""


MAX_UNROLLED = 64
"""Iterations up to which a loop is written out, if something of it is known then."""
MAX_SMALL_LOOP = 8
"""Iterations up to which a loop without branches is written out."""


class CFunction(NamedTuple):
    """C function: its name, whether it receives the detector, and what it returns."""

    name: str
    has_detector: bool
    result: CNumber | CTuple | None


class Program:
    """All functions of a header, in the order in which they must be defined.

    Args:
        single: numbers are of single precision.
        time_fields: arrays that hold times, and so keep double precision.

    Attributes:
        definitions: source text of each function.
        tuples: kinds of the members of each struct that a function returns.
        new_time_fields: arrays that times were stored to, and that are not in `time_fields`.
    """

    def __init__(self, *, single: bool = False, time_fields: frozenset[str] = frozenset()) -> None:
        self.single, self.time_fields = single, time_fields
        self.definitions: list[str] = []
        self.tuples: set[str] = set()
        self.new_time_fields: set[str] = set()
        self._functions: dict[object, CFunction] = {}
        self._n_uses: Counter[str] = Counter()

    def call(self, function: FunctionType, values: Sequence[CValue]) -> CNumber | CTuple | None:
        """Return the result of a call of a Python function, which is translated if need be."""
        used = self.use(function, values)
        parts = ["d"] if used.has_detector else []
        for value in values:
            parts += _argument(value)
        text = f"{used.name}({', '.join(parts)})"
        return used.result if used.result is None else _with_text(used.result, text)

    def call_text(self, function: FunctionType, values: Sequence[CValue]) -> str:
        """Return the text of a call of a function that returns nothing."""
        used = self.use(function, values)
        arguments = [part for value in values for part in _argument(value)]
        return f"{used.name}({', '.join(['d'] * used.has_detector + arguments)})"

    def use(self, function: FunctionType, values: Sequence[CValue]) -> CFunction:
        """Return the C function of a Python function, for such values."""
        key = (function, tuple(value.key for value in values if not isinstance(value, CTuple)))
        if key not in self._functions:
            short = function.__name__.strip("_")
            self._n_uses[short] += 1
            name = f"hf_{short}" + (f"_{n}" if (n := self._n_uses[short]) > 1 else "")
            translation = Statements(self, function, values)
            text = translation.definition(name)
            self.definitions.append(text)
            self._functions[key] = CFunction(name, _needs_detector(values), translation.result)
        return self._functions[key]

    def note_store(self, field: str, kind: str) -> None:
        """Note that a number was stored to an array."""
        if self.single and kind == EXACT_TIME and field not in self.time_fields:
            self.new_time_fields.add(field)


def _needs_detector(values: Sequence[CValue]) -> bool:
    return any(isinstance(x, CArray | CRecord) and x.needs_detector for x in values)


def _argument(value: CValue) -> Iterator[str]:
    """Yield the C arguments of a value: nothing for what the function knows."""
    if isinstance(value, CNumber) and value.known is None:
        yield value.text
    elif isinstance(value, CArray) and not value.is_whole:
        yield value.text
        yield from (length.text for length in value.shape if length.known is None)


def _with_text(result: CNumber | CTuple, text: str) -> CNumber | CTuple:
    if isinstance(result, CNumber):
        return CNumber(result.kind, text)
    return CTuple(result.members, text)


@cache
def function_tree(function: FunctionType) -> tuple[ast.FunctionDef, int]:
    """Return the syntax tree of a function, and the number of its first line."""
    lines, first = inspect.getsourcelines(function)
    (tree,) = ast.parse(textwrap.dedent("".join(lines))).body
    if not isinstance(tree, ast.FunctionDef):
        raise NotImplementedError(f"{function.__name__} is no function")
    return tree, first


class Statements:
    """Statements of one function.

    Args:
        program: that the function belongs to.
        function: the function, in Python.
        values: of its parameters.

    Attributes:
        result: what the function returns.
    """

    def __init__(self, program: Program, function: FunctionType, values: Sequence[CValue]) -> None:
        self.program, self.values = program, values
        self.tree, first = function_tree(function)
        self.expressions = Expressions(program, function, first)
        self.result: CNumber | CTuple | None = None
        self._kinds: dict[str, str] = {}  # of the variables
        self._parameter_kinds: dict[str, str] = {}  # of the numbers that C receives
        self._n_stores = Counter(
            node.id
            for node in ast.walk(self.tree)
            if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)
        )
        self._n_stores.update(argument.arg for argument in self.tree.args.args)
        self._lines: list[str] = []
        self._depth = 1
        self._n_helpers = 0

    def definition(self, name: str) -> str:
        """Return the source text of the C function."""
        while True:  # until the kinds of the variables are wide enough
            before = (dict(self._kinds), self.result)
            self.expressions.names, self._lines, self._n_helpers = {}, [], 0
            parameters = self._parameters()
            self._block(self.tree.body)
            if (self._kinds, self.result) == before:
                break
        variables = [
            f"    {C_TYPES[kind]} {_c_name(variable)} = {'false' if kind == BOOL else 0};"
            for variable, kind in self._kinds.items()
        ]
        body = _without_unread("\n".join(self._lines))
        unused = [
            f"    (void){word};"
            for word in [*(p.rpartition(" ")[2].lstrip("*") for p in parameters),
                         *map(_c_name, self._kinds)]
            if not _is_read(word, body)
        ]  # fmt: skip
        any_order = is_any_order(self.expressions.function)
        return "\n".join(
            [
                f"/* {self._summary()} */",
                *["HF_ANY_ORDER"] * any_order,
                f"static inline {self._c_result()} {name}({', '.join(parameters) or 'void'})",
                "{", *["    HF_ANY_ORDER_INSIDE"] * any_order, *variables, *unused, body, "}",
            ]
        )  # fmt: skip

    def _summary(self) -> str:
        """Return the first line of the docstring, and where the function is defined."""
        text = (ast.get_docstring(self.tree) or "").split("\n")[0].replace("*/", "")
        module = self.expressions.function.__module__
        return f"{text} {module}.{self.tree.name}".strip()

    def _c_result(self) -> str:
        if self.result is None:
            return "void"
        if isinstance(self.result, CNumber):
            return C_TYPES[self.result.kind]
        self.program.tuples.add(self.result.kinds)
        return f"hf_tuple_{self.result.kinds}"

    def _parameters(self) -> list[str]:
        """Return the C parameters, and set the values of the Python parameters."""
        words = []
        if _needs_detector(self.values):
            words.append("holdfast_detector *d")
        for argument, value in zip(self.tree.args.args, self.values, strict=True):
            name = argument.arg
            self.expressions.names[name] = self._received(name, value)
            if isinstance(value, CNumber) and value.known is None:
                words.append(f"{C_TYPES[value.kind]} {_c_name(name)}")
                self._parameter_kinds[name] = value.kind
            elif isinstance(value, CNumber) and self._n_stores[name] > 1:
                self._assign_name(name, value)
            elif isinstance(value, CArray) and not value.is_whole:
                words.append(f"{value.c_type}{_c_name(name)}")
                words += [
                    f"int64_t {_c_name(name)}_length_{axis}"
                    for axis, length in enumerate(value.shape)
                    if length.known is None
                ]
        return words

    def _received(self, name: str, value: CValue) -> CValue:
        """Return the value of a parameter within the function."""
        if isinstance(value, CNumber):
            return value if value.known is not None else CNumber(value.kind, _c_name(name))
        if isinstance(value, CArray) and not value.is_whole:
            shape = tuple(
                CNumber(INTEGER, f"{_c_name(name)}_length_{axis}") if x.known is None else x
                for axis, x in enumerate(value.shape)
            )
            return value._replace(base=_c_name(name), offsets=(), shape=shape)
        return value

    def _write(self, line: str) -> None:
        self._lines.append("    " * self._depth + line)

    def _block(self, statements: Sequence[ast.stmt]) -> bool:
        """Translate statements. Return whether those after them are never reached."""
        for statement in statements:
            translate = getattr(self, f"_{type(statement).__name__.lower()}", None)
            if translate is None:
                self.expressions.refuse(statement, type(statement).__name__)
            if translate(statement):
                return True
        return False

    def _inner(self, statements: Sequence[ast.stmt]) -> bool:
        self._depth += 1
        ends = self._block(statements)
        self._depth -= 1
        return ends

    def _pass(self, _: ast.Pass) -> bool:
        return False

    def _expr(self, node: ast.Expr) -> bool:
        if isinstance(node.value, ast.Constant):
            return False  # a docstring
        if not isinstance(node.value, ast.Call):
            self.expressions.refuse(node, "an expression without effect")
        thing = self.expressions.thing(node.value.func)
        if not hasattr(thing, "py_func"):
            self.expressions.refuse(node, "a call of this function")
        values = [self.expressions.value(argument) for argument in node.value.args]
        self._write(f"{self.program.call_text(thing.py_func, values)};")
        return False

    def _return(self, node: ast.Return) -> bool:
        if node.value is None:
            self._write("return;")
            return True
        value = self.expressions.value(node.value)
        if isinstance(value, CArray | CRecord):
            self.expressions.refuse(node, "a function that returns an array")
        self._widen_result(value)
        if isinstance(value, CNumber):
            self._write(f"return {self.expressions.text(value)};")
        elif isinstance(self.result, CTuple):
            members = [x for x in self._unpacked(value) if isinstance(x, CNumber)]
            self._return_members(members, self.result.kinds)
        return True

    def _return_members(self, members: Sequence[CNumber], kinds: str) -> None:
        helper = self._helper()
        self._write(f"hf_tuple_{kinds} {helper};")
        for place, member in enumerate(members):
            self._write(f"{helper}.v{place} = {self.expressions.text(member)};")
        self._write(f"return {helper};")

    def _widen_result(self, value: CNumber | CTuple) -> None:
        old = self.result
        if isinstance(value, CNumber):
            kinds = value.kind if old is None else widest(value.kind, old.kind)  # type: ignore[union-attr]
            self.result = CNumber(kinds, "")
            return
        kinds = value.kinds if old is None else "".join(map(widest, value.kinds, old.kinds))  # type: ignore[union-attr]
        members = tuple(CNumber(k, f"v{i}") for i, k in enumerate(kinds))
        self.result = CTuple(members)

    def _helper(self) -> str:
        self._n_helpers += 1
        return f"hf_{self._n_helpers}"

    def _unpacked(self, value: CTuple) -> tuple[CNumber | CArray, ...]:
        """Return the members of a tuple; a function that returns it is called once."""
        if not value.text:
            return value.members
        helper = value.text
        if not helper.isidentifier():
            helper = self._helper()
            self._write(f"const hf_tuple_{value.kinds} {helper} = {value.text};")
        return tuple(CNumber(m.kind, f"{helper}.v{i}") for i, m in enumerate(value.members))

    def _if(self, node: ast.If) -> bool:
        test = self.expressions.condition(node.test)
        if test.known is not None:
            return self._block(node.body if test.known else node.orelse)
        before = dict(self.expressions.names)
        self._write(f"if ({_bare(test.text)}) {{")
        ends = self._inner(node.body)
        if node.orelse:
            after, self.expressions.names = self.expressions.names, before
            self._write("} else {")
            ends = self._inner(node.orelse) and ends
            self.expressions.names = after | self.expressions.names
        self._write("}")
        self._forget_values(node)
        return ends and bool(node.orelse)

    def _forget_values(self, node: ast.stmt) -> None:
        """Note that the variables which a statement stores may have any value."""
        kinds = self._kinds | self._parameter_kinds
        for name in _stored_names(node) & kinds.keys():
            self.expressions.names[name] = CNumber(kinds[name], _c_name(name))

    def _while(self, node: ast.While) -> bool:
        if node.orelse:
            self.expressions.refuse(node, "an else of a loop")
        if self._is_written_out(node):
            return False
        self._forget_values(node)
        test = self.expressions.text(self.expressions.condition(node.test))
        self._write(f"while ({_bare(test)}) {{")
        self._inner(node.body)
        self._write("}")
        self._forget_values(node)
        return False

    def _is_written_out(self, node: ast.While) -> bool:
        """Write a loop out whose test is known at each iteration. Return whether it is."""
        state, n = self._state(), 0
        while (test := self.expressions.condition(node.test).known) and n < MAX_UNROLLED:
            self._copy_of_body(node)
            n += 1
        if test is False and not _leaves(node):
            return True
        self._set_state(state)
        return False

    def _copy_of_body(self, node: ast.While | ast.For) -> None:
        self._write("{")
        self._inner(node.body)
        self._write("}")

    def _state(self) -> tuple[dict[str, CValue], dict[str, str], list[str], int]:
        """Return what a translation of statements changes."""
        return (
            dict(self.expressions.names), dict(self._kinds), list(self._lines), self._n_helpers
        )  # fmt: skip

    def _set_state(self, state: tuple[dict[str, CValue], dict[str, str], list[str], int]) -> None:
        names, kinds, lines, self._n_helpers = state
        self.expressions.names, self._kinds, self._lines = dict(names), dict(kinds), list(lines)

    def _continue(self, _: ast.Continue) -> bool:
        self._write("continue;")
        return True

    def _break(self, _: ast.Break) -> bool:
        self._write("break;")
        return True

    def _for(self, node: ast.For) -> bool:
        if node.orelse or not isinstance(node.target, ast.Name):
            self.expressions.refuse(node, "a loop of this kind")
        is_range = isinstance(node.iter, ast.Call) and isinstance(node.iter.func, ast.Name)
        if is_range and node.iter.func.id == "range":  # type: ignore[attr-defined]
            numbers = [self.expressions.number(x) for x in node.iter.args]  # type: ignore[attr-defined]
            begin, end, step = (known(0), *numbers, known(1)) if len(numbers) == 1 else (
                *numbers, known(1)
            )[:3]  # fmt: skip
            self._loop(node, _c_name(node.target.id), begin, end, step)
        else:
            self._loop_over(node, self.expressions.array(node.iter))
        return False

    def _loop(self, node: ast.For, name: str, begin: CNumber, end: CNumber, step: CNumber) -> None:
        """Translate a loop over a range."""
        if step.known is None or step.known <= 0:
            self.expressions.refuse(node, "a step that is not known to be above 0")
        if begin.known is not None and end.known is not None and begin.known >= end.known:
            return
        if self._is_unrolled(node, begin, end, step):
            return
        self._forget_values(node)
        last = f"{name}_end" if end.known is None else self.expressions.text(end)
        set_last = f", {last} = {end.text}" if end.known is None else ""
        more = f"++{name}" if step.known == 1 else f"{name} += {step.known}"
        start = f"int64_t {name} = {self.expressions.text(begin)}{set_last}"
        self._write(f"for ({start}; {name} < {last}; {more}) {{")
        self.expressions.names[node.target.id] = CNumber(INTEGER, name)  # type: ignore[attr-defined]
        self._inner(node.body)
        self._write("}")
        self._forget_values(node)

    def _is_unrolled(self, node: ast.For, begin: CNumber, end: CNumber, step: CNumber) -> bool:
        """Write a loop out if it is small, or if branches of it are known then."""
        if begin.known is None or end.known is None or step.known is None or _leaves(node):
            return False
        places = range(int(begin.known), int(end.known), int(step.known))
        if len(places) > MAX_UNROLLED:
            return False
        state, name = self._state(), node.target.id  # type: ignore[attr-defined]
        self._forget_values(node)
        n_branches = self._n_branches(node, CNumber(INTEGER, _c_name(name)))
        is_small = n_branches == 0 and len(places) <= MAX_SMALL_LOOP
        if not is_small and self._n_branches(node, known(places[0])) == n_branches:
            self._set_state(state)
            return False
        self._set_state(state)
        for place in places:
            self.expressions.names[name] = known(place)
            self._copy_of_body(node)
        return True

    def _n_branches(self, node: ast.For, place: CNumber) -> int:
        """Return the number of branches of the body of a loop, at one place."""
        self._lines, self.expressions.names[node.target.id] = [], place  # type: ignore[attr-defined]
        self._inner(node.body)
        return sum(line.lstrip().startswith(("if (", "for (", "while (")) for line in self._lines)

    def _loop_over(self, node: ast.For, array: CArray) -> None:
        """Translate a loop over the elements of an array."""
        place, name = self._helper(), node.target.id  # type: ignore[attr-defined]
        if len(array.shape) != 1:
            self.expressions.refuse(node, "a loop over rows")
        end = self.expressions.text(array.shape[0])
        self._write(f"for (int64_t {place} = 0; {place} < {end}; ++{place}) {{")
        stride = f"{array.strides[0]} * " if array.strides[0] > 1 else ""
        element = array._replace(shape=(), offsets=(*array.offsets, f"{stride}{place}"))
        self._forget_values(node)
        self._depth += 1
        self._write(f"const {C_TYPES[array.kind]} {_c_name(name)} = {element_of(element).text};")
        self._depth -= 1
        self.expressions.names[name] = CNumber(array.kind, _c_name(name))
        self._inner(node.body)
        self._write("}")
        self._forget_values(node)

    def _augassign(self, node: ast.AugAssign) -> bool:
        target = node.target
        old = self.expressions.number(target)
        new = self.expressions.combine(node, old, node.op, self.expressions.number(node.value))
        self._assign(target, new)
        return False

    def _annassign(self, node: ast.AnnAssign) -> bool:
        if node.value is None:
            return False
        return self._assign(node.target, self.expressions.number(node.value))

    def _assign_statement(self, node: ast.Assign) -> None:
        first, *others = node.targets
        value = self.expressions.value(node.value)
        if isinstance(value, CArray) and not value.shape:
            value = element_of(value)
        if isinstance(first, ast.Tuple) and isinstance(value, CTuple) and not others:
            self._assign_members(first, value)
            return
        if others and isinstance(value, CNumber) and value.known is None:
            helper = self._helper()
            self._write(f"const {C_TYPES[value.kind]} {helper} = {value.text};")
            value = CNumber(value.kind, helper)
        for target in node.targets:
            self._assign(target, value)

    def _assign(self, target: ast.expr | ast.Assign, value: CValue | None = None) -> bool:
        """Translate an assignment: of a statement, or of a value to a target."""
        if isinstance(target, ast.Assign):
            self._assign_statement(target)
        elif isinstance(target, ast.Name) and value is not None:
            self._assign_name(target.id, value, target)
        elif isinstance(target, ast.Subscript) and isinstance(value, CNumber):
            self._assign_element(target, value)
        else:
            self.expressions.refuse(target, "this assignment")
        return False

    def _assign_members(self, target: ast.Tuple, value: CTuple) -> None:
        """Assign the members of a tuple: all values are computed before the first is stored."""
        members = list(self._unpacked(value))
        if not value.text:
            stored = {n.id for n in ast.walk(target) if isinstance(n, ast.Name)} - {"_"}
            for place, member in enumerate(members[1:], 1):
                if not isinstance(member, CNumber) or member.known is not None:
                    continue
                if any(_is_read(_c_name(x), member.text) for x in stored):
                    helper = self._helper()
                    self._write(f"const {C_TYPES[member.kind]} {helper} = {member.text};")
                    members[place] = CNumber(member.kind, helper)
        for part, member in zip(target.elts, members, strict=True):
            self._assign(part, member)

    def _assign_element(self, target: ast.Subscript, value: CNumber) -> None:
        place = self.expressions.place(target)
        self.program.note_store(place.field, value.kind)
        if not place.shape:
            self._write(f"{element_of(place).text} = {self.expressions.text(value)};")
            return
        n = 1
        for length in place.shape:
            if length.known is None:
                self.expressions.refuse(target, "a part of unknown length")
            n *= int(length.known)
        if n and place.strides[-1] != 1:
            self.expressions.refuse(target, "a part with gaps in memory")
        if n:
            text = self.expressions.text(value)
            self._write(f"hf_fill_{place.kind}({place.text}, {n}, {text});")

    def _assign_name(self, name: str, value: CValue, target: ast.AST | None = None) -> None:
        if name == "_":
            return
        names, is_only = self.expressions.names, self._n_stores[name] == 1
        if isinstance(value, CNumber):
            if value.known is not None and is_only:
                names[name] = value
                return
            self._store_variable(name, value)
        elif not is_only or target is None:
            self.expressions.refuse(target or self.tree, "an array that is assigned twice")
        elif isinstance(value, CArray):
            names[name] = self._named_part(name, value)
        elif isinstance(value, CTuple):
            names[name] = self._named_tuple(name, value)

    def _store_variable(self, name: str, value: CNumber) -> None:
        kind = self._parameter_kinds.get(name)
        if kind is None:
            kind = self._kinds[name] = widest(value.kind, self._kinds.get(name, BOOL))
        if widest(kind, value.kind) != kind:
            self.expressions.refuse(self.tree, f"a parameter ({name}) that changes its type")
        self._write(f"{_c_name(name)} = {self.expressions.text(value)};")
        is_same = value.known is not None and kind == value.kind
        self.expressions.names[name] = value if is_same else CNumber(kind, _c_name(name))

    def _named_part(self, name: str, value: CArray) -> CArray:
        """Return a part of an array under a name; a whole array keeps its own."""
        if not value.offsets:
            return value
        self._write(f"{value.c_type}const {_c_name(name)} = {value.text};")
        return value._replace(base=_c_name(name), offsets=())

    def _named_tuple(self, name: str, value: CTuple) -> CTuple | CArray:
        """Return a tuple under a name: a struct that was returned, or an array of numbers."""
        if value.text:
            self._write(f"const hf_tuple_{value.kinds} {_c_name(name)} = {value.text};")
            return CTuple(value.members, _c_name(name))
        kind = widest(REAL, *value.kinds)
        numbers = [member for member in value.members if isinstance(member, CNumber)]
        text = ", ".join(map(self.expressions.text, numbers))
        n = len(value.members)
        self._write(f"const {C_TYPES[kind]} {_c_name(name)}[{n}] = {{{text}}};")
        return CArray(kind, _c_name(name), (known(n),), (1,), _c_name(name))


def _stored_names(node: ast.AST) -> set[str]:
    """Return the names of the variables that a statement stores."""
    return {
        part.id
        for part in ast.walk(node)
        if isinstance(part, ast.Name) and isinstance(part.ctx, ast.Store)
    }


def _leaves(loop: ast.For | ast.While) -> bool:
    """Return whether the body of a loop leaves an iteration, of itself or of a loop inside."""
    return any(isinstance(part, ast.Break | ast.Continue) for part in ast.walk(loop))


def _c_name(name: str) -> str:
    return f"{name}_" if name in RESERVED else name


def _bare(text: str) -> str:
    """Return an expression without the brackets around all of it."""
    if not text.startswith("("):
        return text
    depth = 0
    for place, character in enumerate(text):
        depth += {"(": 1, ")": -1}.get(character, 0)
        if depth == 0:
            return text[1:-1] if place == len(text) - 1 else text
    return text


def _without_unread(body: str) -> str:
    """Return the lines of a function without pointers that nothing reads."""
    for name in re.findall(r"\*const (\w+) = ", body)[::-1]:
        if not _is_read(name, body):
            body = re.sub(rf".*\*const {name} = .*\n?", "", body)
    return body


def _is_read(word: str, text: str) -> bool:
    """Return whether a name occurs in a text other than as the target of an assignment."""
    pattern = rf"(?<![\w.>]){re.escape(word)}(?![\w])(?!\s=\s)"
    return re.search(pattern, text) is not None
