"""Reads the few forms of C++ that the bounds are written in, and turns them into terms of Coq.

Anything else is an error that names the file and the function: no part of an expression is ever skipped.
"""

from __future__ import annotations

import re
from typing import ClassVar

TOKEN = re.compile(
    r"\s*(?:(?P<num>0x[0-9a-fA-F]+p[-+]?\d+|\d+(?:\.\d*)?(?:e[-+]?\d+)?)"
    r"|(?P<id>[A-Za-z_]\w*(?:::[A-Za-z_]\w*)*)"
    r"|(?P<op>\+\+|\+=|-=|&&|\|\||==|<=|>=|->|[-+*/(){}\[\].,;=<>?:&|!]))"
)
TEMPLATE = re.compile(r"<(?:T|S|double|To|typename T::\w+)>")
BINARY = {"?": 0, "&&": 1, "&": 2, ">": 4, "<": 4, "+": 5, "-": 5, "*": 6, "/": 6}
SCALAR, VECTOR, MATRIX, BOOL = "T", "vec T", "mat T", "bool"
TYPES: dict[str, str | None] = {"Mat3d": MATRIX, "Mask": BOOL, "bool": BOOL, "auto": None}
TYPES |= dict.fromkeys(("T", "S", "double"), SCALAR) | dict.fromkeys(("Vec3", "Vec3d"), VECTOR)


class Unknown(Exception):
    """A form that the proof does not cover."""


def tokens_of(text: str) -> list[str]:
    text = TEMPLATE.sub("", re.sub(r"//[^\n]*", "", text))
    tokens, at = [], 0
    text = text.rstrip()
    while at < len(text):
        match = TOKEN.match(text, at)
        if not match:
            raise Unknown(f"cannot read {text[at : at + 30]!r}")
        tokens.append(match[0].strip())
        at = match.end()
    return tokens


class Parser:
    """Expressions, by precedence."""

    def __init__(self, tokens: list[str]):
        self.tokens, self.at = tokens, 0

    def peek(self, ahead: int = 0) -> str:
        return self.tokens[self.at + ahead] if self.at + ahead < len(self.tokens) else ""

    def next(self) -> str:
        self.at += 1
        return self.tokens[self.at - 1] if self.at <= len(self.tokens) else ""

    def take(self, token: str) -> None:
        got = self.next()
        if got != token:
            raise Unknown(
                f"expected {token!r}, found {got!r} in {' '.join(self.tokens[max(0, self.at - 8) : self.at + 4])}"
            )

    def finish(self) -> None:
        if self.at < len(self.tokens):
            raise Unknown(f"something after the end: {' '.join(self.tokens[self.at :])}")

    def items(self, end: str) -> list:
        found = []
        while self.peek() != end:
            found.append(self.expression())
            if self.peek() != end:
                self.take(",")
        self.take(end)
        return found

    def expression(self, least: int = 0):
        left = self.unary()
        while self.peek() in BINARY and BINARY[self.peek()] >= least:
            op = self.next()
            if op == "?":
                yes = self.expression()
                self.take(":")
                left = ("if", left, yes, self.expression())
            else:
                left = ("binary", op, left, self.expression(BINARY[op] + 1))
        return left

    def unary(self):
        if self.peek() in ("-", "!"):
            return ("unary", self.next(), self.unary())
        return self.postfix()

    def postfix(self):
        token = self.next()
        if token == "(":
            value = self.expression()
            self.take(")")
        elif token == "{":
            value = ("braces", self.items("}"))
        elif re.match(r"[0-9]", token):
            value = ("number", token)
        elif re.match(r"[A-Za-z_]", token):
            value = ("name", token)
        else:
            raise Unknown(f"unexpected {token!r}")
        while True:
            if self.peek() == ".":
                self.next()
                value = ("member", value, self.next())
            elif self.peek() == "[":
                self.next()
                value = ("index", value, self.expression())
                self.take("]")
            elif self.peek() == "(":
                self.next()
                value = ("call", value, self.items(")"))
            elif self.peek() == "{" and value in (("name", "Vec3"), ("name", "Vec3d")):
                self.next()
                value = ("braces", self.items("}"))
            else:
                return value


def path_of(node) -> str | None:
    """A dotted name, such as pair_.R or share[2]."""
    if node[0] == "name":
        return node[1]
    if node[0] == "member":
        inner = path_of(node[1])
        return inner and f"{inner}.{node[2]}"
    if node[0] == "index" and node[2][0] == "number":
        inner = path_of(node[1])
        return inner and f"{inner}[{node[2][1]}]"
    return None


def number(text: str) -> str:
    if match := re.fullmatch(r"0x1p([-+]?\d+)", text):
        return f"(two_to ({int(match[1])}))"
    if match := re.fullmatch(r"(\d+)e(-\d+)", text):
        return f"(decimal {match[1]} ({match[2]}))"
    if re.fullmatch(r"\d+(\.0*)?", text):
        return f"(whole {int(text.split('.')[0])})"
    raise Unknown(f"the literal {text}")


