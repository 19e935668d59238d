#!/usr/bin/env python3
"""Checks certificates of Clearance (docs/trust/certificate_format.md) in exact arithmetic, with Python 3.9 alone.
check_certificate.py [--all] FILE... prints why rows fail, and other rows' proofs. Exit code 0 if all are proved."""
import functools
import json
import math
import sys
from fractions import Fraction

RAYS = [((3, -5, 8), (732, 481, -483)), ((-7, 2, 2), (-377, 618, 691)), ((2, 7, -4), (127, -911, 392)),
        ((-5, -4, -6), (-802, -223, -554))]  # points near the origin, and rays from them: one must miss all edges
ONE = 1 << 320  # 1 / ONE is the rounding of numbers if bodies follow others, or are between two poses
BLUR, LARGEST = Fraction(1, 1 << 150), 1 << 64  # metres: bound on it, if no body is as large or as far away
WORLD = ZERO, AXES, _ = (0, 0, 0), ((1, 0, 0), (0, 1, 0), (0, 0, 1)), 0  # a pose: origin, rotation's rows, error bound
SIDES = (0, 0), (1, 0), (0, 1), (1, 1)  # before and after a time, at a progress of 0 and 1
MALFORMED = (LookupError, TypeError, ValueError, AttributeError, ArithmeticError, RecursionError)
def require(condition, why, value=None):
    if not condition:
        raise ValueError(why)
    return value
def real(x): return require(type(x) in (int, float) or x in ("inf", "-inf"), f"{x!r} is no number", float(x))
def exact(x): return Fraction(real(x))
def length(x): return require(exact(x) >= 0, f"{x} is no length", exact(x))
def several(x, n): return require(x is None or (type(x) is list and len(x) == n), "no list of it", x or [None] * n)
def high_and_low(x): return sum(map(exact, several(x, 2)))
def vector(v, read=exact): return tuple(map(read, several(v, 3)))
def at(items, k, what): return items[require(type(k) is int and 0 <= k < len(items), f"no {what} {k!r}", k)]
def run(named, count):  # range of parts: one, [begin, end), or all for None
    begin, end = (0, count) if named is None else named if type(named) is list else (named, named + 1)
    return require(type(begin) is type(end) is int and 0 <= begin < end <= count, f"no pieces {named!r}", (begin, end))
