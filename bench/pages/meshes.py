"""Tables of docs/performance.md: meshes that are not convex, links of robots, and clouds, compared with Coal."""

from pages import markdown, results

QUERIES = {"rows": "all distances", "least": "`min`", "valid": "`any`"}
NAMES = {"panda": "Panda", "ur5": "UR5"}


def microseconds(value):
    value = float(value)
    return f"{value:.1f}" if value < 10 else f"{value:,.0f}"


def ratio(value):
    return f"{float(value):.3g}"


def origin(name):
    remark, rows = results(name)
    return f"From `docs/results/{name}.csv`{f' ({remark})' if remark else ''}.", rows


def surfaces():
    source, rows = origin("surfaces")
    columns = ("us", "coal_us", "check_us", "coal_check_us")
    header = ["us", "distance", "Coal", "over ours", "`any`", "Coal", "over ours"]
    lines = []
    for row in rows:
        ours, coal, check, coal_check = (microseconds(row[column]) for column in columns)
        lines.append([row["case"], ours, coal, ratio(row["ratio"]), check, coal_check, ratio(row["check_ratio"])])
    return f"{markdown(header, lines)}\n\n{source}"


def link_meshes():
    source, rows = origin("link_meshes")
    lines = [
        [NAMES[row["robot"]], row["links"], QUERIES[row["question"]], microseconds(row["us"]),
         microseconds(row["coal_us"]), ratio(row["ratio"])]
        for row in rows
    ]
    return f"{markdown(['robot', 'links', 'query', 'ours [us]', 'Coal [us]', 'over ours'], lines, 3)}\n\n{source}"


def clouds():
    source, rows = origin("clouds")
    lines = [
        [f"{int(row['elements']):,} {row['cloud']}", microseconds(row["min_us"]), microseconds(row["coal_min_us"]),
         ratio(row["min_ratio"]), microseconds(row["any_us"]), microseconds(row["coal_any_us"]),
         ratio(row["any_ratio"]), ratio(row["swap_ms"]), ratio(row["coal_swap_ms"])]
        for row in rows
    ]
    header = ["us; new cloud: ms", "`min`", "Coal", "over ours", "`any`", "Coal", "over ours", "new cloud", "Coal"]
    return f"{markdown(header, lines)}\n\n{source}"


TABLES = {"surfaces": surfaces, "link_meshes": link_meshes, "clouds": clouds}
