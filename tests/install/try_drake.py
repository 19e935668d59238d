"""try_drake.py: a checker with the names of Drake's, and the answers of Drake's where those are right. Needs drake."""

import functools
import time

import numpy as np
from pydrake.geometry import Box, GeometryInstance, HalfSpace, ProximityProperties, Sphere
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.plant import CoulombFriction
from pydrake.multibody.tree import (
    BallRpyJoint,
    FixedOffsetFrame,
    PlanarJoint,
    PrismaticJoint,
    RevoluteJoint,
    RpyFloatingJoint,
    SpatialInertia,
    UniversalJoint,
    WeldJoint,
)
from pydrake.planning import RobotDiagramBuilder, SceneGraphCollisionChecker

import clearance
import clearance.drake

RNG = np.random.default_rng(8)
ARM = """<robot name="arm"><link name="base"><collision><geometry><box size=".1 .1 .1"/></geometry></collision></link>
{links}</robot>"""
LINK = """<link name="l{i}"><collision name="c"><origin xyz=".15 0 0" rpy="0 1.5707963 0"/><geometry>
<{shape} radius=".03" length=".2"/></geometry></collision></link><joint name="j{i}" type="{kind}">
<parent link="{parent}"/><child link="l{i}"/><origin xyz="{x} 0 .02" rpy=".1 0 0"/><axis xyz="{axis}"/>
<limit lower="-2.5" upper="2.5" effort="1" velocity="1"/></joint>"""
WORLD = """<robot name="things"><link name="shelf"><collision><geometry><box size=".4 .4 .02"/></geometry></collision>
<collision name="post"><origin xyz=".1 .2 .3"/><geometry><cylinder radius=".03" length=".5"/></geometry></collision>
</link><link name="ball"><collision><geometry><sphere radius=".08"/></geometry></collision></link></robot>"""


def offset():
    return RigidTransform(RollPitchYaw(*RNG.uniform(-1, 1, 3)), RNG.uniform(-0.2, 0.2, 3))


def arm(kinds=("revolute", "continuous", "prismatic", "revolute")):
    shapes, axes = ("cylinder", "drake:capsule"), ("0 0 1", "0 1 0", "1 0 0", "0 .6 .8")
    links = [
        LINK.format(
            i=i, kind=kind, shape=shapes[i % 2], parent=f"l{i - 1}" if i else "base", x=0.3 if i else 0, axis=axes[i]
        )
        for i, kind in enumerate(kinds)
    ]
    return ARM.format(links="".join(links)).replace("<robot", '<robot xmlns:drake="http://drake.mit.edu"', 1)


def cell():
    builder = RobotDiagramBuilder(0.0)
    plant, parser = builder.plant(), builder.parser()
    (robot,) = parser.AddModelsFromString(arm(), "urdf")
    (things,) = parser.AddModelsFromString(WORLD, "urdf")
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("base"), RigidTransform([0, 0, 0.1]))
    plant.WeldFrames(
        plant.world_frame(), plant.GetFrameByName("shelf"), RigidTransform(RollPitchYaw(0.2, 0, 0.1), [0.5, 0.1, 0])
    )
    floor = RigidTransform([0, 0, -0.45])
    plant.RegisterCollisionGeometry(plant.world_body(), floor, Box(4, 4, 0.1), "floor", CoulombFriction(1, 1))
    return builder.Build(), robot, things


def configuration(plant):
    q = RNG.uniform(-1, 1, plant.num_positions())
    for joint in (plant.get_joint(index) for index in plant.GetJointIndices()):
        if joint.type_name() == "quaternion_floating":
            start = joint.position_start()
            q[start : start + 4] /= np.linalg.norm(q[start : start + 4])
    return q


