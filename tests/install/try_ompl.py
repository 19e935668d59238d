"""Plans with OMPL over Clearance: paths found are proved free, and motions through a plate are not free."""

import gc
import math
import pathlib
import tempfile
import weakref

import numpy as np
from ompl import base as ob
from ompl import geometric as og

import clearance
import clearance.ompl

URDF = """<robot name="arm">
  <link name="base"/>
  <link name="upper"><collision><origin xyz="0.25 0 0"/>
    <geometry><box size="0.5 0.002 0.002"/></geometry></collision></link>
  <link name="fore"><collision><origin xyz="0.25 0 0"/>
    <geometry><box size="0.5 0.002 0.002"/></geometry></collision></link>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 0 1"/>
    <limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
  <joint name="elbow" type="continuous"><parent link="upper"/><child link="fore"/><origin xyz="0.5 0 0"/>
    <axis xyz="0 0 1"/></joint>
</robot>"""


def problem(margin=0.0):
    with tempfile.TemporaryDirectory() as folder:
        urdf = pathlib.Path(folder) / "arm.urdf"
        urdf.write_text(URDF)
        scene = clearance.Scene()
        scene.add_robot("arm", urdf, static=True)
    # Samples of 0.02 rad move the arm by 12 to 20 mm there; the plate is 0.1 mm thick. A folded arm gets past it.
    scene.add_box("plate", [0.4, 1e-4, 0.1], static=True, pose=[0.8, 0.0061, 0, 1, 0, 0, 0])
    scene.ignore("arm/upper", "arm/fore")
    return clearance.ompl.JointProblem(clearance.Engine(scene, threads=1), "arm", margin=margin)


def main():
    ob.RNG.setSeed(1) if hasattr(ob, "RNG") else None
    arm = problem()
    si = arm.space_information()
    below, above = np.array([-0.5, 0.0]), np.array([0.5, 0.0])
    start, goal = arm.state(below), arm.state(above)
    assert np.array_equal(arm.row(start), below) and si.isValid(start) and si.isValid(goal)

    # Straight through the plate: free by samples, while the proof finds the collision.
    samples = below + np.linspace(0, 1, 51)[:, None] * (above - below)
    assert arm.free(samples).all(), "what sampling at 0.02 rad says"
    assert not si.checkMotion(start, goal)
    validator = clearance.ompl.CertifiedMotions(si, arm)
    state, time = validator.last_valid(start, goal)
    assert 0.4 < time < 0.51 and arm.free(arm.row(state)[None])[0], time
    assert validator.last_valid(start, arm.state([-1.0, 0.3])) is None

    # A joint without limits moves the shorter way.
    a, b = np.array([[1.0, 3.1]]), np.array([[1.0, -3.1]])
    assert abs(arm.unwrapped(a, b)[0, 1] - (2 * math.pi - 3.1)) < 1e-12
    assert arm.motions(a, b).status[0] == clearance.Status.BEYOND

    definition = ob.ProblemDefinition(si)
    definition.setStartAndGoalStates(start, goal)
    planner = og.RRTConnect(si)
    planner.setProblemDefinition(definition)
    planner.setup()
    assert planner.solve(60.0), "no way round the plate was found"
    path = definition.getSolutionPath()
    rows = np.array([arm.row(path.getState(i)) for i in range(path.getStateCount())])
    shorter = arm.shortened(rows)
    for way in (rows, shorter):
        done = arm.engine.check_path(unrolled(arm, way), joints=arm.joints)
        assert done.free, done
    assert len(shorter) <= len(rows) and np.array_equal(shorter[[0, -1]], rows[[0, -1]])
    try:
        arm.shortened(np.array([below, above]))
    except ValueError as error:
        assert "from waypoint 0 to 1 is not proved" in str(error)
    else:
        raise SystemExit("a path through the plate was shortened")

    objective = clearance.ompl.ClearanceObjective(si, arm)
    near, far = arm.state([-0.05, 0.0]), arm.state([-1.5, 0.0])
    assert objective.stateCost(near).value() > objective.stateCost(far).value() > 0
    print(f"ompl: planned {len(rows)} waypoints, {len(shorter)} after shortcuts, every motion proved free")


def planned_once():
    """A weak reference to an engine that a planner has used."""
    arm = problem()
    si = arm.space_information()
    gc.collect()  # only OMPL owns the checkers of states and motions
    definition = ob.ProblemDefinition(si)
    definition.setStartAndGoalStates(arm.state([0.5, 0.0]), arm.state([1.0, 0.5]))
    definition.setOptimizationObjective(clearance.ompl.ClearanceObjective(si, arm))
    planner = og.RRTConnect(si)
    planner.setProblemDefinition(definition)
    planner.setup()
    assert planner.solve(60.0)
    return weakref.ref(arm.engine)


def engines_end_with_their_problems():
    engines = [planned_once() for _ in range(3)]
    gc.collect()
    assert [engine() for engine in engines] == [None] * 3


def unrolled(arm, rows):
    out = [rows[0]]
    for row in rows[1:]:
        out.append(arm.unwrapped(out[-1], row))
    return np.array(out)


if __name__ == "__main__":
    main()
    engines_end_with_their_problems()
