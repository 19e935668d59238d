"""tools/vocabulary.py: the text that counts as prose, the uses that it finds, and a budget that only decreases."""

import importlib.util
import re

import pytest


@pytest.fixture(scope="module")
def vocabulary(root):
    spec = importlib.util.spec_from_file_location("vocabulary", root / "tools" / "vocabulary.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


CPP = r"""int asks = 1'000;  // Asks
const char* a = "// says";
const char* b = R"x(// says " )x";
char c = '"';  /* One
   who is asked */
/// Looks closely, looked
/// at by nobody.
int beside();  // look
int f();
// at
/// Returns 1. \param x asked
/// \param y of `said`
"""
PYTHON = '''"""Says so."""
#: asked
def asked(says):  # nobody
    r"""
    Looked at.
    """
    return "asked # says"
'''
PAGE = """Asked once, `asked` twice, [said](https://asked.example/says).

```python
asked = says  # nobody
```
<!-- asked -->
Nobody.
"""


def found(vocabulary, text, suffix):
    return [(use.line, use.habit.name, use.text) for use in vocabulary.uses_in(text, suffix)]


def test_comments_of_cpp(vocabulary):
    assert found(vocabulary, CPP, ".cpp") == [
        (1, "ask", "asks"),
        (5, "ask", "asked"),
        (6, "look at", "looked at"),  # across two lines; those of lines 8 and 10 are two comments
        (7, "whoever", "nobody"),
        (11, "\\param", "\\param"),
        (11, "ask", "asked"),
    ]


def test_comments_and_docstrings_of_python(vocabulary):
    assert found(vocabulary, PYTHON, ".py") == [
        (1, "say", "says"),
        (2, "ask", "asked"),
        (3, "whoever", "nobody"),
        (5, "look at", "looked at"),
    ]


def test_sentences_of_a_page(vocabulary):
    assert found(vocabulary, PAGE, ".md") == [(1, "ask", "asked"), (1, "say", "said"), (7, "whoever", "nobody")]


def test_words_are_those_of_prose(vocabulary):
    assert vocabulary.words_in("int x;  // two words\n/* and three more */", ".h") == 5
    assert vocabulary.words_in("x = 'none'  # two words\n", ".py") == 2


@pytest.mark.parametrize("text, habit", [
    ("what it holds", "what is"), ("none: no limit", "none:"), ("It stands for the mesh.", "stand for"),
    ("in pieces", "piece"), ("told", "tell"), ("refusal", "refuse"), ("his", "he"), ("a doubt", "doubt"),
    ("dearer", "dear"), ("is not\n    known", "doubt"),
])  # fmt: skip
def test_finds(vocabulary, text, habit):
    assert habit in [name for _, name, _ in found(vocabulary, text, ".md")]


@pytest.mark.parametrize("text", ["task, basks", "what-if", "truthful", "the handle"])
def test_leaves(vocabulary, text):
    assert found(vocabulary, text, ".md") == []


def test_replacements_are_no_habits(vocabulary):
    for habit in vocabulary.HABITS:
        text = habit.replacement.replace("none:", "")
        assert not found(vocabulary, text, ".md"), habit.name


def test_a_budget_only_falls(vocabulary):
    budget = {"ask": 3, "say": 5}
    assert vocabulary.over_budget({"ask": 3, "say": 4}, budget) == []
    assert vocabulary.over_budget({"ask": 4, "say": 5}, budget) == ["ask"]
    assert vocabulary.over_budget({"ask": 3, "say": 5, "tell": 0}, budget) == ["tell"]  # has no row yet
    assert vocabulary.lowered({"ask": 4, "say": 2, "tell": 7}, budget) == {"ask": 3, "say": 2, "tell": 7}


def test_the_committed_budget_has_a_row_for_each_habit(vocabulary):
    text = vocabulary.BUDGET.read_text()
    budget = vocabulary.read_budget(text)
    assert list(budget) == [habit.name for habit in vocabulary.HABITS]
    assert vocabulary.budget_text(budget) == text


@pytest.fixture
def tree(vocabulary, tmp_path, monkeypatch):
    """A tree of one file that has one use of `ask`, and its budget."""
    file = tmp_path / "a.h"
    file.write_text("// asked\nint x;\n")
    monkeypatch.setattr(vocabulary, "ROOT", tmp_path)
    monkeypatch.setattr(vocabulary, "BUDGET", tmp_path / "budget.txt")
    monkeypatch.setattr(vocabulary, "git_files", lambda *command: ["a.h"])
    monkeypatch.setattr("sys.argv", ["vocabulary.py", "--write"])
    assert vocabulary.main() == 0
    monkeypatch.setattr("sys.argv", ["vocabulary.py"])
    return file


def test_fails_where_a_count_rises(vocabulary, tree, capsys):
    assert vocabulary.main() == 0
    assert re.search(r"^ask +1 +1 +1000\.00 +0\.24$", capsys.readouterr().out, re.M)
    tree.write_text("// asked\n// and asked\n")
    assert vocabulary.main() == 1
    out = capsys.readouterr().out
    assert "a.h:2: asked -> query, request, requested\n" in out and "ask: 2 uses, budget 1\n" in out


def test_write_lowers_and_never_raises(vocabulary, tree, monkeypatch):
    monkeypatch.setattr("sys.argv", ["vocabulary.py", "--write"])
    tree.write_text("// asked\n// and asked\n")
    assert vocabulary.main() == 1
    assert vocabulary.read_budget(vocabulary.BUDGET.read_text())["ask"] == 1
    tree.write_text("// queried\n")
    assert vocabulary.main() == 0
    assert vocabulary.read_budget(vocabulary.BUDGET.read_text())["ask"] == 0


def test_lists_the_uses_of_a_file(vocabulary, tree, monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["vocabulary.py", str(tree)])
    assert vocabulary.main() == 0
    assert capsys.readouterr().out == f"{tree}:1: asked -> query, request, requested\n"
