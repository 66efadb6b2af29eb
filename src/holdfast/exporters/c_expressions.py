"""Translation of expressions of compiled functions to C.

Only what the kernel uses is supported; anything else is an error that names file and line. A
result that is known is computed here, by Python's rules, which are those of the kernel.
"""

import ast
import builtins
import math
import operator
from collections.abc import Callable, Sequence
from types import FunctionType
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np

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
    part_of,
    text_of,
    widest,
)

if TYPE_CHECKING:
    from holdfast.exporters.c_functions import Program

SYMBOLS: dict[type[ast.AST], tuple[str, Callable[[Any, Any], Any]]] = {
    ast.Add: ("+", operator.add),
    ast.Sub: ("-", operator.sub),
    ast.Mult: ("*", operator.mul),
    ast.Div: ("/", operator.truediv),
    ast.FloorDiv: ("hf_quotient", operator.floordiv),
    ast.Mod: ("hf_remainder", operator.mod),
    ast.Pow: ("**", operator.pow),
    ast.BitAnd: ("&", operator.and_),
    ast.BitOr: ("|", operator.or_),
    ast.LShift: ("<<", operator.lshift),
    ast.RShift: (">>", operator.rshift),
    ast.Lt: ("<", operator.lt),
    ast.LtE: ("<=", operator.le),
    ast.Gt: (">", operator.gt),
    ast.GtE: (">=", operator.ge),
    ast.Eq: ("==", operator.eq),
    ast.NotEq: ("!=", operator.ne),
}
"""Operators: of C, and of Python."""
MATHS = {math.sqrt: "sqrt", math.log: "log", math.exp: "exp", math.expm1: "expm1",
         math.tanh: "tanh", math.copysign: "copysign", np.nextafter: "nextafter"}  # fmt: skip
"""Functions of C's math library. Only the square root of what is known is computed here: it is
the one whose last bit no library chooses."""
TESTS = {math.isnan: "isnan", math.isinf: "isinf", math.isfinite: "isfinite"}
CASTS = {int: INTEGER, float: REAL, bool: BOOL, np.int64: INTEGER, np.uint64: INTEGER}


def is_any_order(function: FunctionType) -> bool:
    """Return whether a function is marked by `holdfast.compiled.sums_in_any_order`."""
    return getattr(function, "sums_in_any_order", False)


