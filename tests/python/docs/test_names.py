"""Names that a release promises (docs/versions.md) are those of tests/golden/names."""

import sys

import pytest

from conftest import ROOT

sys.path.insert(0, str(ROOT / "tests" / "golden"))

import names
from cpp_names import declarations
from python_names import MODULES, PACKAGE

#: Least number of names of each kind, so that a reader that finds nothing fails.
LEAST = {"commands": 300, "cpp": 500, "lcm": 200, "python": 1000, "scene": 70, "wire": 350}


def difference(recorded: "list[str]", current: "list[str]") -> str:
    """What differs between two lists of names, or an empty string."""
    gone = [name for name in recorded if name not in current]
    new = [name for name in current if name not in recorded]
    if gone:
        return "\n  ".join(["promised, but changed or gone (docs/versions.md):", *gone, "instead perhaps:", *new])
    if new:
        return "\n  ".join([f"not recorded yet ({names.RENEW}):", *new])
    return "" if recorded == current else "the order has changed, and C++ initialises members in order"


@pytest.mark.parametrize("kind", names.KINDS)
def test_names_are_the_recorded_ones(kind):
    current = names.current(kind)
    assert len(current) >= LEAST[kind]
    assert difference(names.recorded(kind), current) == ""


def test_every_public_module_is_listed():
    """`wire` has a list of its own, `view` is a command, and `examples` are programs to copy."""
    files = {path.stem for path in PACKAGE.iterdir() if path.suffix == ".py" or (path / "__init__.py").exists()}
    assert sorted(name for name in files if not name.startswith("_")) == sorted([*MODULES, "examples", "view", "wire"])
    promised = (ROOT / "docs/versions.md").read_text()
    assert ", ".join(f"`{name}`" for name in MODULES) in promised


def test_a_name_that_changes_or_disappears_is_reported():
    recorded = ["a = 1", "b", "c"]
    assert difference(recorded, ["a = 2", "b", "c"]).splitlines()[1:] == ["  a = 1", "  instead perhaps:", "  a = 2"]
    assert "  c" in difference(recorded, ["a = 1", "b"])
    assert "not recorded yet" in difference(recorded, [*recorded, "d"])
    assert "order" in difference(recorded, ["b", "a = 1", "c"])
    assert difference(recorded, recorded) == ""


HEADER = """
#define MACRO(x) \\
  struct Hidden { int x; }
namespace clearance {
struct Later;
enum class Kind : int { kFirst, kFifth = 5, kSixth };
class CLEARANCE_API Front : public Base {
 public:
  explicit Front(int a) : a_{a}, b_(a) { a_ = 2; }  // a comment
  [[nodiscard]] bool is_ready(const Query& q = {}) const { return a_ > 0; }
  struct Inputs {
    double x = 1, y{2};
  };
  template <class T>
  void run(T&& value);
 private:
  int a_ = 0;
  void hidden();
};
inline constexpr int kMost = 7;
namespace detail {
class Part {
 public:
  int inside;
};
}  // namespace detail
}  // namespace clearance
"""


def test_declarations_of_a_header():
    assert declarations(HEADER) == [
        "struct Later",
        "enum class Kind : int",
        "Kind: kFirst = 0",
        "Kind: kFifth = 5",
        "Kind: kSixth = 6",
        "class Front : public Base",
        "Front: Front(int a)",
        "Front: bool is_ready(const Query& q = {}) const",
        "Front: struct Inputs",
        "Front::Inputs: double x = 1, y{2}",
        "Front: template <class T> void run(T&& value)",
        "constexpr int kMost",
    ]
