"""Docstrings as Markdown for the reference of the site: descriptions of arguments become a list."""
import re

import griffe

ARGUMENT = re.compile(r"^(\w+(?:, \w+)*): ")


class Arguments(griffe.Extension):
    """Lines "name: description", with the lines indented under them, become items of a list."""

    def on_object(self, *, obj, **_):
        if obj.docstring:
            obj.docstring.value = as_list(obj.docstring.value)


def as_list(text):
    lines, within = [], False
    for line in text.splitlines():
        found = ARGUMENT.match(line)
        if found and not line.endswith("::"):
            if not within:
                lines.append("")
            within = True
            lines.append(f"- **{found[1]}**: {line[found.end():]}")
        elif within and (line.startswith("    ") or not line.strip()):
            lines.append(line)
        else:
            if within:
                lines.append("")
            within = False
            lines.append(line)
    return "\n".join(lines)
