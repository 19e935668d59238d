"""The C++ reference: the declarations of a public header, with their comments, as Markdown."""
import re
from pathlib import Path

TYPE = re.compile(r"^(?:enum class|struct|class)(?: CLEARANCE_API)? (\w+)[^;(]*\{")


def reference(header: Path) -> str:
    """Each declaration of a header's namespace under a heading of its name, without private parts."""
    body = header.read_text()
    first = body.index("\n\n", body.index("\nnamespace clearance"))
    out = [f"## clearance/{header.name}", "", head(body), ""]
    for comment, code in declarations(body[first:body.rindex("\n}")]):
        found = TYPE.match(code[0])
        if found:
            out += [f"### {found[1]}", ""]
        if comment:
            out += [" ".join(comment), ""]
        out += ["```cpp", *public(code), "```", ""]
    return "\n".join(out)


def head(body):
    """The comment at the start of a header: its first sentences, and its code as code."""
    lines = []
    for line in body.splitlines():
        if not line.startswith("//"):
            break
        lines.append(line[2:].replace("   ", "    ", 1) if line.startswith("//   ") else line[3:])
    return "\n".join(lines)


def declarations(text):
    """(comment, code) of each declaration at the outermost level; adjacent code stays together."""
    comment, code, depth = [], [], 0
    for line in [*text.splitlines(), ""]:
        if not depth and not line.strip():
            if code:
                yield comment, code
            comment, code = [], []
        elif not depth and not code and line.startswith("///"):
            comment.append(line[3:].strip())
        elif not depth and not code and line.startswith("//"):
            continue
        elif not depth and TYPE.match(line) and code:
            yield comment, code
            comment, code = [], [line]
        elif not depth and line.startswith("///") and code:
            yield comment, code
            comment, code = [line[3:].strip()], []
            continue
        else:
            code.append(line)
        depth += line.count("{") - line.count("}")


def public(code):
    """The lines of a declaration without its private part."""
    kept, hidden = [], False
    for line in code:
        if re.match(r" (private|public|protected):", line):
            hidden = not line.startswith(" public")
            continue
        if not hidden or line.startswith("}"):
            kept.append(line)
    return kept
