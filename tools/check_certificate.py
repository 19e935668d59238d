#!/usr/bin/env python3
"""Checks certificates of Clearance in exact arithmetic: check_certificate.py [--all] FILE...

Needs Python 3.9 and uses nothing of Clearance. docs/certificates.md says what a document holds, why what is checked
here proves it, and what is not proved. Says why of each row that fails (--all: of every row what was shown).
Exit code 0: every row of every file is proved. 1: some are not, or a file is no certificate.
"""
import argparse
import json
import math
import sys
from fractions import Fraction

UNPLACED = ("bad_pose", "no_pose", "stale_pose", "unknown_body")
#: Points beside the origin, and rays from them, without pattern: one is enough that meets no edge.
RAYS = [((3, -5, 8), (732, 481, -483)), ((-7, 2, 2), (-377, 618, 691)), ((2, 7, -4), (127, -911, 392)),
        ((-5, -4, -6), (-802, -223, -554))]
class Wrong(Exception):
    pass
MALFORMED = (Wrong, KeyError, IndexError, TypeError, ValueError, AttributeError, OverflowError)
def require(condition, why):
    if not condition:
        raise Wrong(why)
def real(x):
    """A number of the document: a float, perhaps infinite."""
    if x in ("inf", "-inf") and isinstance(x, str):
        return float(x)
    require(isinstance(x, (int, float)) and not isinstance(x, bool), f"{x!r} is no number")
    return float(x)
def exact(x):
    require(math.isfinite(real(x)), f"{x} is not finite")
    return Fraction(real(x))
def length(x, what):
    require(exact(x) >= 0, f"{what} is negative")
    return exact(x)
def high_and_low(x):
    high, low = x
    return exact(high) + exact(low)
def at(items, index, what):
    require(isinstance(index, int) and not isinstance(index, bool) and 0 <= index < len(items), f"no {what} {index!r}")
    return items[index]
def no_repeats(pairs):
    require(len({key for key, _ in pairs}) == len(pairs), "a name stands twice in one object")
    return dict(pairs)
def dot(u, v):
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]
def cross(u, v):
    return (u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0])
def minus(u, v):
    return tuple(x - y for x, y in zip(u, v))
def integers(vectors):
    """The vectors times one number, so that all coordinates are integers; and that number."""
    scale = math.lcm(*(x.denominator for v in vectors for x in v))
    return [tuple(int(x * scale) for x in v) for v in vectors], scale
def root_above(x):  # no less than the root of x >= 0, and no more than 2^-256 of it or of a unit more
    return Fraction(math.isqrt(x.numerator * x.denominator << 512) + 1, x.denominator << 256)

class Piece:
    def __init__(self, document):
        self.radius = length(document["radius"], "a radius")
        core = document.get("core", {"kind": None, "size": (1, 1, 1)})  # none: the hull of the vertices
        self.kind, self.size = core["kind"], tuple(length(x, "a size") for x in core["size"])
        require(self.kind in (None, "cone", "cylinder", "ellipsoid"), f"unknown core {self.kind!r}")
        require(len(self.size) == 3 and min(self.size) > 0, "a core is flat")
        self.vertices = [tuple(map(exact, v)) for v in document["vertices"]]
        require(all(len(v) == 3 for v in self.vertices), "a vertex has three coordinates")
        require(len(self.vertices) == document["count"] > 0, "a piece has not as many vertices as it says")
        self.numbers, self.scale = integers(self.vertices)
        self.squared_reach = max(dot(v, v) for v in self.vertices)
        if self.kind:
            x, y, z = (s * s for s in self.size)
            self.squared_reach = max(x, y, z) if self.kind == "ellipsoid" else x + z
    def support(self, n):  # no less than n.v for all points v of the core; of vertices the largest
        if self.kind == "ellipsoid":
            return root_above(sum((s * x) ** 2 for s, x in zip(self.size, n)))
        if self.kind:
            rim, along = self.size[0] * root_above(n[0] ** 2 + n[1] ** 2), self.size[2] * n[2]
            return rim + abs(along) if self.kind == "cylinder" else max(along, rim - along)
        (m,), scale = integers([n])
        return Fraction(max(dot(m, v) for v in self.numbers), scale * self.scale)
    def points(self, found):
        """What a claim's vertices name, and how far from the core the farthest of these is at most."""
        if not self.kind:
            return self.vertices, 0
        points = [tuple(map(high_and_low, p)) for p in found]
        return points, max(0, *map(self.off, points))
    def off(self, p):
        if self.kind == "ellipsoid":  # p / scale lies in it
            scale = root_above(sum((x / s) ** 2 for s, x in zip(self.size, p)))
            return (scale - 1) * root_above(dot(p, p))
        radius, _, half = self.size
        require(abs(p[2]) <= half, "a point lies beyond the ends of its core")
        share = 1 if self.kind == "cylinder" else (half - p[2]) / (2 * half)
        return root_above(p[0] ** 2 + p[1] ** 2) - share * radius