class Expressions:
    """Expressions of one function.

    Args:
        program: that the function belongs to.
        function: the function, in Python.
        first_line: number of its first line in its file.

    Attributes:
        names: values of the parameters and variables.
    """

    def __init__(self, program: "Program", function: FunctionType, first_line: int) -> None:
        self.program, self.function, self.first_line = program, function, first_line
        self.names: dict[str, CValue] = {}

    def refuse(self, node: ast.AST, reason: str) -> NoReturn:
        """Raise the error of a construct that has no translation."""
        line = self.first_line + getattr(node, "lineno", 1) - 1
        raise NotImplementedError(
            f"{self.function.__code__.co_filename}:{line}: {reason} has no translation to C: "
            f"{ast.unparse(node)}"
        )

    def text(self, value: CNumber) -> str:
        """Return the C expression of a number."""
        return text_of(value, single=self.program.single)

    def number(self, node: ast.expr) -> CNumber:
        """Return the value of an expression that is a number."""
        value = self.value(node)
        if isinstance(value, CArray) and not value.shape:
            return element_of(value)
        if not isinstance(value, CNumber):
            self.refuse(node, "a value that is no number, where a number is expected,")
        return value

    def condition(self, node: ast.expr) -> CNumber:
        """Return whether an expression is true."""
        value = self.number(node)
        if value.known is not None:
            return known(bool(value.known))
        return value if value.kind == BOOL else CNumber(BOOL, f"({self.text(value)} != 0)")

    def value(self, node: ast.expr) -> CValue:
        """Return the value of an expression."""
        translate = getattr(self, f"_{type(node).__name__.lower()}", None)
        if translate is None:
            self.refuse(node, type(node).__name__)
        value: CValue = translate(node)
        return value

    def thing(self, node: ast.expr) -> Any:  # noqa: ANN401 (whatever a name of a module means)
        """Return the Python object that a name outside of the function means."""
        if isinstance(node, ast.Attribute):
            return getattr(self.thing(node.value), node.attr)
        if not isinstance(node, ast.Name) or node.id in self.names:
            self.refuse(node, "this")
        scope = self.function.__globals__
        return scope[node.id] if node.id in scope else getattr(builtins, node.id)

    def _constant(self, node: ast.Constant) -> CNumber:
        if not isinstance(node.value, bool | int | float):
            self.refuse(node, "this constant")
        return known(node.value)

    def _name(self, node: ast.Name) -> CValue:
        if node.id in self.names:
            return self.names[node.id]
        return self._outside(node)

    def _outside(self, node: ast.expr) -> CNumber:
        thing = self.thing(node)
        if not isinstance(thing, bool | int | float):
            self.refuse(node, f"a name that means {type(thing).__name__}")
        return known(thing if isinstance(thing, bool) else thing + 0)  # an IntEnum is an int

    def _attribute(self, node: ast.Attribute) -> CValue:
        if isinstance(node.value, ast.Name) and node.value.id in self.names:
            record = self.names[node.value.id]
            if isinstance(record, CRecord) and node.attr in record.fields:
                return record.fields[node.attr]
            self.refuse(node, "this attribute")
        return self._outside(node)

    def _tuple(self, node: ast.Tuple) -> CTuple:
        members = [self.value(member) for member in node.elts]
        if not all(isinstance(member, CNumber | CArray) for member in members):
            self.refuse(node, "a tuple of anything but numbers and arrays")
        return CTuple(tuple(_settled(x) for x in members if isinstance(x, CNumber | CArray)))

    def _subscript(self, node: ast.Subscript) -> CValue:
        if isinstance(node.value, ast.Attribute) and node.value.attr == "shape":
            return self.array(node.value.value).shape[int(self._known(node.slice))]
        value = self.value(node.value)
        if isinstance(value, CTuple):
            place = int(self._known(node.slice))
            member = value.members[place]
            return member._replace(text=f"{value.text}.v{place}") if value.text else member  # type: ignore[call-arg]
        part = self._part(node)
        return part if part.shape else element_of(part)

    def array(self, node: ast.expr) -> CArray:
        """Return the value of an expression that is an array."""
        value = self.value(node)
        if not isinstance(value, CArray):
            self.refuse(node, "a value that is no array, where an array is expected,")
        return value

    def _part(self, node: ast.Subscript) -> CArray:
        nodes = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
        indices = [self._slice(x) if isinstance(x, ast.Slice) else self.number(x) for x in nodes]
        array = self.array(node.value)
        if len(indices) > len(array.shape):
            self.refuse(node, "an index too many")
        return part_of(array, indices, single=self.program.single)

    def place(self, node: ast.Subscript) -> CArray:
        """Return the element or part of an array that is assigned to."""
        return self._part(node)

    def _slice(self, node: ast.Slice) -> slice:
        if node.lower is not None or node.step is not None:
            self.refuse(node, "a slice with a begin or a step")
        return slice(None if node.upper is None else self.number(node.upper))

    def _known(self, node: ast.expr) -> int | float:
        value = self.number(node).known
        if value is None:
            self.refuse(node, "an index that is not known before the program runs")
        return value

    def _unaryop(self, node: ast.UnaryOp) -> CNumber:
        if isinstance(node.op, ast.Not):
            value = self.condition(node.operand)
            is_known = value.known is not None
            return known(not value.known) if is_known else CNumber(BOOL, f"!{value.text}")
        value = self.number(node.operand)
        is_bits = isinstance(node.op, ast.Invert) and value.kind == INTEGER
        if not (is_bits or isinstance(node.op, ast.USub)):
            self.refuse(node, "this operator")
        if value.known is not None:
            return known(~int(value.known) if is_bits else -value.known)
        return CNumber(value.kind, f"({'~' if is_bits else '-'}{value.text})")

    def _binop(self, node: ast.BinOp) -> CNumber:
        return self.combine(node, self.number(node.left), node.op, self.number(node.right))

    def combine(self, node: ast.AST, left: CNumber, op: ast.operator, right: CNumber) -> CNumber:
        """Return the result of an operator on two numbers."""
        if type(op) not in SYMBOLS:
            self.refuse(node, "this operator")
        symbol, compute = SYMBOLS[type(op)]
        if left.known is not None and right.known is not None:
            return known(_computed(compute, left.known, right.known))
        one, two, kind = self.text(left), self.text(right), widest(left.kind, right.kind)
        if symbol == "**":
            if right.known != 2:
                self.refuse(node, "a power other than 2")
            return CNumber(kind, f"hf_square_{left.kind}({one})")
        if symbol.startswith("hf_"):
            if kind not in (BOOL, INTEGER):
                self.refuse(node, "this operator on real numbers")
            return CNumber(INTEGER, f"{symbol}({one}, {two})")
        if symbol in ("|", "&") and kind != BOOL:
            kind = INTEGER
        if symbol == "/" and kind in (BOOL, INTEGER):
            return CNumber(REAL, f"((holdfast_real){one} / (holdfast_real){two})")
        if symbol == "<<":
            one = f"(int64_t){one}"
        return self._timed(symbol, left, right, widest(kind, INTEGER), one, two)

    def _timed(
        self, symbol: str, left: CNumber, right: CNumber, kind: str, one: str, two: str
    ) -> CNumber:
        """Return a result, as a time if it is one: a difference of times or a ratio is none."""
        text = f"({one} {symbol} {two})"
        if kind == EXACT_TIME:
            both = left.kind == right.kind
            scaled = symbol == "*" and left.known is None and right.known is None
            if symbol == "/" or scaled or (symbol == "-" and both):
                return CNumber(REAL, f"(holdfast_real){text}")
        return CNumber(kind, text)

    def _compare(self, node: ast.Compare) -> CNumber:
        values = [node.left, *node.comparators]
        if isinstance(node.ops[0], ast.In) and isinstance(values[1], ast.Tuple):
            left = self.number(values[0])
            tests = [self.compared(left, ast.Eq(), self.number(x)) for x in values[1].elts]
            return self._joined(tests, "||", any)
        if not all(type(op) in SYMBOLS for op in node.ops):
            self.refuse(node, "this comparison")
        numbers = [self.number(value) for value in values]
        tests = [
            self.compared(*parts) for parts in zip(numbers, node.ops, numbers[1:], strict=False)
        ]
        return self._joined(tests, "&&", all)

    def compared(self, left: CNumber, op: ast.cmpop, right: CNumber) -> CNumber:
        """Return whether a comparison of two numbers is true."""
        symbol, compute = SYMBOLS[type(op)]
        if left.known is not None and right.known is not None:
            return known(bool(compute(left.known, right.known)))
        return CNumber(BOOL, f"({self.text(left)} {symbol} {self.text(right)})")

    def _boolop(self, node: ast.BoolOp) -> CNumber:
        is_and = isinstance(node.op, ast.And)
        tests = []
        for value in node.values:
            tests.append(self.condition(value))
            if tests[-1].known is (not is_and):
                break  # the rest is never looked at
        return self._joined(tests, "&&" if is_and else "||", all if is_and else any)

    def _joined(
        self, tests: Sequence[CNumber], symbol: str, join: Callable[[Any], bool]
    ) -> CNumber:
        """Return whether all tests, or any of them, are true."""
        decisive = join is any
        open_tests = [test for test in tests if test.known is None]
        if any(test.known is decisive for test in tests):
            if not any("hf_" in test.text for test in open_tests):
                return known(decisive)
            open_tests.append(CNumber(BOOL, self.text(known(decisive))))  # calls may have effects
        if len(open_tests) < 2:
            return open_tests[0] if open_tests else known(not decisive)
        return CNumber(BOOL, f"({f' {symbol} '.join(test.text for test in open_tests)})")

    def _ifexp(self, node: ast.IfExp) -> CValue:
        test = self.condition(node.test)
        if test.known is not None:
            return self.value(node.body if test.known else node.orelse)
        yes, no = self.value(node.body), self.value(node.orelse)
        if isinstance(yes, CTuple) and isinstance(no, CTuple):
            pairs = zip(node.body.elts, node.orelse.elts, strict=True)  # type: ignore[attr-defined]
            return CTuple(tuple(self._chosen(test, *map(self.number, pair)) for pair in pairs))
        return self._chosen(test, self.number(node.body), self.number(node.orelse))

    def _chosen(self, test: CNumber, yes: CNumber, no: CNumber) -> CNumber:
        kind = widest(yes.kind, no.kind)
        return CNumber(kind, f"({test.text} ? {self.text(yes)} : {self.text(no)})")

    def _call(self, node: ast.Call) -> CValue:
        if node.keywords:
            self.refuse(node, "a call with named arguments")
        thing = self.thing(node.func)
        if hasattr(thing, "py_func"):
            result = self.program.call(thing.py_func, [self.value(x) for x in node.args])
            if result is None:
                self.refuse(node, "a call without result in an expression")
            return result
        if thing is len:
            return self.array(node.args[0]).shape[0]
        if thing in TESTS and is_any_order(self.function):
            self.refuse(node, "a test for NaN or infinity in sums_in_any_order")
        result = self._known_function(thing, [self.number(x) for x in node.args])
        if result is None:
            self.refuse(node, "a call of this function")
        return result

    def _known_function(self, thing: Any, numbers: Sequence[CNumber]) -> CNumber | None:  # noqa: ANN401
        """Return the result of a function of Python, math or NumPy; None if it is not known."""
        first = numbers[0]
        if thing in MATHS:
            result = self._math(thing, numbers)
        elif thing in (min, max):
            result = self._extreme("min" if thing is min else "max", numbers)
        elif thing in CASTS:
            result = self._cast(CASTS[thing], first)
        elif thing is abs:
            result = self._magnitude(first)
        elif thing in TESTS:
            test = CNumber(BOOL, f"({TESTS[thing]}({first.text}) != 0)")
            result = test if first.known is None else known(thing(first.known))
        elif thing is round and first.known is not None:
            result = known(round(first.known))
        else:
            return None
        return result

    def _math(self, function: Callable[..., float], numbers: Sequence[CNumber]) -> CNumber:
        first = numbers[0].known
        if function is math.sqrt and first is not None:
            return known(math.sqrt(first))
        arguments = ", ".join(self.text(number) for number in numbers)
        name = f"HF_MATH({MATHS[function]})"
        return CNumber(REAL, f"{name}({arguments})")

    def _magnitude(self, value: CNumber) -> CNumber:
        if value.known is not None:
            return known(abs(value.known))
        name = {INTEGER: "hf_magnitude", EXACT_TIME: "fabs"}.get(value.kind, "HF_MATH(fabs)")
        return CNumber(value.kind, f"{name}({value.text})")

    def _cast(self, kind: str, value: CNumber) -> CNumber:
        if value.known is not None:
            return known({INTEGER: int, REAL: float, BOOL: bool}[kind](value.known))
        if value.kind == kind or (kind, value.kind) == (REAL, EXACT_TIME):
            return value
        if kind == BOOL:
            return CNumber(BOOL, f"({value.text} != 0)")
        return CNumber(kind, f"(({C_TYPES[kind]}){value.text})")

    def _extreme(self, name: str, numbers: Sequence[CNumber]) -> CNumber:
        """Return the least or largest number; of NaN and others, that which Python returns."""
        result = numbers[0]
        for number in numbers[1:]:
            kind = widest(result.kind, number.kind, INTEGER)
            if result.known is not None and number.known is not None:
                extreme = (min if name == "min" else max)(result.known, number.known)
                result = known(float(extreme) if kind == REAL else extreme)
            else:
                pair = f"{self.text(result)}, {self.text(number)}"
                result = CNumber(kind, f"hf_{name}_{kind}({pair})")
        return result


def _settled(value: CNumber | CArray) -> CNumber | CArray:
    return element_of(value) if isinstance(value, CArray) and not value.shape else value


def _computed(compute: Callable[[Any, Any], Any], left: Any, right: Any) -> Any:  # noqa: ANN401
    """Return the result of an operator, by the rules of IEEE for a division by zero."""
    if compute is operator.truediv:
        with np.errstate(divide="ignore", invalid="ignore"):
            return float(np.float64(left) / np.float64(right))
    return compute(left, right)
