"""try_pinocchio.py pink | placo: Pinocchio's models as scenes, and its distanceResults filled. Needs that package."""

import pathlib
import sys
import tempfile
import time

import numpy as np
import pinocchio as pin

import clearance
import clearance.pinocchio
import coal

RNG = np.random.default_rng(5)
AXIS = np.array([0, 0.6, 0.8])
JOINTS = {
    "unaligned": pin.JointModelRevoluteUnaligned(AXIS),
    "rz": pin.JointModelRZ(),
    "rub": pin.JointModelRUBX(),
    "py": pin.JointModelPY(),
    "slide": pin.JointModelPrismaticUnaligned(AXIS),
    "ball": pin.JointModelSpherical(),
    "after": pin.JointModelRY(),
    "planar": pin.JointModelPlanar(),
    "move": pin.JointModelTranslation(),
    "zyx": pin.JointModelSphericalZYX(),
    "free": pin.JointModelFreeFlyer(),
    "last": pin.JointModelRX(),
}
SHAPES = (
    coal.Sphere(0.05),
    coal.Box(0.1, 0.2, 0.05),
    coal.Capsule(0.04, 0.2),
    coal.Cylinder(0.06, 0.1),
    coal.Cone(0.1, 0.2),
)


def chain(joints=JOINTS, root=None):
    """A chain of joints with a shape on each, and two static shapes."""
    model, geometry = pin.Model(), pin.GeometryModel()
    names = list(joints)
    parent = 0
    if root is not None:
        parent = model.addJoint(0, root, pin.SE3.Identity(), "root")
    for name in names:
        placement = pin.SE3.Random()
        placement.translation *= 0.3
        parent = model.addJoint(parent, joints[name], placement, name)
    limits = RNG.uniform(1, 2, model.nq)
    model.lowerPositionLimit, model.upperPositionLimit = -limits, limits
    for i in range(model.njoints):
        for k in range(1 + (i == 0)):
            placement = pin.SE3.Random()
            placement.translation *= 0.4
            geometry.addGeometryObject(
                pin.GeometryObject(f"{model.names[i]}_{k}", i, placement, SHAPES[(i + k) % len(SHAPES)])
            )
    geometry.addAllCollisionPairs()
    return model, geometry


def configuration(model):
    return pin.randomConfiguration(model, -np.ones(model.nq), np.ones(model.nq))


def test_joints(root):
    """Objects are where Pinocchio has them, for all kinds of joints."""
    model, geometry = chain(root=root)
    data, placements = model.createData(), pin.GeometryData(geometry)
    world = clearance.from_pinocchio(geometry, model)
    ids = [world.engine.body_id(item.name) for item in geometry.geometryObjects]
    rows = []
    for _ in range(20):
        q = configuration(model)
        rows.append(q)
        world.set_state(q)
        pin.updateGeometryPlacements(model, data, geometry, placements, q)
        states = world.engine.body_states()
        for i, body in enumerate(ids):
            x, y, z, w, *xyz = states[body].pose
            ours = pin.SE3(pin.Quaternion(w, *xyz).toRotationMatrix(), np.array([x, y, z]))
            name = geometry.geometryObjects[i].name
            assert np.abs(ours.homogeneous - placements.oMg[i].homogeneous).max() < 1e-13, name
    enabled = {frozenset(pair) for pair in world.engine.pairs.tolist()}
    assert enabled == {frozenset((ids[p.first], ids[p.second])) for p in geometry.collisionPairs}
    r = world.engine.distances(configurations=world.configurations(rows), **world.moving)
    assert r.lower.shape == (20, len(enabled))
    assert np.allclose(r.lower[-1], world.engine.distances().lower[0], atol=1e-6)
    names = [name for name in world.moving["joints"] if "after" in name or "last" in name]
    assert names == ["pinocchio.ball/after", "pinocchio.free/last"], names


def test_unbounded():
    """An unbounded joint moves the shorter way, past half a turn."""
    model, geometry = chain({"rub": pin.JointModelRUBZ()})
    world = clearance.from_pinocchio(geometry, model)
    turn = world.configurations([[np.cos(a), np.sin(a)] for a in (3.1, -3.1, -2.9)])
    assert np.allclose(turn[:, 0], [3.1, 2 * np.pi - 3.1, 2 * np.pi - 2.9])