class Pose:
    """x, y, z, qw, qx, qy, qz: the rotation is M(q) / |q|^2, exactly."""
    def __init__(self, numbers):
        x, y, z, a, b, c, d = map(exact, numbers)
        self.t = (x, y, z)
        s = a * a + b * b + c * c + d * d
        require(s > 0, "a quaternion is zero")
        rows = ((a * a + b * b - c * c - d * d, 2 * (b * c - a * d), 2 * (b * d + a * c)),
                (2 * (b * c + a * d), a * a + c * c - b * b - d * d, 2 * (c * d - a * b)),
                (2 * (b * d - a * c), 2 * (c * d + a * b), a * a + d * d - b * b - c * c))
        self.rows = tuple(tuple(x / s for x in row) for row in rows)
        self.columns = tuple(zip(*self.rows))
    def turned(self, v):
        return tuple(dot(row, v) for row in self.rows)
    def turned_back(self, v):
        return tuple(dot(column, v) for column in self.columns)
def is_at_least(product, squared_length, bound):
    """Whether product / length >= bound, without a root."""
    if bound > 0:
        return product > 0 and product * product >= bound * bound * squared_length
    return product >= 0 or product * product <= bound * bound * squared_length
def goes_around(points, faces):
    """Whether rays from a point beside the origin cross a surface more often one way than the other. `points` are
    integers, and all triangles farther from the origin than the points of RAYS."""
    for o, g in RAYS:
        q = [minus(w, o) for w in points]
        turns = 0
        for i, j, k in faces:
            sides = [dot(g, cross(q[u], q[v])) for u, v in ((i, j), (j, k), (k, i))]
            if 0 in sides:
                break  # this ray meets an edge: another
            ahead = dot(q[i], cross(q[j], q[k]))
            if len({s > 0 for s in sides + [ahead]}) == 1:
                turns += 1 if ahead > 0 else -1
        else:
            return turns != 0
    return False
def chord_above(angle):
    """At least 2 sin(angle / 2): Taylor's sum, which ends on a positive term. 2 where the angle may be pi or more."""
    if angle >= Fraction(math.pi):
        return Fraction(2)
    x = angle / 2
    return 2 * sum((-1) ** k * x ** (2 * k + 1) / math.factorial(2 * k + 1) for k in range(13))

class Body:
    def __init__(self, document, pieces):
        self.name = document["name"]
        self.pieces = [at(pieces, k, "piece") for k in document["pieces"]]
        self.inner = length(document["shape"]["inner"], "shape.inner")
        self.outer = length(document["shape"]["outer"], "shape.outer")
        self.angle = length(document["uncertainty"]["angle"], "uncertainty.angle")
        self.speed = length(document["max_speed"], "max_speed")
        self.position = length(document["uncertainty"]["position"], "uncertainty.position")
        grown = length(document["padding"], "padding") + self.position
        for piece in self.pieces:
            require(piece.radius + self.inner >= grown, f"a piece of {self.name!r} lacks padding or uncertainty")
        self.chord = chord_above(self.angle)
    def may_turn(self, chord, slack):
        """Whether slack >= chord (|v| + radius + inner) for every vertex."""
        rests = [(slack - chord * (p.radius + self.inner), p.squared_reach) for p in self.pieces]
        return all(rest >= 0 and rest * rest >= chord * chord * squared for rest, squared in rests)
