"""Hooks of mkdocs: the navigation, and pages for files outside docs/.

The navigation is the list of docs/README.md, which is also the first page. A link that leaves docs/ leads to a page
that shows the file or lists the folder, so the site needs no repository. "::: cpp FILE" on a page inserts the
declarations of a public header (site_cpp.py), "::: notebook FILE" a notebook.
"""
import json
import re
import sys
from pathlib import Path

from mkdocs.structure.files import File

sys.path.insert(0, str(Path(__file__).parent))
from site_cpp import reference

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
LINK = re.compile(r"(\]\()([^)\s#:]+)((?:#[^)\s]*)?\))")
FENCE = re.compile(r"^ *```")
ITEM = re.compile(r"( *)([-*]|\d+\.) ")
LANGUAGES = {".h": "cpp", ".cpp": "cpp", ".py": "python", ".lcm": "c", ".sh": "bash", ".yaml": "yaml", ".txt": "text"}


def on_config(config):
    """The navigation: headings of docs/README.md, each with the pages of its list, in order."""
    nav, section = [{"Home": ["README.md"]}], None
    for line in (DOCS / "README.md").read_text().splitlines():
        if line.startswith("## "):
            section = []
            nav.append({line[3:]: section})
        elif section is not None and line.startswith("- "):
            section += [target for target in re.findall(r"\]\(([^)#:]+\.md)\)", line) if target not in section]
    config.nav = nav
    return config


def on_files(files, config):
    """Adds a page for each file outside of docs/ that a page links to, and for those linked from there."""
    seen = set()
    queue = [(page, page.read_text()) for page in DOCS.rglob("*.md")]
    while queue:
        page, text = queue.pop()
        for target in outside(page, text):
            if target not in seen:
                seen.add(target)
                content = shown(target)
                files.append(File.generated(config, place(target), content=content))
                if target.suffix == ".md":
                    queue.append((target, target.read_text()))
    return files


def on_page_markdown(markdown, page, config, files):
    """Converts links, lists and references of one page for the site."""
    here = DOCS / page.file.src_uri
    if page.file.generated_by:
        here = ROOT / page.file.src_uri[len("source/"):]
    up = "../" * page.file.src_uri.count("/")

    def moved(link):
        target = resolved(here, link[2])
        return link[1] + up + place(target) + link[3] if target else link[0]

    if here == DOCS / "README.md":  # it names pages by their files, as a folder's list does
        markdown = re.sub(r"\[[\w/]+\.md\]\(([\w/]+\.md)\)", lambda link: f"[{title(link[1])}]({link[1]})", markdown)
    markdown = LINK.sub(moved, markdown)
    markdown = re.sub(r"^::: cpp (\S+)$", lambda found: reference(ROOT / found[1]), markdown, flags=re.MULTILINE)
    markdown = re.sub(r"^::: notebook (\S+)$", lambda found: notebook(DOCS / found[1]), markdown, flags=re.MULTILINE)
    return spaced_lists(markdown)


def notebook(file):
    """A notebook's cells and their output, without its title. Headings move one level down."""
    out = []
    for cell in json.loads(file.read_text())["cells"]:
        source = "".join(cell["source"])
        if cell["cell_type"] == "markdown":
            lines = ("#" + line if line.startswith("## ") else line for line in source.splitlines())
            out += ["", *(line.replace("](../", "](") for line in lines if not line.startswith("# ")), ""]
        else:
            out += ["```python", source, "```", ""]
        for output in cell.get("outputs", []):
            picture = output.get("data", {}).get("image/png")
            if picture:
                out += [f'<img alt="Output of the cell" src="data:image/png;base64,{"".join(picture.split())}">', ""]
            elif output.get("text"):
                out += ["```text", "".join(output["text"]).rstrip(), "```", ""]
    return "\n".join(out)


def title(page):
    """A page's first heading."""
    return (DOCS / page).read_text().split("\n", 1)[0].removeprefix("# ")


def resolved(page, link):
    """File or folder of a link that begins or ends outside docs/, otherwise None."""
    target = (page.parent / link).resolve()
    if not target.exists() or ROOT not in target.parents or (DOCS in page.parents and DOCS in target.parents):
        return None
    return target


def outside(page, text):
    found = (resolved(page, link[1]) for link in LINK.findall(text))
    return {target for target in found if target and DOCS not in target.parents}


def place(target):
    """Place of a file's page on the site."""
    if DOCS in target.parents:
        return target.relative_to(DOCS).as_posix()
    path = "source/" + target.relative_to(ROOT).as_posix()
    return path if path.endswith(".md") else path + ".md"


def shown(target):
    """The page of a file, or of a folder."""
    name = target.relative_to(ROOT).as_posix()
    if target.suffix == ".md":
        return target.read_text()
    if target.is_dir():
        rows = "\n".join(f"- `{file.name}`" for file in sorted(target.iterdir()))
        return f"# {name}\n\n{rows}\n"
    return f"# {name}\n\n````{LANGUAGES.get(target.suffix, 'text')}\n{target.read_text()}\n````\n"


def spaced_lists(markdown):
    """Markdown with an empty line before each list, which only Python-Markdown requires."""
    lines, fenced = [], False
    for line in markdown.splitlines():
        fenced ^= bool(FENCE.match(line))
        item, before = ITEM.match(line), lines[-1] if lines else ""
        if item and not fenced and len(item[1]) < 4 and before.strip() and not in_list(lines):
            lines.append("")
        lines.append(line)
    return "\n".join(lines) + "\n"


def in_list(lines):
    """Whether the last paragraph began as an item of a list."""
    for line in reversed(lines):
        if not line.strip():
            return False
        if ITEM.match(line):
            return True
    return False