def test_cell():
    """Distances, decisions and Jacobians are Drake's."""
    diagram, robot, _ = cell()
    plant = diagram.plant()
    ours = clearance.drake.CollisionChecker(diagram, [robot], padding=0.01)
    theirs = SceneGraphCollisionChecker(
        model=diagram, robot_model_instances=[robot], edge_step_size=0.01,
        env_collision_padding=0.01, self_collision_padding=0.01,
    )  # fmt: skip
    rows = free = hits = 0
    for _ in range(100):
        q = configuration(plant)
        mine, other = ours.CalcRobotClearance(q, 0.5), theirs.CalcRobotClearance(q, 0.5)
        table = {}
        for i in range(other.size()):
            key = frozenset((int(other.robot_indices()[i]), int(other.other_indices()[i])))
            table.setdefault(key, []).append((other.distances()[i], other.jacobians()[i], other.collision_types()[i]))
        for i in range(mine.size()):
            key = frozenset((int(mine.robot_indices()[i]), int(mine.other_indices()[i])))
            distance = mine.distances()[i]
            if not -0.01 + 1e-4 < distance < 0.5 - 1e-4:
                continue
            # Drake's Jacobian has the wrong sign where a distance is below the padding and above 0.
            sign = -1 if distance < 0 else 1
            near = [row for row in table[key] if abs(row[0] - distance) < 1e-4]
            assert near, (key, distance, table[key])
            off = min(np.abs(sign * row[1] - mine.jacobians()[i]).max() for row in near)
            assert off < 1e-2, (key, near, mine.jacobians()[i])
            assert near[0][2] == mine.collision_types()[i]
            rows += 1
        least = min(other.distances(), default=1.0)
        if abs(least) > 1e-4:
            assert ours.CheckConfigCollisionFree(q) == theirs.CheckConfigCollisionFree(q) == (least > 0)
            free, hits = free + (least > 0), hits + (least < 0)
    assert rows > 200 and free > 10 and hits > 10, (rows, free, hits)
    ends = np.array([[configuration(plant), configuration(plant)] for _ in range(60)])
    proved = ours.CheckEdgesCollisionFree(ends)
    sampled = np.array([theirs.CheckEdgeCollisionFree(*edge) for edge in ends])
    assert not (proved & ~sampled).any(), "an edge is proved free of which Drake samples a collision"
    assert proved.any() and not proved.all()
    for edge, is_free in zip(ends, proved):
        share = ours.MeasureEdgeCollisionFree(*edge)
        assert (share == 1.0) == is_free and 0 <= share <= 1
    print(f"{rows} distances and Jacobians as Drake's, {free} free and {hits} colliding configurations")


def test_thin_sheet():
    """Drake's samples pass a thin sheet; a proof does not."""
    builder = RobotDiagramBuilder(0.0)
    plant = builder.plant()
    (robot,) = builder.parser().AddModelsFromString(arm(("revolute",)), "urdf")
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("base"))
    place = RigidTransform(RollPitchYaw(0, 0, 0.9 + np.pi / 2), [0.25 * np.cos(0.9), 0.25 * np.sin(0.9), 0])
    plant.RegisterCollisionGeometry(plant.world_body(), place, Box(1e-4, 0.1, 0.3), "sheet", CoulombFriction(1, 1))
    diagram = builder.Build()
    checker = clearance.drake.CollisionChecker(diagram, [robot])
    drake = SceneGraphCollisionChecker(model=diagram, robot_model_instances=[robot], edge_step_size=0.9)
    q1, q2 = np.array([-0.2]), np.array([2.0])
    assert checker.CheckConfigsCollisionFree([q1, q2]).all()
    assert drake.CheckEdgeCollisionFree(q1, q2), "Drake's samples would have found the sheet"
    assert not checker.CheckEdgeCollisionFree(q1, q2)
    assert 0.3 < checker.MeasureEdgeCollisionFree(q1, q2) < 0.5
    assert checker.CheckEdgeCollisionFree(q1, -q2)