def check_slack(span, bodies, above):
    slack, terms, none = span["slack"], {"a": {}, "b": {}, "pair": {}}, (0, 0, 0)
    inner, outer = length(slack["inner"], "slack.inner"), length(slack["outer"], "slack.outer")
    for term in slack["terms"]:
        of, name = terms[term["of"]], term["name"]
        known = ("joints",) if term["of"] == "pair" else ("shape", "turn", "age", "parent", "placement")
        require(name in known, f"slack {name!r} has no proof")
        require(name not in of, f"slack {name!r} stands twice")
        age = length(term["age_s"], "age_s") if name == "age" else 0
        of[name] = (length(term["inner"], f"slack {name}"), length(term["outer"], f"slack {name}"), age)
    require([type(x) for x in span["composed"]] == [bool, bool], "composed: expected two of true and false")
    shared = bool(terms["pair"])  # links of one robot: what carries both moves neither before the other
    require(not shared or span["follows"][0] == span["follows"][1] != [], "joints: links do not follow the same")
    for of, body, composed, followed in zip(terms.values(), bodies, span["composed"], above):
        shape, placement, (moved, _, age) = (of.get(name, none) for name in ("shape", "placement", "age"))
        require(shape[0] >= body.inner and shape[1] >= body.outer, f"slack of the shape of {body.name!r} is missing")
        require(body.may_turn(body.chord, of.get("turn", none)[0]), f"{body.name!r} may turn further")
        rest = of.get("parent", none)[0] - sum(other.position for other in followed if not shared)
        require(rest >= 0 and body.may_turn(sum(other.chord for other in followed if not shared), rest),
                f"what {body.name!r} follows is known less well")
        require(not body.speed or ("age" in of and moved >= body.speed * age), f"{body.name!r} may have moved further")
        require(not composed or (followed and min(placement[:2]) > 0), f"{body.name!r} has a composed pose")
    together = [sum(term[k] for of in terms.values() for term in of.values()) for k in (0, 1)]
    require(inner >= together[0] and outer >= together[1], "slack is less than its terms together")
    return inner, outer
class Row:
    def __init__(self, bodies, span):
        self.a, self.b = bodies
        self.X_wa, self.X_wb = (Pose(numbers) for numbers in span["poses"])
        self.shift = minus(self.X_wb.t, self.X_wa.t)
    def check_lower(self, claims, bound):
        open_pairs = {(i, j) for i in range(len(self.a.pieces)) for j in range(len(self.b.pieces))}
        for claim in claims:
            pairs = open_pairs if claim["pieces"] is None else {tuple(claim["pieces"])}
            n = tuple(map(high_and_low, claim["direction"]))  # axes of a, from a towards b
            require(len(n) == 3 and any(n), "a direction has no length")
            n_w = self.X_wa.turned(n)
            n_b, along = tuple(-x for x in self.X_wb.turned_back(n_w)), dot(n_w, self.shift)
            ahead = {i: at(self.a.pieces, i, "piece").support(n) for i, _ in pairs}
            behind = {j: at(self.b.pieces, j, "piece").support(n_b) for _, j in pairs}
            for i, j in pairs:
                need = bound + self.a.pieces[i].radius + self.b.pieces[j].radius
                require(is_at_least(along - behind[j] - ahead[i], dot(n, n), need),
                        f"pieces {i} and {j} are not {float(bound)!r} m apart along their direction")
            open_pairs = open_pairs - pairs
        require(not open_pairs, f"no direction for pieces {sorted(open_pairs)[:3]}")
        return f"{len(claims)} direction(s)"
    def check_upper(self, claim, bound):
        i, j = claim["pieces"]
        a, b = at(self.a.pieces, i, "piece"), at(self.b.pieces, j, "piece")
        (of_a, off_a), (of_b, off_b) = (p.points(found) for p, found in zip((a, b), claim.get("points", (None, None))))
        vertices = [(at(of_a, k, "vertex"), at(of_b, m, "vertex")) for k, m in claim["vertices"]]
        reach = bound + a.radius + b.radius - off_a - off_b  # of the cores' distance
        return (self.check_surface if "faces" in claim else self.check_points)(claim, vertices, reach)
    def check_points(self, claim, vertices, reach):
        weights = [high_and_low(w) for w in claim["weights"]]
        require(len(weights) == len(vertices) and min(weights) >= 0 and sum(weights) > 0, "weights are none")
        share = [w / sum(weights) for w in weights]
        p_a, p_b = (tuple(sum(s * v[side][k] for s, v in zip(share, vertices)) for k in range(3)) for side in (0, 1))
        apart = minus(self.X_wb.turned(p_b), minus(self.X_wa.turned(p_a), self.shift))
        require(reach >= 0 and dot(apart, apart) <= reach * reach, "the witness points are farther apart than upper")
        return f"points of {len(vertices)} vertices"
    def check_surface(self, claim, vertices, reach):
        # The cores overlap by a ball around the origin of A - B, of radius -reach or more.
        points = [minus(p, self.X_wa.turned_back(tuple(map(sum, zip(self.X_wb.turned(q), self.shift)))))
                  for p, q in vertices]
        faces = [tuple(face) for face in claim["faces"]]
        normals = [tuple(map(high_and_low, m)) for m in claim["normals"]]
        require(faces and len(faces) == len(normals), "a surface needs faces, each with its direction")
        require(all(len(face) == 3 for face in faces), "a face has three vertices")
        edges = [(at(points, u, "vertex") and u, v) for face in faces for u, v in zip(face, face[1:] + face[:1])]
        require(sorted(edges) == sorted((v, u) for u, v in edges), "the surface has a border")
        beyond = [(min(dot(m, points[k]) for k in face), dot(m, m)) for face, m in zip(faces, normals)]
        for product, squared in beyond:
            require(product > 0 and is_at_least(product, squared, -reach), "a face is not beyond its plane")
        least = min(product * product / squared for product, squared in beyond)
        numbers, scale = integers(points)
        while least * scale * scale <= max(dot(o, o) for o, _ in RAYS):
            numbers, scale = [tuple(x << 64 for x in w) for w in numbers], scale << 64
        require(goes_around(numbers, faces), "the surface does not go around the origin")
        return f"a surface of {len(faces)} faces"
