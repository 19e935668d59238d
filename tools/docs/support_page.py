#!/usr/bin/env python3
"""Writes the tables of supported queries: the options of each reduction, and the queries that a GPU answers.

    tools/docs/support_page.py            # writes the tables into docs/python.md and docs/cuda.md
    tools/docs/support_page.py --check    # exit code 1 if a page differs

Cells of the options are results of tiny queries. Cells of the GPU are the engine's own conditions, read from its source
and evaluated: no GPU is needed.
"""

import math
import os
import re
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
BUILD = Path(os.environ.get("CLEARANCE_BUILD", ROOT / "build"))
DEVICE = ROOT / "engine/device/query"

REDUCTIONS = ("none", "min", "nearest", "within", "any")
#: Kinds of queries by their name in the tables: reduction, and whether they are motions.
KINDS = {f"`{word}`": (word, False) for word in REDUCTIONS} | {
    f"motions, `{word}`": (word, True) for word in ("none", "min", "any")
}
#: Options by their name in the table.
OPTIONS: "dict[str, dict[str, Any]]" = {
    "`max_distance`": {"max_distance": 1.0},
    "`margin`": {"margin": 0.01},
    "depths (`signed_distance`)": {"signed_distance": True},
    "`gradient`": {"fields": "gradient"},
    "`gradient_joints`": {"fields": "gradient_joints"},
    "`hessian_joints`, `rate`, `rate_bounds`, `curvature`, `smooth_radius`": {
        "fields": ["hessian_joints", "rate", "rate_bounds", "curvature", "smooth_radius"]
    },
    "`pair_lower`": {"fields": ["lower", "pair_lower"]},
    "`time`, `first_contact`, `steps`": {"fields": ["time", "first_contact", "steps"]},
    "`verdict`": {"fields": "verdict"},
    "`max_pose_age_ns`": {"max_pose_age_ns": 1},
    "a certificate": {},
}
#: Queries of the GPU's table: members of the engine's QueryView and Plan.
GPU_QUERIES = {
    "`none`": {},
    "`min`": {"reduce": "min"},
    "`nearest`": {"reduce": "nearest"},
    "`within`": {"reduce": "within"},
    "`any`": {"reduce": "any"},
    "depths (`signed_distance`)": {"signed_distance": True},
    "`free_scale`": {"reduce": "any", "fields": "free_scale"},
    "`hessian_joints`, `rate`, `rate_bounds`, `curvature`, `smooth_radius`": {"fields": "curvature"},
    "`nearest` with `k`": {"reduce": "nearest", "k": 20},
    "`max_pose_age_ns`": {"max_pose_age_ns": 1},
    "motions of joints, `none`": {"max_evaluations": 256},
    "motions of joints, `min`": {"max_evaluations": 256, "reduce": "min"},
    "motions of joints, `min` with `max_distance`": {"max_evaluations": 256, "reduce": "min", "max_distance": 1.0},
    "motions of joints, `min` with `pair_lower`": {"max_evaluations": 256, "reduce": "min", "fields": "pair_lower"},
    "motions of joints, `any`": {"max_evaluations": 256, "reduce": "any"},
    "motions of joints along curves": {"max_evaluations": 256, "reduce": "any", "control_points": 4},
    "motions of bodies by poses": {"max_evaluations": 256, "reduce": "any", "given_bodies": 1},
}


def markdown(header: "list[str]", rows: "list[list[str]]") -> str:
    lines = ["| " + " | ".join(header) + " |", "|" + "---|" * len(header)]
    return "\n".join(lines + ["| " + " | ".join(row) + " |" for row in rows])


def options() -> str:
    """The options of each reduction, by queries of an arm and a ball."""
    sys.path.insert(0, str(BUILD / "python"))
    import clearance

    scene = clearance.Scene()
    scene.add_robot("arm", ROOT / "scenes/cell/arm.urdf")
    scene.add_sphere("ball", 0.1, pose=[1, 1, 1, 1, 0, 0, 0])
    engine = clearance.Engine(scene, backend="cpu", threads=1)
    arm = engine.joints("arm")
    here, there = [[0.0] * len(arm)], [[0.1] * len(arm)]

    def supports(reduce: str, motions: bool, option: str) -> bool:
        given = {"joints": arm, "pairs": [("arm/gripper", "ball")], "reduce": reduce}
        try:
            if option == "a certificate":
                moves = {"start": here, "end": there} if motions else {"configurations": here}
                engine.certificate([0], **given, **moves)
            else:
                query = engine.prepare("motions" if motions else "distances", **given, **OPTIONS[option])
                query.run(*((here, there) if motions else (here,)))
        except (clearance.QueryError, ValueError):
            return False
        return True

    cells = {option: [yes_no(supports(*kind, option)) for kind in KINDS.values()] for option in OPTIONS}
    everywhere = [option for option, row in cells.items() if "no" not in row]
    rows = [[option, *row] for option, row in cells.items() if option not in everywhere]
    return f"{markdown(['option', *KINDS], rows)}\n\nAll of them support {', '.join(everywhere)}."


