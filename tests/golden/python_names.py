"""Public names of the Python package with their parameters, one line each, as names.py records them."""

import ast
import enum
import inspect
from collections.abc import Iterator
from pathlib import Path

import clearance

PACKAGE = Path(__file__).resolve().parents[2] / "client/python/clearance"
#: Modules of their own, most of which need a package that the tests lack: they are parsed, not imported.
MODULES = ("drake", "jax", "mink", "ompl", "pink", "pinocchio", "placo", "ray", "sweep", "torch")


def python_names() -> "list[str]":
    """`NAME` or `NAME: PARAMETER = DEFAULT`; a number before a parameter is its place."""
    found: list[str] = []
    for name in sorted(clearance.__all__):
        if name not in ("__version__", "wire"):
            found += _of_value(name, getattr(clearance, name))
    for module in MODULES:
        found += _of_module(module)
    return found


def _of_value(name: str, value: object) -> "Iterator[str]":
    if not inspect.isclass(value):
        yield from _of_call(name, value) if callable(value) else [f"{name} = {value!r}"]
    elif issubclass(value, enum.Enum):
        yield from (f"{name}.{member.name} = {member.value}" for member in value)
    else:
        bases = ", ".join(base.__name__ for base in value.__bases__ if not base.__name__.startswith("_"))
        yield f"{name}({bases})" if issubclass(value, Exception) else name
        if value.__init__ is not object.__init__ and not issubclass(value, Exception):
            yield from list(_of_call(name, value))[1:]
        fields = (*getattr(value, "__dataclass_fields__", {}), *getattr(value, "__slots__", ()))
        for member in sorted({*dir(value), *fields}):
            if not member.startswith("_") and not hasattr(Exception, member):
                found = inspect.getattr_static(value, member, None)
                found = getattr(found, "__func__", found)
                yield from _of_call(f"{name}.{member}", found) if callable(found) else [f"{name}.{member}"]


def _of_call(name: str, call: object) -> "Iterator[str]":
    yield name
    try:
        parameters = list(inspect.signature(call).parameters.values())
    except ValueError:  # of an extension module
        return
    for place, p in enumerate(parameters):
        if p.name not in ("self", "cls"):
            default = None if p.default is p.empty else getattr(p.default, "__qualname__", repr(p.default))
            prefix = "*" if p.kind == p.VAR_POSITIONAL else "**" if p.kind == p.VAR_KEYWORD else ""
            yield _parameter(name, place if p.kind <= p.POSITIONAL_OR_KEYWORD else None, prefix + p.name, default)


def _parameter(name: str, place: "int | None", parameter: str, default: "str | None") -> str:
    numbered = parameter if place is None else f"{place} {parameter}"
    return f"{name}: {numbered}" + ("" if default is None else f" = {default}")


def _of_module(module: str) -> "Iterator[str]":
    path = PACKAGE / f"{module}.py"
    body = ast.parse((path if path.exists() else PACKAGE / module / "__init__.py").read_text()).body
    listed = [ast.literal_eval(node.value) for node in body if isinstance(node, ast.Assign) and _is_all(node)]
    defined = {node.name: node for node in body if isinstance(node, (ast.ClassDef, ast.FunctionDef))}
    for name in sorted(listed[0] if listed else (name for name in defined if not name.startswith("_"))):
        yield from _of_node(f"{module}.{name}", defined.get(name))


def _is_all(node: ast.Assign) -> bool:
    return isinstance(node.targets[0], ast.Name) and node.targets[0].id == "__all__"


def _of_node(name: str, node: "ast.stmt | None") -> "Iterator[str]":
    yield name
    if isinstance(node, ast.ClassDef):
        for member in (child for child in node.body if isinstance(child, ast.FunctionDef)):
            if member.name == "__init__":
                yield from list(_of_node(name, member))[1:]
            elif not member.name.startswith("_"):
                yield from _of_node(f"{name}.{member.name}", member)
    elif isinstance(node, ast.FunctionDef):
        ordered = [*node.args.posonlyargs, *node.args.args]
        defaults = [None] * (len(ordered) - len(node.args.defaults)) + node.args.defaults
        for place, (p, default) in enumerate(zip(ordered, defaults)):
            if p.arg not in ("self", "cls"):
                yield _parameter(name, place, p.arg, default and ast.unparse(default))
        for p, default in zip(node.args.kwonlyargs, node.args.kw_defaults):
            yield _parameter(name, None, p.arg, default and ast.unparse(default))
