"""try_mujoco.py: MuJoCo's models as scenes: the same poses, pairs and distances as MuJoCo's. Needs mujoco-core."""

import pathlib
import time

import mujoco
import numpy as np

import clearance

RNG = np.random.default_rng(49)
AGREE = 2e-6  # metres: accepted error of MuJoCo's distances, above its ccd_tolerance
FOLDER = pathlib.Path(__file__).parent / "mujoco"
MODELS = sorted(FOLDER.glob("*.xml"))


def random_state(model, data):
    for j in range(model.njnt):
        at, kind = model.jnt_qposadr[j], int(model.jnt_type[j])
        if kind == mujoco.mjtJoint.mjJNT_FREE:
            data.qpos[at : at + 3] = RNG.uniform(-1, 1, 3)
            at += 3
        if kind == mujoco.mjtJoint.mjJNT_FREE or kind == mujoco.mjtJoint.mjJNT_BALL:
            data.qpos[at : at + 4] = RNG.normal(size=4) * 2  # MuJoCo normalises, as Clearance does
        else:
            data.qpos[at] = RNG.uniform(-2, 2) / (4 if kind == mujoco.mjtJoint.mjJNT_SLIDE else 1)
    data.mocap_pos[:] = RNG.uniform(-0.4, 0.4, data.mocap_pos.shape)
    data.mocap_quat[:] = RNG.normal(size=data.mocap_quat.shape)
    mujoco.mj_kinematics(model, data)


def their_pairs(model):
    """The pairs that MuJoCo collides: those in contact, with spheres 100 m wide."""
    model.geom_size[:] = 100
    model.geom_rbound[:] = 100
    model.geom_aabb[:, 3:] = 100
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return {tuple(sorted(map(int, contact.geom))) for contact in data.contact}


def distance(model, data, a, b, proved_overlap):
    """MuJoCo's distance of two geoms, below 0 if they overlap."""
    theirs = mujoco.mj_geomDistance(model, data, a, b, 100.0, None)
    if theirs > AGREE and proved_overlap and mujoco.mjtGeom.mjGEOM_HFIELD in model.geom_type[[a, b]]:
        # MuJoCo gives a distance here, although its own collision detection finds a geom that is in a height field.
        mujoco.mj_collision(model, data)
        return min((contact.dist for contact in data.contact if set(contact.geom) == {a, b}), default=np.inf)
    return theirs


def try_model(name, path):
    """Compares poses and distances at random states."""
    model = mujoco.MjModel.from_xml_path(str(path))
    data, world = mujoco.MjData(model), clearance.from_mujoco(model)
    geom = {world.engine.body_id(body): g for g, body in world.geoms.items()}
    far, hits, off = 0, 0, 0.0
    for _ in range(60):
        random_state(model, data)
        world.set_state(data)
        states = world.engine.body_states()
        for body, g in geom.items():
            rotation = np.empty(9)
            mujoco.mju_quat2Mat(rotation, states[body].pose[3:])
            assert np.abs(rotation - data.geom_xmat[g]).max() < 1e-13, (name, world.geoms[g])
            assert np.abs(states[body].pose[:3] - data.geom_xpos[g]).max() < 1e-13, (name, world.geoms[g])
        r = world.engine.distances()
        assert len(r.pairs) and set(np.unique(r.pairs)) <= set(geom)
        for pair, lower, upper in zip(r.pairs.tolist(), r.lower[0], r.upper[0]):
            a, b = (geom[body] for body in pair)
            theirs = distance(model, data, a, b, proved_overlap=upper <= 0)
            if theirs > AGREE:
                far += 1
                off = max(off, lower - theirs, theirs - upper)
            elif theirs < -AGREE:
                hits += 1
            right = lower <= 0 if theirs < -AGREE else lower - AGREE <= max(theirs, 0) <= upper + AGREE
            assert right, (name, world.geoms[a], world.geoms[b], lower, theirs, upper)
    assert far > 100 and hits > 1, (name, far, hits)
    print(f"{name}: {far} distances, at most {1e9 * off:.1f} nm outside of our intervals, and {hits} overlaps")
    return model, data, world