def check_status(status, lower, upper, query):
    beyond = real(query["max_distance"])
    require(lower <= upper, "lower is above upper")
    require(query["signed"] or upper >= 0, "a distance is never negative")
    fits = {"ok": 0 < lower <= beyond, "overlap": upper <= 0, "contact": lower <= 0 <= upper, "beyond": lower > beyond,
            "unconverged": True}
    require(status in fits, f"unknown status {status!r}")
    require(fits[status], f"bounds [{lower!r}, {upper!r}] are not {status!r}")
def check_row(row, bodies, query):
    status, lower, upper, spans = row["status"], real(row["lower"]), real(row["upper"]), row["spans"]
    if status in UNPLACED:
        require(lower == -math.inf and upper == math.inf and not spans, f"{status} says nothing of a distance")
        return "says nothing, and nothing is to be proved"
    require(row["proved"] is True, "the engine found no proof")
    require(len(spans) == 1, "a row has one span")
    require(isinstance(query["signed"], bool), "signed: expected true or false")
    check_status(status, lower, upper, query)
    both = [bodies[id] for id in row["bodies"]]
    above = [[bodies[id] for id in ids] for ids in spans[0]["follows"]]
    require(len(above) == 2 and all(body.pieces for body in both), "two bodies with pieces, and what they follow")
    shown, place, (inner, outer) = [], Row(both, spans[0]), check_slack(spans[0], both, above)
    if lower > (-math.inf if query["signed"] else 0):
        shown.append("lower by " + place.check_lower(spans[0]["lower"], Fraction(lower) + inner))
    if upper < math.inf:
        shown.append("upper by " + place.check_upper(spans[0]["upper"], Fraction(upper) - outer))
    return ", ".join(shown) or "no bound that says anything"
def verdicts(document):
    """Of each row, whether it is proved, and by what or why not. Raises one of MALFORMED for what is no certificate."""
    require((document["format"], document["version"]) == ("clearance certificate", 1), "another format or version")
    pieces = [Piece(piece) for piece in document["pieces"]]
    bodies = {body["id"]: Body(body, pieces) for body in document["bodies"]}
    require(len(bodies) == len(document["bodies"]), "a body stands twice")
    require(document["rows"], "there are no rows")
    for row in document["rows"]:
        try:
            yield True, check_row(row, bodies, document["query"])
        except MALFORMED as error:
            yield False, f"NOT PROVED: {error if isinstance(error, Wrong) else repr(error)}"
def check_file(path, say_all):
    with open(path, encoding="utf-8") as file:
        document = json.load(file, object_pairs_hook=no_repeats, parse_constant=lambda name: None)
    wrong = 0
    for place, (is_proved, why) in enumerate(verdicts(document)):
        wrong += not is_proved
        if say_all or not is_proved:
            print(f"{path}: rows[{place}]: {why}")
    print(f"{path}: {place + 1 - wrong} of {place + 1} rows are proved")
    return wrong == 0
def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("files", nargs="+", metavar="FILE")
    parser.add_argument("--all", action="store_true", help="say of every row what was shown")
    options, good = parser.parse_args(), True
    for path in options.files:
        try:
            good &= check_file(path, options.all)
        except (OSError, RecursionError, *MALFORMED) as error:
            print(f"{path}: no certificate: {error if isinstance(error, Wrong) else repr(error)}")
            good = False
    return 0 if good else 1
if __name__ == "__main__":
    sys.exit(main())