def test_motions():
    """Motions are the documented ones, and with the documented remedies those of pinocchio.interpolate()."""
    model, geometry = chain({"rub": pin.JointModelRUBZ()})
    world = clearance.from_pinocchio(geometry, model)
    first, last = (np.array([np.cos(a), np.sin(a)]) for a in (3.1, -3.1))
    middle = world.configurations(pin.interpolate(model, first, last, 0.5))[0, 0]
    together = world.configurations([first, last])
    assert np.isclose(np.mean(together), np.pi) and np.isclose(abs(middle), np.pi)
    motion = world.engine.motions(together[:1], together[1:], **world.moving)
    assert motion.lower.shape[0] == 1
    apart = np.mean([world.configurations(first), world.configurations(last)])
    assert np.isclose(apart, 0), "through 0: the documented trap"
    model, geometry = chain({"free": pin.JointModelFreeFlyer()})
    geometry.removeAllCollisionPairs()
    geometry.addCollisionPair(pin.CollisionPair(0, 2))
    world = clearance.from_pinocchio(geometry, model)
    first, last = pin.neutral(model), np.r_[1.0, 0, 0, 0, 0, 1, 0]  # half a turn meanwhile
    offs = []
    for count in (1, 64):
        shares = np.linspace(0, 1, count + 1)
        rows = [pin.interpolate(model, first, last, share) for share in shares]
        origins = world.configurations(rows)[:, 0, :3]
        true = [pin.interpolate(model, first, last, 0.5 * (a + b))[:3] for a, b in zip(shares, shares[1:])]
        offs.append(np.linalg.norm(0.5 * (origins[1:] + origins[:-1]) - true, axis=1).max())
    assert offs[0] > 0.3 and offs[1] < 1e-3, offs


def test_distances():
    """distanceResults are those of Pinocchio, but for its errors."""
    model, geometry = chain()
    data, theirs, ours = model.createData(), pin.GeometryData(geometry), pin.GeometryData(geometry)
    distances = clearance.pinocchio.Distances(geometry)
    apart = touching = 0
    for _ in range(20):
        q = configuration(model)
        distances.compute(model, data, ours, q)
        pin.computeDistances(model, data, geometry, theirs, q)
        for pair, mine, other in zip(geometry.collisionPairs, ours.distanceResults, theirs.distanceResults):
            if other.min_distance < 1e-4:
                touching += other.min_distance < -1e-4
                assert mine.min_distance < 2e-4
                continue
            apart += 1
            assert abs(mine.min_distance - other.min_distance) < 2e-5, (pair, mine.min_distance, other.min_distance)
            first, second = mine.getNearestPoint1(), mine.getNearestPoint2()
            assert abs(np.linalg.norm(second - first) - mine.min_distance) < 1e-5
            assert np.abs((second - first) / np.linalg.norm(second - first) - mine.normal).max() < 1e-2
            for point, index in ((first, pair.first), (second, pair.second)):
                local = ours.oMg[index].actInv(point)
                bead = coal.DistanceResult()
                coal.distance(
                    coal.Sphere(0.0), coal.Transform3s(np.eye(3), local), geometry.geometryObjects[index].geometry,
                    coal.Transform3s(), coal.DistanceRequest(), bead,
                )  # fmt: skip
                assert bead.min_distance < 1e-5, (pair, index, bead.min_distance)
    assert apart > 500 and touching > 0, (apart, touching)
    print(f"{apart} distances as Pinocchio's, to 2e-5 m, and {touching} overlaps")


def fails(call, *words):
    try:
        call()
    except (TypeError, ValueError) as error:
        assert all(word in str(error) for word in words), error
    else:
        raise AssertionError(f"expected an error with {words}")


def test_errors():
    model, geometry = chain({"rx": pin.JointModelRX()})
    composite = pin.JointModelComposite()
    composite.addJoint(pin.JointModelRX())
    composite.addJoint(pin.JointModelRY())
    fails(lambda: clearance.from_pinocchio(geometry, chain({"twist": composite})[0]), "'twist'", "Composite")
    world = clearance.from_pinocchio(geometry, model)
    fails(lambda: world.set_state([0, 0, 0]), "q: expected (1,)")
    other = chain({"rx": pin.JointModelRX(), "ry": pin.JointModelRY()})[1]
    fails(lambda: clearance.pinocchio.Distances(geometry).fill(pin.GeometryData(other)), "geometry_data", "pairs")
    bad = pin.GeometryData(geometry)
    for i in range(3):
        bad.oMg[i] = pin.SE3.Identity()
    bad.oMg[2] = pin.SE3(np.eye(3), np.full(3, np.nan))
    fails(lambda: clearance.pinocchio.Distances(geometry).fill(bad), "rx_0", "BAD_POSE")
    geometry.addCollisionPair(pin.CollisionPair(0, 1))
    fails(lambda: clearance.from_pinocchio(geometry, model), "'universe_0' and 'universe_1'", "static")