def test_pairs(path):
    for flag in (0, int(mujoco.mjtDisableBit.mjDSBL_FILTERPARENT)):
        model = mujoco.MjModel.from_xml_path(str(path))
        model.opt.disableflags = flag
        world = clearance.from_mujoco(model)
        geom = {world.engine.body_id(body): g for g, body in world.geoms.items()}
        ours = {tuple(sorted((geom[a], geom[b]))) for a, b in world.engine.pairs.tolist()}
        theirs = their_pairs(model)
        assert ours == theirs and len(ours) > 20, (flag, ours - theirs, theirs - ours)
    assert world.left_out == ("v", "none"), world.left_out
    more = clearance.from_mujoco(model, every_geom=True)
    assert not more.left_out and len(more.engine.pairs) == len(world.engine.pairs)
    assert more.engine.distances(pairs=("none", "w")).status[0, 0] != clearance.Status.UNKNOWN_BODY


def test_configurations(model, data, world):
    """A query at some states has the answers of each of them."""
    rows = np.array([random_state(model, data) or data.qpos.copy() for _ in range(8)])
    r = world.engine.distances(configurations=world.configurations(rows), **world.moving)
    for k, qpos in enumerate(rows):
        world.set_state(qpos)
        one = world.engine.distances()
        assert np.array_equal(one.pairs, r.pairs) and np.array_equal(one.lower[0], r.lower[k])


def test_edge():
    """A thin sheet between two states, which 21 samples miss."""
    world = world_of("""<geom name="sheet" type="box" size=".4 .0001 .4" pos=".85 .0061 0"/>
      <body><joint axis="0 0 1"/><geom type="box" size=".25 .0005 .01" pos=".25 0 0"/></body>""")
    samples = np.linspace(-0.5, 0.5, 22)[:, None]
    assert world.engine.check(world.configurations(samples), **world.moving).free.all()
    assert not world.engine.check_path(world.configurations(samples[[0, -1]]), **world.moving).free
    assert world.engine.check_path(world.configurations(samples[[0, 8]]), **world.moving).free


def test_meshes(model):
    """A bead fits into the notch of a solid, but not of its hull."""
    found = []
    for mesh_as in ("hull", "solid"):
        world = clearance.from_mujoco(model, mesh_as=mesh_as)
        world.engine.add_body("bead", sphere=0.01, parent="notch")
        first = model.mesh_vertadr[model.mesh("notch").id]
        bottom, left = (np.array(model.mesh_vert[first + i], dtype=float) for i in (3, 4))
        opposite = model.mesh_vert[first + 8]
        middle = (bottom + opposite) / 2 + (left - bottom) / 2 + (model.mesh_vert[first + 2] - bottom) / 2
        world.engine.attach("bead", "notch", [*middle, 1, 0, 0, 0])
        found.append(world.engine.distances(pairs=("notch", "bead")))
    assert found[0].upper[0, 0] <= 0 and found[1].lower[0, 0] > 0.05, found


def world_of(xml):
    return clearance.from_mujoco(mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{xml}</worldbody></mujoco>"))


def fails(call, *words):
    try:
        call()
    except ValueError as error:
        assert all(word in str(error) for word in words), error
    else:
        raise AssertionError(f"expected an error with {words}")


def test_errors():
    ball = '<body><freejoint/><geom size="1"/></body>'
    plane = '<body name="m" mocap="true"><geom name="p" type="plane" size="1 1 1"/></body>'
    fails(lambda: world_of(plane + ball), "geom 'p'", "m'", "moves")
    pair = '</worldbody><contact><pair geom1="a" geom2="b"/></contact><worldbody>'
    fails(lambda: world_of(f'<geom name="a" size="1"/><geom name="b" size="1"/>{pair}{ball}'), "'a' and 'b'", "static")
    cloth = '<flexcomp name="cloth" type="grid" count="3 3 1" spacing="1 1 1" dim="2" mass="1" rigid="true"/>'
    fails(lambda: world_of(cloth + ball), "'cloth'", "deformable")
    fails(lambda: clearance.from_mujoco(mujoco.MjModel.from_xml_string("<mujoco/>"), mesh_as="hul"), "mesh_as")
    world = world_of(ball)
    for wrong in (np.zeros(3), np.zeros((2, 7))):
        fails(lambda wrong=wrong: world.set_state(wrong), "q: expected")
    fails(lambda: world.configurations(np.zeros((2, 6))), "q: expected")


def main():
    begin = time.monotonic()
    made = {path.stem: try_model(path.stem, path) for path in MODELS}
    assert len(made) == 5
    test_pairs(FOLDER / "filter.xml")
    for each in ("arm", "free", "mocap"):
        test_configurations(*made[each])
    test_edge()
    test_meshes(made["free"][0])
    test_errors()
    print(f"MuJoCo {mujoco.__version__}: as it should be, in {time.monotonic() - begin:.1f} s")


if __name__ == "__main__":
    main()