def test_joints():
    """Geometries are where Drake has them, for all kinds of joints, with frames of their own."""
    builder = RobotDiagramBuilder(0.0)
    plant = builder.plant()
    instance = plant.AddModelInstance("chain")
    parent = plant.world_frame()
    makers = {
        "turn": lambda n, p, c: RevoluteJoint(n, p, c, [0, 0.6, 0.8], -2, 2),
        "slide": lambda n, p, c: PrismaticJoint(n, p, c, [1, 0, 0], -2, 2),
        "weld": lambda n, p, c: WeldJoint(n, p, c, offset()),
        "planar": lambda n, p, c: PlanarJoint(n, p, c, [0, 0, 0]),
        "universal": UniversalJoint,
        "ball": BallRpyJoint,
        "free": RpyFloatingJoint,
        "last": lambda n, p, c: RevoluteJoint(n, p, c, [1, 0, 0]),
    }
    for name, make in makers.items():
        body = plant.AddRigidBody(name, instance, SpatialInertia.SolidSphereWithMass(1.0, 0.1))
        plant.RegisterCollisionGeometry(body, offset(), Box(0.1, 0.05, 0.02), "box", CoulombFriction(1, 1))
        before = plant.AddFrame(FixedOffsetFrame(f"{name}_p", parent, offset()))
        after = plant.AddFrame(FixedOffsetFrame(f"{name}_c", body.body_frame(), offset()))
        plant.AddJoint(make(name, before, after))
        parent = body.body_frame()
    loose = plant.AddRigidBody("loose", instance, SpatialInertia.SolidSphereWithMass(1.0, 0.1))
    plant.RegisterCollisionGeometry(loose, offset(), Sphere(0.1), "s", CoulombFriction(1, 1))
    diagram = builder.Build()
    world = clearance.drake.DrakeWorld(plant, diagram.scene_graph())
    context = diagram.CreateDefaultContext()
    rows = []
    for _ in range(20):
        q = configuration(plant)
        rows.append(q)
        plant.SetPositions(plant.GetMyMutableContextFromRoot(context), q)
        query = diagram.scene_graph().get_query_output_port().Eval(diagram.scene_graph().GetMyContextFromRoot(context))
        world.set_state(q)
        states = world.engine.body_states()
        for name, (geometry, _) in world.geometries.items():
            where = query.GetPoseInWorld(geometry)
            pose = states[world.engine.body_id(name)].pose
            assert np.abs(pose[:3] - where.translation()).max() < 1e-13, name
            quaternion = where.rotation().ToQuaternion().wxyz()
            assert min(np.abs(pose[3:] - quaternion).max(), np.abs(pose[3:] + quaternion).max()) < 1e-13, name
    r = world.engine.distances(configurations=world.configurations(rows), **world.moving)
    assert np.allclose(r.lower[-1], world.engine.distances().lower[0], atol=1e-6)
    try:
        clearance.drake.CollisionChecker(diagram, [instance]).CalcRobotClearance(rows[0], 0.1)
    except ValueError as error:
        assert "quaternions" in str(error)
    else:
        raise AssertionError("a Jacobian by a quaternion")


def fails(call, words):
    try:
        call()
    except (TypeError, ValueError) as error:
        assert words in str(error), error
    else:
        raise AssertionError(f"expected an error with {words!r}")


def test_errors():
    builder = RobotDiagramBuilder(0.0)
    plant = builder.plant()
    body = plant.AddRigidBody("b", SpatialInertia.SolidSphereWithMass(1.0, 0.1))
    plant.RegisterCollisionGeometry(body, RigidTransform(), HalfSpace(), "ground", CoulombFriction(1, 1))
    diagram = builder.Build()
    robot = [body.model_instance()]
    fails(lambda: clearance.drake.CollisionChecker(diagram, robot), "ground: a half-space on a body that moves")
    fails(lambda: clearance.drake.CollisionChecker(cell()[0], []), "robot_model_instances: expected model instances")


def test_geometry_of_the_scene_graph():
    """A geometry that is not the plant's is an error, and does not count without a proximity role."""
    for has_role in (False, True):
        builder = RobotDiagramBuilder(0.0)
        plant, graph = builder.plant(), builder.scene_graph()
        (robot,) = builder.parser().AddModelsFromString(arm(("revolute",)), "urdf")
        plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("base"))
        source = graph.RegisterSource("other")
        wall = graph.RegisterAnchoredGeometry(
            source, GeometryInstance(RigidTransform([0.3, 0, 0]), Box(1, 1, 1), "wall")
        )
        if has_role:
            graph.AssignRole(source, wall, ProximityProperties())
        diagram = builder.Build()
        make = functools.partial(clearance.drake.CollisionChecker, diagram, [robot])
        if has_role:
            fails(make, "no collision geometry 'wall'")
        else:
            assert len(make().world.geometries) == 2


def main():
    begin = time.monotonic()
    test_cell()
    test_thin_sheet()
    test_joints()
    test_geometry_of_the_scene_graph()
    test_errors()
    print(f"Drake: as it should be, in {time.monotonic() - begin:.1f} s")


if __name__ == "__main__":
    main()
