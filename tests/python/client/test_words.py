"""The vocabulary of Python equals that of wire/types.h."""

import enum
import re
import typing

import pytest

import clearance
from clearance import _words


def upper_snake(name):
    """kBadPose -> BAD_POSE, kF64 -> F64."""
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).upper()


@pytest.fixture(scope="module")
def header(root):
    return "".join((root / "wire" / name).read_text() for name in ("types.h", "mesh_as.h"))


def enum_values(header, name):
    body = re.search(rf"\benum (?:class )?{name} : [\w:]+ {{(.*?)}};", header, re.S).group(1)
    body = re.sub(r"///?<?.*", "", body)
    values = {}
    for key, expression in re.findall(r"(\w+)\s*=\s*([^,]+)", body):
        values[key] = eval(expression.replace("u", "").strip(), {"__builtins__": {}})
    return values


@pytest.mark.parametrize("name, prefix", [
    ("Status", "k"), ("Flag", "kFlag"), ("Precision", "k"), ("Reduce", "k"), ("Field", "kField"),
    ("MeshAs", "k"),
])  # fmt: skip
def test_enum_mirrors_header(header, name, prefix):
    values = enum_values(header, name)
    assert len(values) >= 2
    ours = getattr(_words, name)
    assert {member.name: int(member) for member in ours} == {
        upper_snake(key[len(prefix) :]): value for key, value in values.items()
    }


def test_every_enum_of_the_header_is_mirrored(header):
    names = re.findall(r"\benum (?:class )?(\w+) :", header)
    assert len(names) == 6
    assert all(issubclass(getattr(_words, name), enum.Enum) for name in names)


def test_constants(header):
    def constant(name):
        return eval(re.search(rf"{name} = (\w+);", header).group(1).rstrip("u"))

    assert _words.GROUP_BIT == constant("kGroupBit")
    assert _words.EVERY_BODY == constant("kEveryBody")
    assert _words.NONE == constant("kNone")
    assert _words.MAX_NAME_BYTES == constant("kMaxNameBytes")
    assert _words.DEFAULT_POINTS_ROWS == constant("kDefaultPointsRows")
    default = re.search(r"kDefaultFields = ([^;]+);", header).group(1)
    assert _words.DEFAULT_FIELDS == sum(
        1 << _words.COLUMNS[name.strip()[len("kField") :].lower()].bit for name in default.split("|")
    )


def test_columns_have_the_sizes_of_the_header(header):
    sizes = [int(n) for n in re.search(r"kFieldBytes\[kFieldCount\] = {([^}]+)}", header).group(1).split(",")]
    assert len(sizes) == _words.FIELD_COUNT and len(_words.COLUMNS) == len(_words.Field)
    for name, column in _words.COLUMNS.items():
        size = sizes[column.bit]  # of one joint for gradient_joints
        assert _words.Field[name.upper()] == 1 << column.bit
        count = 1
        for n in column.shape:
            count *= n
        assert column.dtype.itemsize * count == size, name


def test_words_as_strings():
    assert _words.REDUCTIONS == {"none": 0, "within": 1, "nearest": 2, "min": 3, "any": 4}


@pytest.mark.parametrize("literal, table", [
    ("ReduceWord", "REDUCTIONS"), ("MeshAsWord", "MESH_AS"), ("BackendWord", "BACKENDS"),
    ("CoversWord", "COVERS"), ("ServiceWord", "SERVICE_CLASSES"),
])  # fmt: skip
def test_type_checkers_know_the_words(literal, table):
    assert list(typing.get_args(getattr(_words, literal))) == list(getattr(_words, table))


@pytest.mark.parametrize("call, argument, literal", [
    ("Client.distances", "reduce", "ReduceWord"), ("Engine.submit", "reduce", "ReduceWord"),
    ("Engine.__init__", "backend", "BackendWord"), ("Engine.__init__", "covers", "CoversWord"),
    ("Scene.add_mesh", "mesh_as", "MeshAsWord"),
])  # fmt: skip
def test_arguments_are_typed_by_their_words(call, argument, literal):
    kind, _, method = call.partition(".")
    hints = typing.get_type_hints(getattr(getattr(clearance, kind), method))
    assert hints[argument] == getattr(_words, literal)
