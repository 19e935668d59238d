"""try_mink.py: the limit for mink keeps geoms apart where mink's own lets them through. Needs mink and a QP solver."""

import pathlib
import time

import mink
import mujoco
import numpy as np

import clearance
import clearance.mink

MODEL = pathlib.Path(__file__).parent / "mujoco/mink/arm.xml"


def nearest(model, data):
    pairs = [("post", "upper"), ("post", "fore"), ("floor", "fore"), ("ball", "fore"), ("ball", "upper")]
    return min(mujoco.mj_geomDistance(model, data, model.geom(a).id, model.geom(b).id, 5.0, None) for a, b in pairs)


def reach(model, limit, goal, dt=0.02, steps=150):
    """Moves the hand straight towards a goal; returns the least distance on the way, by MuJoCo, and the last error."""
    configuration = mink.Configuration(model)
    configuration.update(model.qpos0)
    task = mink.FrameTask("hand", "site", position_cost=1.0, orientation_cost=0.0)
    task.set_target(mink.SE3.from_translation(np.array(goal)))
    still = mink.DampingTask(model, cost=1e-3)
    least = np.inf
    speeds = mink.VelocityLimit(model, {name: np.array([2.0]) for name in ("yaw", "pitch", "elbow")})
    limits = [mink.ConfigurationLimit(model), speeds, limit]
    for _ in range(steps):
        velocity = mink.solve_ik(configuration, [task, still], dt, "daqp", limits=limits)
        configuration.integrate_inplace(velocity, dt)
        least = min(least, nearest(model, configuration.data))
    return least, np.linalg.norm(task.compute_error(configuration)[:3])


def test_gradients(model):
    """Rows are the change of the distance with each degree of freedom, of joints and of a free body."""
    limit = clearance.mink.CollisionAvoidanceLimit(model, collision_detection_distance=5.0)
    configuration, rng, seen = mink.Configuration(model), np.random.default_rng(3), 0
    for _ in range(10):
        q = configuration.integrate(rng.normal(size=model.nv), 0.3)
        configuration.update(q)
        made = limit.compute_qp_inequalities(configuration, 0.1)
        bodies = limit.world.engine.distances(reduce="within", max_distance=5.0).pairs
        assert made.G.shape == (len(made.h), model.nv) and len(bodies) == len(made.h)
        for i, pair in enumerate(bodies.tolist()):
            a, b = (limit._geom[body] for body in pair)
            there = [mujoco.mj_geomDistance(model, configuration.data, a, b, 9.0, None)]
            if there[0] < 0.02:
                continue
            for dof in range(model.nv):
                ends = []
                for sign in (-1, 1):
                    other = mink.Configuration(model)
                    other.update(q)
                    other.integrate_inplace(sign * 1e-4 * np.eye(model.nv)[dof], 1.0)
                    ends.append(mujoco.mj_geomDistance(model, other.data, a, b, 9.0, None))
                assert abs(-made.G[i, dof] - (ends[1] - ends[0]) / 2e-4) < 2e-2, (pair, dof, made.G[i, dof], ends)
                seen += 1
    assert seen > 200, seen


def fails(kind, words, *arguments, **named):
    try:
        clearance.mink.CollisionAvoidanceLimit(*arguments, **named)
    except kind as error:
        assert words in str(error), error
    else:
        raise AssertionError(f"expected an error with {words!r}")


def test_arguments(model):
    """Geoms that do not exist are errors, and what mink has beyond us is never taken for something else."""
    post = model.geom("post").id
    limit = clearance.mink.CollisionAvoidanceLimit(model)
    every = limit._pairs([(range(model.ngeom), [np.int32(post)])])  # some collide with nothing
    assert limit.world.left_out and len(every) >= len(limit._pairs([(["upper", "fore", "mark"], ["post"])])) > 0
    fails(ValueError, "geom_pairs[0]: no geom is named 'uper'", model, [(["uper"], ["post"])])
    for wrong in (-1, model.ngeom):
        fails(ValueError, f"geom_pairs[1]: no geom has the id {wrong}", model, [([post], [0]), ([0], [wrong])])
    fails(TypeError, "geom_pairs[0]", model, [([0.5], [post])])
    fails(TypeError, "positional", model, None, 0.85, 0.005, 0.01, 0.0, True)
    fails(TypeError, "broadphase", model, broadphase=True)


def main():
    model = mujoco.MjModel.from_xml_path(str(MODEL))
    model.opt.ccd_tolerance = 1e-9
    test_gradients(model)
    pairs = [(["upper", "fore", "mark"], ["post", "floor", "ball"])]
    options = {"minimum_distance_from_collisions": 0.01, "collision_detection_distance": 0.3}
    for goal in ([0.36, 0.36, 0.0], [0.4, 0.0, -0.5], [0.0, 0.75, 0.2]):
        ours, _ = reach(model, clearance.mink.CollisionAvoidanceLimit(model, pairs, **options), goal)
        every, _ = reach(model, clearance.mink.CollisionAvoidanceLimit(model, **options), goal)
        theirs, _ = reach(model, mink.CollisionAvoidanceLimit(model, pairs, **options), goal)
        none, _ = reach(model, mink.CollisionAvoidanceLimit(model, []), goal)
        print(f"to {goal}: nearest {1e3 * ours:.2f} mm, mink's own limit {1e3 * theirs:.2f}, none {1e3 * none:.2f}")
        assert min(ours, every) > 0.005, (ours, every)
        assert none < 0, "nothing was in the way: nothing was shown"
    test_arguments(model)


if __name__ == "__main__":
    begin = time.monotonic()
    main()
    print(f"mink: as it should be, in {time.monotonic() - begin:.1f} s")
