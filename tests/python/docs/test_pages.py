"""Pages whose snippets are run, and pages that are generated from the code."""

import os
import re
import sys
from pathlib import Path

import pytest

import clearance

ROOT = Path(__file__).resolve().parents[3]
BUILD = Path(os.environ.get("CLEARANCE_BUILD", ROOT / "build"))
sys.path.insert(0, str(ROOT / "tools/docs"))

import error_page  # noqa: E402
import snippets  # noqa: E402
import support_page  # noqa: E402


@pytest.mark.filterwarnings("ignore::clearance.MeshWarning")
@pytest.mark.parametrize("page", snippets.pages(), ids=snippets.name_of)
def test_what_a_page_says_runs_and_prints_what_it_says(page):
    snippets.check(page)


def test_a_page_that_says_otherwise_is_found(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("```python\nx = 1\n```\n\nThen\n\n```python\nx += 1\nprint(x)\n```\n\n```text\n2\n```\n")
    snippets.check(page)
    page.write_text(page.read_text().replace("text\n2", "text\n3"))
    with pytest.raises(snippets.Differs, match=r"(?s)-3.*\+2"):
        snippets.check(page)
    written = snippets.run_page(
        "```python\nx = 1\n```\n\n```python\ndel x\n```\n\n```python\nprint(x)\n```\n", "page.md"
    )
    assert "```text\n1\n```" in written, "each snippet begins with the first one, run anew"
    page.write_text("```python\nx = 1\n```\n\n```python\nprint(y)\n```\n")
    with pytest.raises(NameError):
        snippets.check(page)


def test_commands_are_run_in_order_and_in_a_folder_of_their_own(tmp_path):
    page = tmp_path / "page.md"
    page.write_text(
        "# A page\n    export WHO=you\n    echo $WHO \\\n        too > said\n    cat said\n\n```text\nyou too\n```\n"
    )
    snippets.check(page)
    assert not (ROOT / "said").exists()
    page.write_text(page.read_text().replace("text\nyou too", "text\nyou"))
    with pytest.raises(snippets.Differs):
        snippets.check(page)
    page.write_text("First\n\n    true\n    ls nowhere   # ends with 2\n")
    with pytest.raises(snippets.Failed, match=r"page.md:4: ls nowhere.*\nends with 2: .*nowhere"):
        snippets.check(page)
    page.write_text("# A page\n    clearanced --scene nowhere.yaml &\n")
    with pytest.raises(snippets.Failed, match=r"(?s)page.md:2: .*ended before it was ready.*nowhere.yaml"):
        snippets.check(page)


def test_the_cookbook_answers_its_questions():
    text = (ROOT / "docs/cookbook.md").read_text()
    questions = re.split(r"^### ", text, flags=re.MULTILINE)[1:]
    assert len(questions) > 10
    assert [int(question.split(".")[0]) for question in questions] == list(range(1, len(questions) + 1))
    assert all("```python" in question and "?" in question.splitlines()[0] for question in questions)


def test_the_page_of_errors_is_that_of_the_code():
    text = error_page.PAGE.read_text()
    assert text == error_page.page(), "run tools/docs/error_page.py"
    rows = dict(re.findall(r"^\| `([A-Z_]+)` \| (\d+) \|", text, re.MULTILINE))
    for words in (clearance.Status, clearance.Flag, clearance.wire.ErrorCode):
        for word in words:
            assert rows[word.name] == str(word.value), word
    for name in clearance.__all__:
        thing = getattr(clearance, name)
        if isinstance(thing, type) and issubclass(thing, (Exception, Warning)):
            assert f"| `{name}` |" in text, name
    # The wire's own list, in C++, has the same codes.
    header = (ROOT / "wire/protocol.h").read_text()
    codes = re.findall(r"^  k(\w+) = \d+", header[header.index("enum class ErrorCode") :].split("};")[0], re.MULTILINE)
    assert len(codes) == len(clearance.wire.ErrorCode)
    assert not [code for code in codes if re.sub(r"(?<=[a-z])(?=[A-Z])", "_", code).upper() not in rows]


def test_tables_of_supported_queries_are_those_of_the_code():
    for page in support_page.TABLES:
        assert (ROOT / page).read_text() == support_page.filled(page), "run tools/docs/support_page.py"


def test_conditions_that_cannot_be_read_are_reported(tmp_path, monkeypatch):
    monkeypatch.setattr(support_page, "DEVICE", tmp_path)
    file = tmp_path / "some.cpp"
    file.write_text(
        'std::string beyond(const Plan& plan) {\n  if (plan.query.max_evaluations > 0) return "motions";\n}\n'
    )
    assert support_page.rejections("beyond", "some.cpp") == [("q.max_evaluations > 0", "motions")]
    file.write_text("std::string beyond(const Plan& plan) {\n  return motions(plan);\n}\n")
    with pytest.raises(SystemExit, match="cannot be read: return motions"):
        support_page.rejections("beyond", "some.cpp")
