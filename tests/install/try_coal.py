"""try_coal.py: shapes of Coal and a model of Pinocchio as Clearance bodies, with equal distances. Needs both."""

import numpy as np
import pinocchio

import clearance
import coal

RNG = np.random.default_rng(3)


def convex():
    points = coal.StdVec_Vec3s()
    for row in RNG.normal(scale=0.3, size=(40, 3)):
        points.append(row)
    return coal.Convex.convexHull(points, True, None)


def mesh():
    """A box of triangles, which is its own hull."""
    model = coal.BVHModelOBBRSS()
    box = np.array(np.meshgrid([-0.2, 0.2], [-0.3, 0.3], [-0.4, 0.4])).reshape(3, -1).T
    points = coal.StdVec_Vec3s()
    for row in box:
        points.append(row)
    model.beginModel(12, 8)
    for a, b, c in ((0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1), (2, 3, 7), (2, 7, 6), (0, 2, 6),
                    (0, 6, 4), (1, 5, 7), (1, 7, 3)):  # fmt: skip
        model.addTriangle(points[a], points[b], points[c])
    model.endModel()
    return model


def swept():
    capsule = coal.Capsule(0.1, 0.5)
    capsule.setSweptSphereRadius(0.05)
    return capsule


SHAPES = {
    "box": coal.Box(0.4, 0.6, 0.2),
    "sphere": coal.Sphere(0.25),
    "capsule": coal.Capsule(0.1, 0.5),
    "cylinder": coal.Cylinder(0.15, 0.4),
    "cone": coal.Cone(0.2, 0.5),
    "ellipsoid": coal.Ellipsoid(0.1, 0.2, 0.3),
    "swept": swept(),
    "convex": convex(),
    "mesh": mesh(),
}


def coal_distance(a, X_a, b, X_b):
    transforms = [coal.Transform3s(X[:3, :3], X[:3, 3]) for X in (X_a, X_b)]
    request, result = coal.DistanceRequest(), coal.DistanceResult()
    return coal.distance(a, transforms[0], b, transforms[1], request, result)


def test_distances():
    scene = clearance.Scene()
    for name, shape in SHAPES.items():
        scene.add_body(name, **clearance.from_coal(shape))
    engine = clearance.Engine(scene)
    apart = dict.fromkeys(SHAPES, 0)
    for _ in range(20):
        poses = {}
        for name in SHAPES:
            motion = pinocchio.SE3.Random()
            motion.translation = RNG.uniform(-2, 2, 3)
            poses[name] = motion.homogeneous
        engine.set_poses(poses)
        answer = engine.distances()
        names = list(SHAPES)
        for (a, b), lower, upper in zip(answer.pairs, answer.lower[0], answer.upper[0]):
            if {names[a], names[b]} == {"mesh", "swept"}:  # Coal's error: "Swept-sphere radius not yet supported"
                continue
            theirs = coal_distance(SHAPES[names[a]], poses[names[a]], SHAPES[names[b]], poses[names[b]])
            if theirs > 0.01:
                apart[names[a]] += 1
                apart[names[b]] += 1
                assert lower - 1e-5 <= theirs <= upper + 1e-5, (names[a], names[b], lower, theirs, upper)
    assert min(apart.values()) > 100, apart  # of each shape
    print(f"{sum(apart.values()) // 2} pairs: Coal's distance lies in the interval, to 1e-5 m")


def test_refusals():
    for shape in (coal.Plane(), coal.Halfspace()):
        try:
            clearance.from_coal(shape)
        except TypeError as error:
            assert type(shape).__name__ in str(error)
        else:
            raise AssertionError(f"{shape} has a counterpart")


def test_pinocchio():
    model = pinocchio.GeometryModel()
    for name, shape in SHAPES.items():
        model.addGeometryObject(pinocchio.GeometryObject(name, 0, pinocchio.SE3.Identity(), shape))
    model.addCollisionPair(pinocchio.CollisionPair(0, 1))
    model.addCollisionPair(pinocchio.CollisionPair(1, 3))
    scene = clearance.from_pinocchio(model)
    assert [body.name for body in scene.bodies] == list(SHAPES)
    assert clearance.Engine(scene).pairs.tolist() == [[0, 1], [1, 3]]
    model.addGeometryObject(pinocchio.GeometryObject("floor", 0, pinocchio.SE3.Identity(), coal.Halfspace()))
    try:
        clearance.from_pinocchio(model)
    except TypeError as error:
        assert str(error).startswith("floor: geometry: Halfspace"), error
    else:
        raise AssertionError("a half-space has a counterpart")


pinocchio.seed(3)
test_distances()
test_refusals()
test_pinocchio()
print("Coal and Pinocchio: as it should be")