def no_repeats(pairs): return require(len(dict(pairs)) == len(pairs), "a name stands twice in one object", dict(pairs))
def dot(u, v): return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]
def cross(u, v): return (u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0])
def plus(u, v, factor=1): return tuple(x + factor * y for x, y in zip(u, v))
def times(factor, v): return tuple(factor * x for x in v)
def turned(rows, v): return tuple(dot(row, v) for row in rows)  # inverse: turned(zip(*rows), v)
def near(*v): return tuple(Fraction(x.numerator * ONE // x.denominator, ONE) for x in v)
def integers(vectors):  # the vectors times a common factor that makes all coordinates integers; and the factor
    scale = math.lcm(*(x.denominator for v in vectors for x in v))
    return [tuple(int(x * scale) for x in v) for v in vectors], scale
def size(v):  # upper bound on |v|, at most 2^-320 of it larger
    x = Fraction(dot(v, v))
    return Fraction(math.isqrt(x.numerator * x.denominator << 640) + 1, x.denominator << 320) if x else x
def turn_about(axis, angle):  # cosine and sine of a half of 2^-200 of it, in two terms and one, are doubled 200 times
    require(abs(angle) < 1 << 21, "an angle is too large")
    one, s = ONE * ONE, angle.numerator * ONE * ONE // (angle.denominator << 201)
    c = one - s * s // (2 * one)
    for _ in range(200):
        c, s = (c * c - s * s) // one, 2 * c * s // one
    return ZERO, tuple(near(*row) for row in pose_of(*ZERO, c, *times(s, axis))[1]), BLUR
def pose_of(x, y, z, a, b, c, d):  # of a quaternion of any length: M(q) / |q|^2
    s = Fraction(a * a + b * b + c * c + d * d)
    rows = ((a * a + b * b - c * c - d * d, 2 * (b * c - a * d), 2 * (b * d + a * c)),
            (2 * (b * c + a * d), a * a + c * c - b * b - d * d, 2 * (c * d - a * b)),
            (2 * (b * d - a * c), 2 * (c * d + a * b), a * a + d * d - b * b - c * c))
    return (x, y, z), tuple(times(1 / s, row) for row in rows), 0
def turn_between(a, u, w, v):  # of quaternions (a, u), (w, v): the axis, of length 1 before the turn, and the angle
    cosine, way = a * w + dot(u, v), plus(plus(times(a, v), cross(v, u)), u, -w)
    if not any(way):
        return ZERO, Fraction(0)
    axis, sine, cosine = times((1 if cosine >= 0 else -1) / size(way), way), size(way), abs(cosine)
    sine, cosine = near(*times(1 / size((sine, cosine, 0)), (sine, cosine)))
    for _ in range(120):  # half the angle
        cosine, = near(cosine + size((cosine, sine, 0)))
    return near(*axis), near(sine / cosine * (1 << 121))[0]
def polar(points, times):  # polar form of a Bezier curve
    return functools.reduce(lambda p, t: [x + t * (y - x) for x, y in zip(p, p[1:])], times, points)[0]
def place(points, time): return polar(points, [time] * (len(points) - 1))
@functools.lru_cache(1 << 16)
def ways(p, time, end):  # control points of a curve from a time until another, less its place at the former
    return [polar(p, [time] * (len(p) - 1 - k) + [end] * k) - place(p, time) for k in range(len(p))]
def bounds_of(way, progress):  # on the lengths of vectors, of the last, and of what its share of the progress leaves
    return max(map(size, way)), size(way[-1]), max(size(plus(p, way[-1], -r)) for p, r in zip(way, progress))
class Piece:
    def __init__(self, document, whole=None):
        core = document.get("core", {"kind": None, "size": [1, 1, 1]})  # if missing, the hull of the vertices
        self.radius, self.kind, self.size = length(document["radius"]), core["kind"], vector(core["size"], length)
        require(self.kind in (None, "cone", "cylinder", "ellipsoid", "half_space"), f"no core: {core!r}")
        self.vertices = [vector(v) for v in document["vertices"]]
        require(len(self.vertices) == document["count"] > 0, "a piece has another number of vertices than it states")
        elements, given, self.solid = document.get("elements", ()), "elements" in document, document.get("solid", False)
        parts = [Piece({"radius": document["radius"], "count": len(element), "vertices": [  # parts in its place
            at(document["vertices"], k, "vertex") for k in element]}, self) for element in elements]
        require(bool(self.solid) <= bool(parts) == given <= (not self.kind), "elements are missing, or those of a core")
        (self.numbers, self.scale), self.parts = integers(self.vertices), parts or [self]
        self.faces = closed(elements) if self.solid else elements
        later = set().union(*(set(face) - {min(face)} for face in self.faces or [range(len(self.vertices))]))
        self.seeds = [ZERO] if self.kind else [v for k, v in enumerate(self.vertices) if k not in later]  # of each part
        self.box, self.whole = [(min(x), max(x)) for x in zip(*self.vertices)], whole
    def reach(self, centre):  # upper bound on the distance of its points
        (x, y, z), farthest = self.size, max((plus(v, centre, -1) for v in self.vertices), key=lambda d: dot(d, d))
        around = size(centre) + (max(x, y, z) if self.kind == "ellipsoid" else size((x, 0, z)))
        return math.inf if self.kind == "half_space" else self.radius + (around if self.kind else size(farthest))
    def support(self, n):  # upper bound of n.v for all its points v; the maximum for vertices without radius
        if not self.kind:
            (m,), scale = integers([n])
            return Fraction(max(dot(m, v) for v in self.numbers), scale * self.scale) + self.radius * size(n)
        rim, along = self.size[0] * size((n[0], n[1], 0)), self.size[2] * n[2]
        egg, flat = size([s * x for s, x in zip(self.size, n)]), 0 if n[0] == n[1] == 0 < n[2] else math.inf
        cores = {"cylinder": rim + abs(along), "cone": max(along, rim - along), "ellipsoid": egg, "half_space": flat}
        return cores[self.kind] + self.radius * size(n)
    def off(self, p):  # upper bound on a point's distance from the core
        if self.kind in ("ellipsoid", "half_space"):  # p / scale is in the core for an ellipsoid
            return (size(tuple(x / s for s, x in zip(self.size, p))) - 1) * size(p) if self.kind[0] == "e" else p[2]
        half = require(abs(p[2]) <= self.size[2], "a point lies beyond the ends of its core", self.size[2])
        return size((p[0], p[1], 0)) - (1 if self.kind == "cylinder" else (half - p[2]) / (2 * half)) * self.size[0]
class Body:
    def __init__(self, document, pieces):
        self.on, self.joint, self.pose, self.moves = (document[key] for key in ("on", "joint", "pose", "moves"))
        self.wholes, centre = [at(pieces, k, "piece") for k in document["pieces"]], vector(document["centre"])
        self.pieces = [part for whole in self.wholes for part in whole.parts]
        self.inner, self.outer = (length(document["shape"][key]) for key in ("inner", "outer"))
        self.position, turn = (length(document["uncertainty"][key]) for key in ("position", "angle"))
        self.chord = turn and (2 if turn >= math.pi else BLUR + size(plus(turn_about(AXES[2], turn)[1][0], (-1, 0, 0))))
        self.name, self.moved = document["name"], length(document["max_speed"]) * length(document["age_s"])
        self.reach, radius = (max([p.reach(c) for p in self.wholes], default=0) + self.inner for c in (ZERO, centre))
        self.ball, grown = (centre, radius), length(document["padding"]) + self.position
        require(all(p.radius + self.inner >= grown for p in self.pieces), f"{self.name!r} lacks padding or uncertainty")
class Motion:  # bodies between the two ends of a configuration, at times in [0, 1]; or at its only end
    def __init__(self, bodies, document, count):
        self.bodies, self.seen, self.poses, self.positions = bodies, {}, document["poses"], document["positions"]
        require(all(key == str(int(key)) for key in (*self.poses, *self.positions)), "whose end is it")
        points = {*map(len, self.positions.values()), *map(len, self.poses.values())} or {count}  # of each curve
        require(len(points) == 1 and count <= min(points) <= 8 ** (count - 1), "a control point is missing")
        self.late, self.still = [0] * (min(points) - 1) + [1], [[ZERO] * min(points)] * 2
    def steps(self, id, time):  # each in the previous: (pose, axis, curve along or about it, whether it turns)
        if str(id) in self.poses:
            given = self.poses[str(id)]  # an eighth number is its growth
            points = [tuple(map(exact, several(pose, 7 + (len(given[0]) == 8))))[:7] for pose in given]
            (*t, a, b, c, d), (*t1, w, x, y, z) = points[0], points[-1]
            if len(points) > 2:
                require(len({point[3:] for point in points}) == 1, "a body turns along a curve")
                for axis, curve in zip(AXES, zip(*points)):
                    yield (times(place(curve, time), axis), AXES, BLUR), axis, curve, False
                return (yield pose_of(*ZERO, a, b, c, d), ZERO, (0,), False)
            axis, angle = turn_between(a, (b, c, d), w, (x, y, z))
            yield pose_of(*(*plus(t, plus(t1, t, -1), time), a, b, c, d)), plus(t1, t, -1), (0, 1), False
            yield from [(turn_about(axis, time * angle), axis, (0, angle), True)] if angle else []
            return
        yield pose_of(*map(exact, self.bodies[id].pose)), ZERO, (0,), False
        for move in self.bodies[id].moves:
            axis, ends = vector(move["axis"]), self.positions.get(str(move["column"])) or [move["stands"]]
            curve = tuple(exact(move["multiplier"]) * exact(x) + exact(move["offset"]) for x in ends)
            axis, now = near(*times(1 / size(axis), axis)), place(curve, time)
            pose = turn_about(axis, now) if move["turns"] else (times(now, axis), AXES, BLUR)
            yield pose, axis, curve, bool(move["turns"])
    def at(self, id, time):  # its pose, and its movers from the world on: (axis, point, whether it rotates, curve)
        if (id, time) not in self.seen:
            X, movers = (WORLD, []) if self.bodies[id].on is None else self.at(self.bodies[id].on, time)
            for (t, rows, blur), axis, curve, turns in self.steps(id, time):
                o, R, _ = X
                X = (t, rows, blur) if X is WORLD else (
                    near(*plus(o, turned(R, t))), tuple(near(*turned(zip(*rows), row)) for row in R), BLUR)
                moves = any(axis) and len(set(curve)) > 1
                movers = movers + [(near(*turned(R, axis)), X[0], turns, curve)] if moves else movers
            require(max(*map(abs, X[0]), self.bodies[id].reach) < LARGEST or not X[2], "a body is too large or far")
            self.seen[id, time] = X, movers
        return self.seen[id, time]
    def path(self, seer, id, time):  # movers of a body relative to another one (of the world if None)
        mine, his = self.at(id, time)[1], self.at(seer, time)[1] if seer is not None else []
        shared = sum(x is y for x, y in zip(mine, his))
        return [(times(-1, axis), *more) for axis, *more in reversed(his[shared:])] + mine[shared:]
    def rates(self, seer, id, time, sides):  # bounds on a point's way from its place, and for each side on its distance
        (centre, rest), (o, R, _), movers = self.bodies[id].ball, self.at(id, time)[0], []  # from a uniform motion
        slid, arms = self.still, [plus(o, turned(R, centre))]  # arms lead from the point of the next turn
        for axis, point, turns, curve in [*reversed(self.path(seer, id, time)), (ZERO, ZERO, True, (0,))]:
            hulls = [ways(curve, time, end) for end, _ in sides]
            own = [[times(x, axis) for x in hull] for hull in hulls]
            if not turns:  # slides without a turn between are one; they lead anywhere
                slid = [[*map(plus, u, v)] for u, v in zip(slid, own)]
                arms = [plus(v, axis, f(map(f, hulls))) for v in arms for f in (min, max)]
                require(len(arms) <= 4096, "too many joints slide")
                continue
            arms, reach = [plus(v, point, -1) for v in arms], size(axis)
            reach = reach and reach * rest + max(size(cross(axis, v)) for v in arms)  # its rest may be infinite
            movers, rest = [*movers, (1, 0, slid), (reach, size(axis), own)], rest + max(map(size, arms))
            slid, arms = self.still, [point]
        way, bends = 0, [[0, 0], [0, 0]]
        for k, share in SIDES:
            found, turning = [(*x, *bounds_of(hulls[k], sides[k][1])) for *x, hulls in movers], 0
            way = max(way, sum(reach * farthest for reach, _, farthest, *_ in found))
            for reach, turn, _, last, more in reversed(found):  # from the seer on: joints turn those behind them
                bends[k][share] += reach * (more + (share * last + more) * (turn * (share * last + more) / 2 + turning))
                turning += turn * (share * last + more)
        return way, bends
    def growth(self, id, time, sides):  # metres: at a time, bound on its change, for each side its last and rest
        curve = tuple(length(pose[7]) for pose in self.poses.get(str(id), ()) if len(pose) == 8) or (Fraction(0),)
        grown = [(ways(curve, time, end), progress) for end, progress in sides]
        rests = [(way[-1], max(x - r * way[-1] for x, r in zip(way, progress))) for way, progress in grown]
        return place(curve, time), max(max(way) for way, _ in grown), rests
    def frames(self, id):  # the bodies that it follows, outermost first, without other links of its robot
        on, joint = self.bodies[id].on, self.bodies[id].joint
        while joint and self.bodies[on].joint:
            on = self.bodies[on].on
        return [] if on is None else [*self.frames(on), on]
    def slack(self, id, frames, time, sides):  # metres: inner slack in the middle of a span, and throughout it
        shift, turn, along, body = 0, 0, 0, self.bodies[id]
        for frame, next_ in zip(frames, [*frames[1:], id]):
            own = self.bodies[frame].position + self.bodies[frame].moved
            shift, turn = shift + own + turn * (along + own), turn + self.bodies[frame].chord
            along = size(plus(self.at(next_, time)[0][0], self.at(frame, time)[0][0], -1))
        known = body.inner + body.moved + shift + (body.chord and body.chord * body.reach)
        known += turn and turn * (along + body.moved + body.reach)
        return known, known + (turn and turn * self.rates(None, id, time, sides)[0])
    def check_span(self, ids, span, bound):
        begin, middle, end, rates = *(exact(span[key]) for key in ("begin", "at", "end")), {}
        sides = [(t, [*map(exact, r or self.late)]) for t, r in zip((begin, end), several(span.get("progress"), 2))]
        require(all(len(r) == len(self.late) and 0 <= min(r) <= max(r) <= 1 for _, r in sides), "it is no progress")
        (t_a, R_a, blur_a), (t_b, R_b, blur_b) = (self.at(id, middle)[0] for id in ids)  # first: it detects cycles
        a, b, *frames = *(self.bodies[id] for id in ids), *map(self.frames, ids)
        require(begin <= middle <= end and a.pieces and b.pieces, "a time beyond the ends, or a body without pieces")
        shared = sum(x == y for x, y in zip(*frames))  # common carriers move neither body relative to the other
        known, inner = map(sum, zip(*(self.slack(id, f[shared:], middle, sides) for id, f in zip(ids, frames))))
        require(sum(length(term["inner"]) for term in span["slack"]["terms"]) >= known, "slack is too little")
        growths, counts = [self.growth(id, middle, sides) for id in ids], (len(a.pieces), len(b.pieces))
        cover = [list(map(run, several(claim["pieces"], 2), counts)) for claim in span["lower"]]
        for claim, ((i, i_end), (j, j_end)) in zip(span["lower"], cover):  # directions are from a towards b
            named, seer, moves = claim["direction"], claim["seer"], {1: False, 2: True}[claim["order"]]
            n = times(-1, turned(R_b, AXES[2])) if named is None else turned(R_a, vector(named, high_and_low))
            rates[seer] = rates.get(seer) or [self.rates(seer, id, middle, sides) for id in ids]
            for k, share in SIDES[2 * (len(self.late) < 3):] if moves else SIDES[:1]:  # the gap is concave in between
                need = bound + blur_a + blur_b + inner + sum(grown for grown, *_ in growths)
                for (way, bends), (_, swells, rests) in zip(rates[seer], growths):
                    need += bends[k][share] + share * rests[k][0] + rests[k][1] if moves else way + swells
                (n_a, to_a), (n_b, to_b) = (self.lean(seer, id, middle, sides[k][0], n, share) for id in ids)
                gap = dot(n_b, t_b) + to_b - dot(n_a, t_a) - to_a
                n_a, n_b = turned(zip(*R_a), n_a), times(-1, turned(zip(*R_b), n_b))
                gap -= max(p.support(n_a) for p in a.pieces[i:i_end]) + max(p.support(n_b) for p in b.pieces[j:j_end])
                require(any(n) and gap >= need * size(n) * (1 if need > 0 else 1 - BLUR),
                        f"pieces {i} and {j} of {a.name!r} and {b.name!r} are not {float(need)!r} m apart")
        for place in {0, *(end for (_, end), _ in cover if end < counts[0])}:  # coverage changes where a range ends
            done = 0
            for begin_b, end_b in sorted(of_b for (first, end), of_b in cover if first <= place < end):
                done = max(done, end_b) if begin_b <= done else done
            require(done == counts[1], f"no direction for piece {place} of {a.name!r}, and {done} of {b.name!r}")
        for held, t_h, R_h, holder, t, R in ((a, t_a, R_a, b, t_b, R_b), (b, t_b, R_b, a, t_a, R_a)):
            for solid, seed in ((x, p) for x in holder.wholes if x.solid for y in held.wholes for p in y.seeds):
                p = turned(zip(*R), plus(plus(turned(R_h, seed), t_h), t, -1))
                beside = bound <= 0 or any(x < low or x > high for (low, high), x in zip(solid.box, p))
                require(beside or turns_around([plus(v, p, -1) for v in solid.vertices], solid.faces, bound**2) == 0,
                        f"a part of {held.name!r} is within {holder.name!r}")
        require(bound > 0 or len(cover) == 1 or a.pieces + b.pieces == a.wholes + b.wholes, "a depth of surfaces")
        return begin, end
    def lean(self, seer, id, time, end, n, share):  # upper bound on n.x for points x after a share of a uniform motion
        path = [(times(share * ways(c, time, end)[-1], axis), *more) for axis, *more, c in self.path(seer, id, time)]
        turn = tuple(map(sum, zip(ZERO, *(rate for rate, _, turns in path if turns))))
        return plus(n, cross(n, turn)), sum(dot(n, cross(p, v) if turns else v) for v, p, turns in path)
    def check_upper(self, ids, claim, bound):
        time, (i, j), (a, b) = exact(claim["time"]), claim["pieces"], (self.bodies[id] for id in ids)
        (t_a, R_a, blur_a), (t_b, R_b, blur_b) = (self.at(id, time)[0] for id in ids)
        cores, named = (at(a.pieces, i, "piece"), at(b.pieces, j, "piece")), []
        reach = bound - a.outer - b.outer - blur_a - blur_b + sum(self.growth(id, time, [(time, [0])])[0] for id in ids)
        for core, found in zip(cores, several(claim.get("points"), 2)):  # for a core in closed form, points near it
            named.append([vector(p, high_and_low) for p in found] if core.kind else core.vertices)
            reach += core.radius - (max(0, *map(core.off, named[-1])) if core.kind else 0)
        if "within" in claim:  # a vertex in a solid, whose surface encloses the origin as seen from it
            whole, side, [[k, m]] = at(cores, claim["within"], "side").whole, claim["within"], claim["vertices"]
            named[side], all_ = require(whole.solid is True, "no solid", whole.vertices), range(len(whole.vertices))
            claim = {**claim, "faces": whole.faces, "vertices": [((x, m), (k, x))[side] for x in all_]}
        pairs = [(at(named[0], k, "vertex"), at(named[1], m, "vertex")) for k, m in claim["vertices"]]
        points = [plus(u, turned(zip(*R_a), plus(plus(turned(R_b, v), t_b), t_a, -1)), -1) for u, v in pairs]  # a - b
        require(0 <= time <= 1 and (not blur_a + blur_b or max(map(size, points)) < LARGEST), "no time, or too far off")
        if "faces" in claim:
            return check_surface(claim, points, -reach)
        weights = [high_and_low(w) for w in claim["weights"]]
        require(len(weights) == len(points) and min(weights) >= 0 and sum(weights) > 0, "weights are none")
        apart = [sum(w * v[k] for w, v in zip(weights, points)) / sum(weights) for k in range(3)]
        up = [n for c, n in zip(cores, ((0, 0, -1), turned(zip(*R_a), turned(R_b, AXES[2])))) if c.kind == "half_space"]
        require((reach >= 0 and dot(apart, apart) <= reach * reach) or any(dot(apart, n) <= reach for n in up),
                "the witness points are farther apart than upper")
def check_surface(claim, points, depth):  # it encloses a ball around the origin: cores overlap by the ball's radius
    faces, normals = closed(claim["faces"]), [vector(m, high_and_low) for m in claim["normals"]]
    beyond = [(min(dot(m, at(points, k, "vertex")) for k in face), m) for face, m in zip(faces, normals)]
    require(len(faces) == len(normals) > 0 and all(d > 0 and d >= depth * size(m) for d, m in beyond), "a face is near")
    require(turns_around(points, faces, min(d * d / dot(m, m) for d, m in beyond)) != 0, "it is not around the origin")
def edges(faces): return sorted((f[k - 1], f[k]) for f in faces for k in range(len(several(f, 3))))
def closed(faces): return require(edges(faces) == edges([f[::-1] for f in faces]), "the surface has a border", faces)
def turns_around(points, faces, least):  # winding number; rays begin within sqrt(least), which no face is
    numbers, scale = integers(points)
    while least * scale * scale <= max(dot(o, o) for o, _ in RAYS):
        numbers, scale = [times(1 << 64, w) for w in numbers], scale << 64
    for o, g in RAYS:
        q = [plus(w, o, -1) for w in numbers]
        signs = [[dot(g, cross(q[u], q[v])) for u, v in ((i, j), (j, k), (k, i))] + [dot(q[i], cross(q[j], q[k]))]
                 for i, j, k in faces if i != j != k != i]
        if not any(0 in sides[:3] and not min(sides[:3]) < 0 < max(sides[:3]) for sides in signs):  # else another ray
            return sum(min(sides) > 0 for sides in signs) - sum(max(sides) <= 0 for sides in signs)
    raise ValueError("every ray meets an edge of the surface")
def check_row(row, motions, query):
    status, lower, upper, pairs = row["status"], real(row["lower"]), real(row["upper"]), row["pairs"]
    first = row["first_contact"] or {"free_until": 0, "hit_at": "inf", "witness": None}
    free, hit = real(first["free_until"]), real(first["hit_at"])
    require(row["proved"] is True and (0 <= free <= 1 or free == math.inf), "the engine found no proof")
    if status in ("bad_pose", "no_pose", "stale_pose", "unknown_body"):
        return require((-lower, upper, hit, free, pairs) == (*[math.inf] * 3, 0, []), "it claims", "claims nothing")
    signed, decides = query["signed_distance"] is not False, query["reduce"] == "any"
    own = [real(pair["margin"]) for pair in pairs if pair["bodies"] == row["bodies"]]
    require(pairs and (len(own) == len(pairs) == 1 or (query["motions"] and query["reduce"] != "none")), "not its pair")
    cut = min(real(pair["margin"]) for pair in pairs) if decides else real(query["max_distance"])
    fits = {"ok": 0 < lower and (upper < math.inf if decides else lower <= cut), "overlap": upper <= 0,
            "contact": lower <= 0 <= upper < math.inf, "beyond": lower > cut, "unconverged": True}
    require(lower <= upper and (signed or upper >= 0) and fits.get(status), f"[{lower!r}, {upper!r}] is not {status!r}")
    bounded, motion = lower > (-math.inf if signed else 0), motions[row["configuration"]]
    for pair in pairs:
        whole, margin = real(pair["lower"]) if bounded else -math.inf, real(pair["margin"])
        kept = not bounded or lower <= whole > (margin if decides and status == "beyond" else -math.inf)
        early = pair["free"] is not None or (free > 0 and not whole > margin)  # otherwise beyond it throughout
        require(kept and not (early and real(pair["free"]["lower"]) <= margin), "a pair may be nearer than claimed")
        for proof, until in [(pair, 1)] * bounded + ([(pair["free"], min(free, 1))] if early else []):
            ends = sorted(motion.check_span(pair["bodies"], span, exact(proof["lower"])) for span in proof["spans"])
            require(ends and [0, *(e for _, e in ends)] == [*(b for b, _ in ends), until], "spans leave a gap")
    if upper < math.inf:
        require(len(own) == 1 and (status == "unconverged" or not decides or [upper] <= own), "beyond its margin")
        motion.check_upper(row["bodies"], row["witness"], exact(upper))
    if hit < math.inf or first["witness"] is not None:
        [margin] = [exact(pair["margin"]) for pair in pairs if pair["bodies"] == first["bodies"]]
        require(exact(first["witness"]["time"]) == exact(hit), "the witness of first contact is at another time")
        motion.check_upper(first["bodies"], first["witness"], margin)
    return f"proved by spans of {len(pairs)} pair(s), and by {(upper < math.inf) + (hit < math.inf)} witness(es)"
def verdicts(document):  # for each row, whether it is proved, and the proof or the failure; may raise one of MALFORMED
    require((document["format"], document["version"]) == ("clearance certificate", 3), "another format or version")
    pieces, ends = list(map(Piece, document["pieces"])), {False: 1, True: 2}[document["query"]["motions"]]
    bodies = no_repeats([(body["id"], Body(body, pieces)) for body in document["bodies"]])
    motions = no_repeats([(x["configuration"], Motion(bodies, x, ends)) for x in document["configurations"]])
    for row in document["rows"]:
        try:
            yield True, check_row(row, motions, document["query"])
        except MALFORMED as error:
            yield False, f"NOT PROVED: {error if isinstance(error, ValueError) else repr(error)}"
def check_file(path, say_all):
    try:
        with open(path, encoding="utf-8") as file:
            found = list(verdicts(json.load(file, object_pairs_hook=no_repeats, parse_constant=lambda name: None)))
    except (OSError, *MALFORMED) as error:
        return print(f"{path}: no certificate: {error if isinstance(error, ValueError) else repr(error)}")
    said = [f"{path}: rows[{k}]: {why}" for k, (is_proved, why) in enumerate(found) if say_all or not is_proved]
    print(*said, f"{path}: {sum(is_proved for is_proved, _ in found)} of {len(found)} rows are proved", sep="\n")
    return all(is_proved for is_proved, _ in found)
if __name__ == "__main__":
    sys.exit({check_file(path, "--all" in sys.argv) for path in sys.argv[1:] if path != "--all"} != {True})