def test_pink():
    """pink's barrier keeps objects apart with our distances, where without it they overlap."""
    import pink
    import pink.barriers

    import clearance.pink

    model, geometry = pin.Model(), pin.GeometryModel()
    for i, axis in enumerate(("Z", "Y", "Z")):
        shift = pin.SE3(np.eye(3), np.array([0.3 if i == 2 else 0.0, 0, 0]))
        joint = model.addJoint(i, getattr(pin, f"JointModelR{axis}")(), shift, f"j{i}")
        model.addFrame(pin.Frame(f"f{i}", joint, 0, pin.SE3(np.eye(3), np.array([0.33, 0, 0])), pin.OP_FRAME))
    model.lowerPositionLimit, model.upperPositionLimit = np.full(3, -3.0), np.full(3, 3.0)
    model.velocityLimit = np.full(3, 2.0)
    lying = pin.SE3(pin.utils.rpyToMatrix(0, np.pi / 2, 0), np.array([0.17, 0, 0]))
    standing = pin.SE3(np.eye(3), np.array([0.42, 0.25, 0]))
    geometry.addGeometryObject(pin.GeometryObject("post", 0, standing, coal.Cylinder(0.05, 1)))
    geometry.addGeometryObject(pin.GeometryObject("upper", 2, lying, coal.Capsule(0.03, 0.2)))
    geometry.addGeometryObject(pin.GeometryObject("fore", 3, lying, coal.Capsule(0.025, 0.25)))
    geometry.addCollisionPair(pin.CollisionPair(0, 1))
    geometry.addCollisionPair(pin.CollisionPair(0, 2))
    distances = clearance.pinocchio.Distances(geometry)
    nearest = {}
    for guarded in (True, False):
        robot = clearance.pink.Configuration(
            model, model.createData(), np.zeros(3), collision_model=geometry, distances=distances
        )
        task = pink.tasks.FrameTask("f2", position_cost=1.0, orientation_cost=0.0)
        task.set_target(pin.SE3(np.eye(3), np.array([0.36, 0.36, 0.0])))
        barriers = [pink.barriers.SelfCollisionBarrier(2, gain=20.0, d_min=0.01)] if guarded else []
        still = pink.tasks.DampingTask(cost=1e-3)
        least = np.inf
        for _ in range(150):
            velocity = pink.solve_ik(robot, [task, still], 0.02, solver="daqp", barriers=barriers)
            robot.integrate_inplace(velocity, 0.02)
            least = min(least, *(result.min_distance for result in robot.collision_data.distanceResults))
        nearest[guarded] = least
    assert nearest[True] > 0.005 and nearest[False] < 0, nearest
    print(f"pink: nearest {1e3 * nearest[True]:.1f} mm with its barrier, {1e3 * nearest[False]:.1f} mm without")


URDF = """<robot name="arm"><link name="base"><collision><geometry><box size=".1 .1 .1"/></geometry></collision></link>
<link name="upper"><collision><origin xyz=".3 0 0"/><geometry><sphere radius=".05"/></geometry></collision>{mass}</link>
<link name="fore"><collision><origin xyz=".1 0 0"/><geometry><cylinder radius=".03" length=".2"/></geometry></collision>
{mass}</link><joint name="j" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 0 1"/>
{limit}</joint>
<joint name="k" type="revolute"><parent link="upper"/><child link="fore"/><origin xyz=".3 0 0"/><axis xyz="0 0 1"/>
{limit}</joint></robot>"""
MASS = '<inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>'
LIMIT = '<limit lower="-3" upper="3" effort="1" velocity="1"/>'


def test_placo():
    """A robot of placo, which has a floating base: its distances are within our intervals."""
    import placo

    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder) / "robot.urdf"
        path.write_text(URDF.format(mass=MASS, limit=LIMIT))
        robot = placo.RobotWrapper(str(path))
    world = clearance.from_pinocchio(robot.collision_model, robot.model)
    distances, filled = clearance.pinocchio.Distances(robot.collision_model), pin.GeometryData(robot.collision_model)
    for k in (0.0, 1.5, 2.8):
        robot.set_joint("j", k / 2)
        robot.set_joint("k", k)
        robot.update_kinematics()
        theirs = [row.min_distance for row in robot.distances()]
        world.set_state(robot.state.q)
        distances.compute(robot.model, robot.model.createData(), filled, robot.state.q)
        assert len(theirs) == 3 and np.allclose(world.engine.distances().lower[0], theirs, atol=1e-6)
        assert np.allclose([row.min_distance for row in filled.distanceResults], theirs, atol=1e-6)


def main():
    begin = time.monotonic()
    pin.seed(3)
    for root in (None, pin.JointModelFreeFlyer()):
        test_joints(root)
    test_unbounded()
    test_motions()
    test_distances()
    test_errors()
    {"pink": test_pink, "placo": test_placo}[sys.argv[1]]()
    print(f"Pinocchio {pin.__version__}: as it should be, in {time.monotonic() - begin:.1f} s")


if __name__ == "__main__":
    main()