def yes_no(cell: bool) -> str:
    return "yes" if cell else "no"


def rejections(function: str, file: str) -> "list[tuple[str, str]]":
    """(condition in Python, reason) of each return of an engine function. An empty reason means support."""
    source = (DEVICE / file).read_text()
    body = re.search(rf"^std::string {function}\(.*?\) {{\n(.*?)^}}", source, re.MULTILINE | re.DOTALL)
    if not body:
        raise SystemExit(f"{file}: no function {function}()")
    text = re.sub(r"if \(const [^;]*; ", "if (", re.sub(r"//.*", "", body[1]))
    found = []
    for statement in (" ".join(part.split()) for part in text.split(";")):
        early = re.fullmatch(r'if \((.*)\) return (?:"(.*)"|.* \+ "(.*)")', statement)
        last = re.fullmatch(r'return (.*) \? "(.*)" : ""', statement)
        if early or last:
            condition, *reasons = (early or last).groups()
            found.append((translated(condition), next(reason for reason in reasons if reason is not None)))
        elif statement not in ("", "return {}", "const QueryView& q = plan.query"):
            raise SystemExit(f"{file}: {function}(): cannot be read: {statement}")
    return found


def translated(condition: str) -> str:
    """A C++ condition on a query as Python."""
    for pattern, replacement in (
        (r"body != kNone", "False"),  # no body of the query has a max_speed
        (r"plan\.query\.", "q."),
        (r"Reduce::k(\w+)", lambda found: f"'{found[1].lower()}'"),
        (r"q\.fields & kSecondOrderFields", "q.fields == 'curvature'"),
        (r"q\.fields & kField(\w+)", lambda found: f"q.fields == '{snake(found[1])}'"),
        (r"plan\.joints\.empty\(\)", "not plan.joints"),
        (r"&&", "and"),
        (r"\|\|", "or"),
        (r"INFINITY", "math.inf"),
    ):
        condition = re.sub(pattern, replacement, condition)
    return condition


def snake(name: str) -> str:
    return re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name).lower()


def gpu() -> str:
    """Queries that the device backend and device queries answer, by the conditions of the engine's source."""
    checks = [rejections("beyond_the_device", "fallback_job.cpp"), rejections("beyond_plans", "device_plan.cpp")]
    rows = []
    for name, members in GPU_QUERIES.items():
        q = SimpleNamespace(
            **{"reduce": "none", "fields": "", "max_evaluations": 0, "max_distance": math.inf, "max_pose_age_ns": 0,
               "signed_distance": False, "given_bodies": 0, "control_points": 2, "k": 0} | members
        )  # fmt: skip
        plan = SimpleNamespace(given_bodies=q.given_bodies, joints=[] if q.given_bodies else [0])
        names = {"q": q, "plan": plan, "math": math}
        why = [next((reason for condition, reason in check if eval(condition, names)), "") for check in checks]
        rows.append([name, *(yes_no(not reason) for reason in why)])
    return markdown(["query", 'backend `"cuda"`', "device query"], rows)


#: Tables by page and name: the text between `<!-- support NAME -->` and `<!-- end of support -->`.
TABLES = {"docs/python.md": {"options": options}, "docs/cuda.md": {"gpu": gpu}}


def filled(page: str) -> str:
    """A page's text with its tables."""
    text = (ROOT / page).read_text()
    for name, table in TABLES[page].items():
        begin, end = f"<!-- support {name} -->\n", "<!-- end of support -->"
        if text.count(begin) != 1:
            raise SystemExit(f"{page}: expected one table {name}, found {text.count(begin)}")
        before, after = text.split(begin)
        text = f"{before}{begin}{table()}\n{after[after.index(end) :]}"
    return text


def main() -> int:
    pages = {page: filled(page) for page in TABLES}
    stale = [page for page, text in pages.items() if (ROOT / page).read_text() != text]
    if sys.argv[1:] == ["--check"]:
        print("\n".join(f"{page}: run tools/docs/support_page.py" for page in stale) or "up to date")
        return int(bool(stale))
    for page in stale:
        (ROOT / page).write_text(pages[page])
    return 0


if __name__ == "__main__":
    sys.exit(main())
