"""Runs the statements of a C++ function on terms of Coq: declarations, assignments, loops of fixed length, and
`if (!any(mask)) continue;`."""

from __future__ import annotations

import re

from cpp import BOOL, TYPES, Parser, Scope, Unknown, path_of

COUNT = ["using", "Count", "=", "typename", "Lane::Count", ";"]


class Runner(Parser):
    """Statements of a body; `result` is the returned term, if any."""

    def __init__(self, tokens: list[str], scope: Scope, kind: str | None = None):
        super().__init__(tokens)
        self.scope, self.kind = scope, kind
        self.result: str | None = None
        self.declared: list[str] = []

    def run(self) -> str | None:
        while self.at < len(self.tokens) and self.result is None:
            self.statement()
        return self.result

    def statement(self) -> None:
        token = self.peek()
        if token == "using":
            if self.tokens[self.at : self.at + 6] == COUNT:
                self.at += len(COUNT)
            else:
                for known in ("using", "std::sqrt", ";"):
                    self.take(known)
        elif token == "CLEARANCE_UNROLL":
            self.next()
        elif token == "return":
            self.next()
            self.result = self.scope.term(self.expression(), self.kind)
            self.take(";")
        elif token == "for":
            self.loop()
        elif token == "if":
            self.skip_unless()
        elif token == "const" or token in TYPES:
            self.declaration()
        else:
            self.assignment()

    def declaration(self) -> None:
        if self.peek() == "const":
            self.next()
        kind_name = self.next()
        if kind_name not in TYPES:
            raise Unknown(f"the type {kind_name}")
        if self.peek(1) == "=" and self.peek(2) == "[":
            if kind_name != "auto":
                raise Unknown(f"a function of the type {kind_name}")
            self.declare_lambda()
            return
        while True:
            name = self.next()
            if name in self.scope.values or not re.fullmatch(r"[A-Za-z_]\w*", name):
                raise Unknown(f"a second {name}, or no name")
            if self.peek() not in ("=", "("):
                raise Unknown(f"{name} without a value")
            in_parentheses = self.next() == "("
            kind, term = self.scope.value(self.expression(), TYPES[kind_name])
            if TYPES[kind_name] not in (None, kind):
                raise Unknown(f"{name} is a {kind}, not a {kind_name}")
            self.scope.values[name] = (kind, term)
            self.declared.append(name)
            if in_parentheses:
                self.take(")")
            if self.peek() == ";":
                self.next()
                return
            self.take(",")

    def declare_lambda(self) -> None:
        name = self.next()
        for token in ("=", "[", "&", "]", "("):
            self.take(token)
        names = []
        while self.peek() != ")":
            for token in ("const", "T", "&"):
                self.take(token)
            names.append(self.next())
            if self.peek() != ")":
                self.take(",")
        for token in (")", "{", "return"):
            self.take(token)
        self.scope.lambdas[name] = (names, self.expression())
        for token in (";", "}", ";"):
            self.take(token)

    def assignment(self) -> None:
        target = path_of(self.postfix())
        if target is None or target not in self.scope.values:
            raise Unknown(f"an assignment to {target}")
        self.take("=")
        kind, old = self.scope.values[target]
        new = self.scope.term(self.expression(), kind)
        self.take(";")
        if self.scope.guard:
            new = f"(if {self.scope.guard} then {new} else {old})"
        name = f"step{len(self.scope.lets)}"
        self.scope.lets.append(f"let {name} := {new} in")
        self.scope.values[target] = (kind, name)

    def skip_unless(self) -> None:
        """if (!any(mask)) continue;"""
        for token in ("if", "("):
            self.take(token)
        node = self.expression()
        for token in (")", "continue", ";"):
            self.take(token)
        if node[0] != "unary" or node[1] != "!" or self.scope.guard:
            raise Unknown("a condition of continue")
        self.scope.guard = self.scope.term(node[2], BOOL)

    def loop(self) -> None:
        for token in ("for", "(", "int"):
            self.take(token)
        index = self.next()
        for token in ("=", "0", ";", index, "<"):
            self.take(token)
        count = int(self.next())
        for token in (";", "++", index, ")", "{"):
            self.take(token)
        begin, depth = self.at, 1
        while depth:
            depth += {"{": 1, "}": -1}.get(self.next(), 0)
        body = self.tokens[begin : self.at - 1]
        for i in range(count):
            unrolled = [str(i) if token == index else token for token in body]
            turn = Runner(unrolled, self.scope)
            turn.run()
            turn.finish()
            for name in turn.declared:
                del self.scope.values[name]
            self.scope.guard = None


def parameters(kinds: dict[str, str]) -> str:
    return " ".join(f"({name} : {kind})" for name, kind in kinds.items())


def value(text_tokens: list[str], scope: Scope, kind: str) -> str:
    """The term of an expression that is all of a text."""
    parser = Parser(text_tokens)
    term = scope.term(parser.expression(), kind)
    parser.finish()
    return term