class Scope:
    """Values of names while a function is read: (type, term) each."""

    FUNCTIONS: ClassVar = {  # name: types of the arguments, and of the result
        "dot": ([VECTOR, VECTOR], SCALAR),
        "norm": ([VECTOR], SCALAR),
        "squared_norm": ([VECTOR], SCALAR),
        "pair_scale": ([VECTOR, SCALAR, SCALAR, SCALAR], SCALAR),
        "rounding_error": ([SCALAR, SCALAR], SCALAR),
        "lower_from_gap": ([SCALAR] * 4, SCALAR),
        "upper_from_point": ([SCALAR] * 3, SCALAR),
        "difference": ([VECTOR, VECTOR], VECTOR),
        "sum": ([SCALAR, SCALAR], SCALAR),
    }
    OPERATORS: ClassVar = {
        ("+", SCALAR, SCALAR): ("add", SCALAR),
        ("-", SCALAR, SCALAR): ("sub", SCALAR),
        ("*", SCALAR, SCALAR): ("mul", SCALAR),
        ("/", SCALAR, SCALAR): ("div", SCALAR),
        ("+", VECTOR, VECTOR): ("vadd", VECTOR),
        ("-", VECTOR, VECTOR): ("vsub", VECTOR),
        ("*", VECTOR, SCALAR): ("vscale", VECTOR),
        ("*", MATRIX, VECTOR): ("mat_times", VECTOR),
        ("&", BOOL, BOOL): ("andb", BOOL),
        ("&&", BOOL, BOOL): ("andb", BOOL),
    }

    def __init__(self, values: dict[str, tuple[str, str]]):
        self.values = dict(values)
        self.lambdas: dict[str, tuple[list[str], tuple]] = {}
        self.lets: list[str] = []
        self.guard: str | None = None

    def value(self, node, wanted: str | None = None) -> tuple[str, str]:
        path = path_of(node)
        if path is not None and path in self.values:
            return self.values[path]
        return getattr(self, f"_{node[0]}")(node, wanted)

    def term(self, node, kind: str) -> str:
        got, term = self.value(node, kind)
        if got != kind:
            raise Unknown(f"{term} is a {got}, not a {kind}")
        return term

    def _number(self, node, wanted):
        return SCALAR, number(node[1])

    def _name(self, node, wanted):
        raise Unknown(f"the name {node[1]}")

    def _if(self, node, wanted):
        raise Unknown("?:")

    def _member(self, node, wanted):
        kind, term = self.value(node[1])
        if kind == VECTOR and node[2] in ("x", "y", "z"):
            return SCALAR, f"({node[2]} {term})"
        raise Unknown(f"member {node[2]} of {term}")

    def _index(self, node, wanted):
        inner = node[1]
        if (
            inner[0] == "member"
            and inner[2] == "row"
            and node[2] in (("number", "0"), ("number", "1"), ("number", "2"))
        ):
            return VECTOR, f"(row{node[2][1]} {self.term(inner[1], MATRIX)})"
        raise Unknown(f"index of {inner}")

    def _unary(self, node, wanted):
        kind, term = self.value(node[2])
        names = {("-", SCALAR): "neg", ("-", VECTOR): "vneg", ("!", BOOL): "negb"}
        if (node[1], kind) not in names:
            raise Unknown(f"{node[1]} of a {kind}")
        return kind, f"({names[node[1], kind]} {term})"

    def _binary(self, node, wanted):
        _, op, left, right = node
        if op == ">" and path_of(left) == "s.size":
            if right[0] != "call" or right[1] != ("name", "Count") or right[2][0][0] != "number":
                raise Unknown(f"comparison of s.size with {right}")
            return BOOL, f"(Nat.ltb {right[2][0][1]} size)"
        (a, left_term), (b, right_term) = self.value(left), self.value(right)
        if op == ">" and a == b == SCALAR:
            return BOOL, f"(less {right_term} {left_term})"
        if (op, a, b) not in self.OPERATORS:
            raise Unknown(f"{a} {op} {b}")
        name, kind = self.OPERATORS[op, a, b]
        return kind, f"({name} {left_term} {right_term})"

    def _braces(self, node, wanted):
        items = node[1]
        if wanted == MATRIX:
            if len(items) == 1 and items[0][0] == "braces":
                items = items[0][1]
            kind, maker = VECTOR, "M"
        elif wanted == VECTOR:
            kind, maker = SCALAR, "V"
        else:
            raise Unknown(f"braces for a {wanted}")
        if len(items) != 3:
            raise Unknown(f"{len(items)} items in braces for a {wanted}")
        return wanted, f"({maker} {' '.join(self.term(item, kind) for item in items)})"

    def _call(self, node, wanted):
        callee, given = node[1], node[2]
        name = path_of(callee)
        if name in ("T", "double", "static_cast") and len(given) == 1:
            return SCALAR, self.term(given[0], SCALAR)
        if name == "sqrt" and len(given) == 1:
            return SCALAR, f"(root {self.term(given[0], SCALAR)})"
        if name == "any" and len(given) == 1:
            return BOOL, self.term(given[0], BOOL)
        if name == "select" and len(given) == 3:
            kind, yes = self.value(given[1], wanted)
            return kind, f"(if {self.term(given[0], BOOL)} then {yes} else {self.term(given[2], kind)})"
        if name in self.lambdas:
            return self._lambda(name, given, wanted)
        if callee[0] == "member" and callee[2] == "transpose_times" and len(given) == 1:
            matrix = self.term(callee[1], MATRIX)
            kind, operand = self.value(given[0], VECTOR)
            return kind, f"({'transpose_times' if kind == VECTOR else 'transpose_times_mat'} {matrix} {operand})"
        if name in self.FUNCTIONS:
            kinds, kind = self.FUNCTIONS[name]
            if len(kinds) != len(given):
                raise Unknown(f"{len(given)} arguments of {name}")
            return kind, f"({name} {' '.join(map(self.term, given, kinds))})"
        raise Unknown(f"the call {name or callee}")

    def _lambda(self, name, given, wanted):
        names, body = self.lambdas[name]
        inner = Scope(self.values)
        if len(names) != len(given):
            raise Unknown(f"{len(given)} arguments of {name}")
        inner.values.update(zip(names, [self.value(item) for item in given]))
        return inner.value(body, wanted)
