"""check_stop(): braking paths, the reach of others until standstill, and the greatest proved speed."""

import math
import time

import numpy as np
import pytest

import clearance
from patience import PATIENCE_S

URDF = (
    "<robot name='r'><link name='base'/><link name='post'/><link name='cart'><collision><geometry>"
    "<sphere radius='0.1'/></geometry></collision></link>"
    "<joint name='x' type='prismatic'><parent link='base'/><child link='post'/><axis xyz='1 0 0'/>"
    "<limit lower='-9' upper='9'/></joint>"
    "<joint name='y' type='prismatic'><parent link='post'/><child link='cart'/><axis xyz='0 1 0'/>"
    "<limit lower='-2' upper='2'/></joint></robot>"
)
SCENE = """
bodies:
  - {name: wall, sphere: 0.1, static: true, pose: [2.2, 0, 0, 1, 0, 0, 0]}
  - {name: person, sphere: 0.1, pose: [0, 50, 0, 1, 0, 0, 0]}
  - {name: hand, sphere: 0.1, parent: person, pose: [0, 0, 0, 1, 0, 0, 0]}
groups: {people: [person, hand]}
robots: [{name: r, urdf: rail.urdf, home: {x: 0, y: 0}}]
"""
#: Of the search for the greatest speed.
STEP = 2.0**-8


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("rail")
    (path / "rail.urdf").write_text(URDF)
    (path / "scene.yaml").write_text(SCENE)
    return path


@pytest.fixture(params=["engine", "client"])
def front(request, folder, start_daemon):
    if request.param == "engine":
        return clearance.Engine(clearance.Scene.load(folder / "scene.yaml"), threads=1, covers="off")
    return clearance.connect(start_daemon(folder / "scene.yaml", ["ipc"]).urls["ipc"], timeout_s=PATIENCE_S)


def at(x, y=0.0):
    return [x, y, 0, 1, 0, 0, 0]


def greatest(way, reaction, v, a):
    """The share s with s v reaction + (s v)^2 / (2 a) = way."""
    return a / v * (math.sqrt(reaction**2 + 2 * way / a) - reaction)


def test_a_cart_before_a_wall(front):
    for v, a, reaction in ((2.0, 1.0, 0.5), (3.0, 2.0, 0.0), (5.0, 20.0, 0.1), (1.0, 1.0, 4.0)):
        stop = front.check_stop([0, 0], [v, 0], "r", a, reaction)
        share = greatest(2.0, reaction, v, a)
        assert stop.seconds == pytest.approx(reaction + v / a)
        assert stop.path[-1, -1] == pytest.approx([v * reaction + v * v / (2 * a), 0])
        assert bool(stop) == stop.check.free == (share > 1)
        assert min(share, 1) - STEP <= stop.speed_scale <= share
        if not stop:
            assert stop.check.hit and stop.check.pair_names == ("wall", "r/cart")
            assert stop.path[0, 0] + stop.check.t * (stop.path[0, 1] - stop.path[0, 0]) == pytest.approx(
                [2, 0], abs=1e-2
            )
    kept = front.check_stop([0, 0], [2, 0], "r", 1.0, 0.5, margin=0.5)
    assert greatest(1.5, 0.5, 2, 1) - STEP <= kept.speed_scale <= greatest(1.5, 0.5, 2, 1)


def test_joints_that_stop_one_by_one(front):
    # x stops after 1 s at 1 m, y after 0.25 s at 0.25 m: 1 s of braking begins at (0.4, 0.8).
    stop = front.check_stop([0, 0], [1, 2], "r", [0.5, 8.0], 0.4, together=False)
    assert stop.path.shape == (3, 3, 2) and stop.seconds == pytest.approx(2.4)
    for k, (begin, end) in enumerate([(0, 0.4), (0.4, 0.65), (0.65, 2.4)]):
        for share in np.linspace(0, 1, 9):
            t = begin + share * (end - begin)
            x = min(t, 0.4) + (t - 0.4) - 0.25 * (t - 0.4) ** 2 if t > 0.4 else t
            since = min(max(t - 0.4, 0), 0.25)
            y = 2 * (min(t, 0.4) + since) - 4 * since**2
            p = stop.path[k]
            assert (1 - share) ** 2 * p[0] + 2 * share * (1 - share) * p[1] + share**2 * p[2] == pytest.approx([x, y])
    # Together it goes straight to (1.4, 2.8), beyond the limit of y; one by one y ends at 1.05.
    assert stop and not front.check_stop([0, 0], [1, 2], "r", [0.5, 8.0], 0.4)
    # Towards (2, -1) and the wall at (2.2, 0): straight it passes the wall, but y stops first.
    one_by_one = front.check_stop([0, -0.3], [2.5, 2.0], "r", [1.0, 8.0], together=False)
    assert one_by_one.check.pair_names == ("wall", "r/cart") and 0 < one_by_one.speed_scale < 1


def test_others_reach_as_far_as_their_speed_and_age_allow(front):
    # The cart stops at 1 m after 2 s; the person, at 3 m, has 1.8 m left to walk.
    front.set_poses({"person": at(3.0, 0.0)})
    begun = time.monotonic()
    far = front.check_stop([0, 0], [1, 0], "r", 0.5, others={"person": 0.01}, pairs=("r", "person"))
    assert far.check.free and far.speed_scale == 1
    # 0.9 m/s for 2 s reach it even without any age; a slower cart needs s^2 + 0.9 (2 s + age) < 2.8.
    near = front.check_stop([0, 0], [1, 0], "r", 0.5, others={"person": 0.9 + 1e-6}, pairs=("r", "person"))
    late = time.monotonic() - begun
    assert not near.check.free and near.check.pair_names == ("person", "r/cart")

    def scale(age):
        return -0.9 + math.sqrt(0.81 + max(2.8 - 0.9 * age, 0))

    assert scale(late) - STEP <= near.speed_scale <= scale(0)
    time.sleep(0.2)
    old = front.check_stop([0, 0], [1, 0], "r", 0.5, others={"person": 0.9}, pairs=("r", "person"))
    assert old.speed_scale <= scale(0.2)


def test_nobody_is_proved_who_reaches_a_robot_at_rest(front):
    front.set_poses({"person": at(0.0, 0.5)})
    stop = front.check_stop([0, 0], [1, 0], "r", 0.5, 1.0, others={"person": 0.4}, pairs=("r", "person"))
    assert not stop and stop.speed_scale == 0


@pytest.mark.parametrize("speed, rest", [(0.3, True), (0.41, False)])
def test_no_share_is_proved_with_or_without_a_proved_rest(front, speed, rest):
    front.set_poses({"person": at(0.0, 0.6)})  # 0.4 m away
    query = {"others": {"person": speed}, "pairs": ("r", "person")}
    assert front.check_stop([0, 0], [0, 500], "r", 0.5, 1.0, **query).speed_scale == 0
    assert front.check_stop([0, 0], [0, 0], "r", 0.5, 1.0, **query).check.free == rest


def test_groups_and_followers(front):
    front.set_poses({"person": at(1.0, 1.5), "hand": at(-1.0, -2.1)})  # the hand is at (0, -0.6), 0.4 m away

    def slow(others):  # a cart that stops after 10 s: ages of poses hardly matter
        pairs = [("r", "person"), ("r", "hand")]
        return front.check_stop([0, 0], [0.1, 0], "r", 0.01, others=others, pairs=pairs).check

    assert slow({}).free and slow({"person": 0.021}).free and slow({"hand": 0.021}).free
    assert slow({"person": 0.045}).pair_names == ("hand", "r/cart"), "it follows the person"
    assert not slow({"people": 0.021}).free, "its own movement, and that of the person"


def test_two_that_move_count_both(front):
    front.add_body("other", sphere=0.1, pose=at(1.0, 5.0))
    front.set_poses({"person": at(0.0, 5.0), "hand": at(0.5), "other": at(1.0, 5.0)})  # 0.8 m from person to other

    def slow(pair, others):  # 10 s: each reaches 0.5 m
        return front.check_stop([0, 0], [0.1, 0], "r", 0.01, others=others, pairs=[pair]).check.free

    assert slow(("person", "other"), {"person": 0.05}) and slow(("person", "other"), {"other": 0.05})
    assert not slow(("person", "other"), {"person": 0.05, "other": 0.05})
    assert not slow(("other", "hand"), {"person": 0.05}), "0.3 m away, and it follows the person"
    assert slow(("person", "hand"), {"person": 0.05}), "the person moves both"


def test_too_many_that_move_are_rejected(folder):
    engine = clearance.Engine(clearance.Scene.load(folder / "scene.yaml"), threads=1, covers="off")
    many = {f"b{i}": 0.1 for i in range(91)}
    for name in many:
        engine.add_body(name, sphere=0.01, pose=at(20.0, 20.0))
    engine.set_poses({name: at(20.0, 20.0) for name in many})
    with pytest.raises(ValueError, match="others: 91 bodies move, followers included; at most 90"):
        engine.check_stop([0, 0], [0.1, 0], "r", 0.01, others=many)
    many.pop("b0")
    assert engine.check_stop([0, 0], [0.1, 0], "r", 0.01, others=many).check.free


def test_the_greatest_of_several_speeds_counts(front):
    front.set_poses({"person": at(0.0, 1.2), "hand": at(0.0)})  # 1 m from the cart, which stops after 10 s

    def free(others):
        return front.check_stop([0, 0], [0.1, 0], "r", 0.01, others=others, pairs=("r", "person")).check.free

    assert free({"person": 0.05, "people": 0.02}) and free({"people": 0.02, "person": 0.05})
    assert not free({"person": 0.15, "people": 0.02}) and not free({"people": 0.02, "person": 0.15})


def test_bodies_attached_later_move_with_those_they_follow(folder, front, start_daemon):
    front.add_body("pole", sphere=0.1, pose=at(0.0, 0.8))
    front.set_poses({"person": at(0.0, 3.0), "pole": at(0.0, 0.8)})  # the pole is 0.6 m from the cart
    arguments = {"joints": "r", "deceleration": 0.01, "others": {"person": 0.08}, "pairs": [("r", "pole")]}
    prepared = front.prepare("check_stop", **arguments)
    assert prepared.run([0, 0], [0.1, 0]).check.free, "it stands still"
    front.attach("pole", "person")
    assert not prepared.run([0, 0], [0.1, 0]).check.free, "it moves 0.8 m with the person in 10 s"
    assert not front.check_stop([0, 0], [0.1, 0], **arguments).check.free


def test_attached_by_another_client(folder, start_daemon):
    url = start_daemon(folder / "scene.yaml", ["ipc"]).urls["ipc"]
    ours, other = (clearance.connect(url, timeout_s=PATIENCE_S) for _ in range(2))
    ours.add_body("pole", sphere=0.1, pose=at(0.0, 0.8))
    ours.set_poses({"person": at(0.0, 3.0), "pole": at(0.0, 0.8)})
    arguments = {"joints": "r", "deceleration": 0.01, "others": {"person": 0.08}}
    prepared = [ours.prepare("check_stop", **arguments, pairs=pairs) for pairs in ([("r", "pole")], None)]
    assert all(p.run([0, 0], [0.1, 0]).check.free for p in prepared)
    other.attach("pole", "person")
    assert not any(p.run([0, 0], [0.1, 0]).check.free for p in prepared)


def test_prepared_ones_keep_their_margins_when_the_scene_changes(front):
    front.set_poses({"person": at(0.2, 1.5)})
    arguments = {"joints": "r", "deceleration": 0.01, "others": {"person": 0.15}, "pairs": ("r", "person")}
    prepared = front.prepare("check_stop", **arguments)
    q, v = np.zeros(2), np.array([0.1, 0.0])
    first = prepared.run(q, v)
    assert not first.check.free and 0 < first.speed_scale < 1
    front.add_body("crate", box=[0.1, 0.1, 0.1], pose=at(8, 8))
    again = prepared.run(q, v)
    assert not again.check.free and again.speed_scale <= first.speed_scale
    assert prepared.submit(q, v).result(PATIENCE_S).speed_scale <= again.speed_scale
    front.remove_body("crate")


def test_the_terms_of_a_separation_distance(front):
    # 0.25 m in the reaction of 0.5 s, 0.5 m in 2 s of braking; the person stands 2.8 m before the cart.
    front.set_poses({"person": at(3.0, 0.0), "hand": at(0.0, 40.0)})
    for together in (True, False):
        terms = front.explain_stop(
            [0, 0], [0.5, 0], "r", 0.25, 0.5, {"person": 0.2}, [("r", "person")], margin=0.1, together=together
        )
        (person,) = terms
        assert person.body == "person" and person.distance == pytest.approx((2.8, 2.8))
        assert person.reaction == pytest.approx(0.25, abs=2e-4) and person.reaction >= 0.25
        assert person.stopping == pytest.approx(0.5, abs=2e-4) and person.stopping >= 0.5
        assert person.human >= 0.2 * (2.5 + person.age_s) and person.intrusion == 0.1
        assert person.human == pytest.approx(0.2 * (2.5 + person.age_s))
        assert person.required == person.human + person.reaction + person.stopping + person.intrusion
        assert person.left == person.distance[0] - person.required
    # Nothing is left for a faster person, as check_stop() finds.
    arguments = {"joints": "r", "deceleration": 0.25, "reaction_s": 0.5, "pairs": [("r", "person")]}
    for speed in (0.3, 1.2):
        (terms,) = front.explain_stop([0, 0], [0.5, 0], others={"person": speed}, **arguments)
        assert (
            (terms.left > 0)
            == (speed == 0.3)
            == front.check_stop([0, 0], [0.5, 0], others={"person": speed}, **arguments).check.free
        )
    assert [t.body for t in front.explain_stop([0, 0], [1, 0], "r", 1, others={"person": 1})] == ["person", "hand"]
    both = front.explain_stop([0, 0], [1, 0], "r", 1, others={"person": 0.2, "hand": 0.1})
    for (body, speed), terms in zip((("person", 0.2), ("hand", 0.3)), both):
        assert terms.body == body and terms.human == pytest.approx(speed * (1 + terms.age_s), rel=0.5)
        assert speed <= terms.human <= speed * (1 + terms.age_s) * (1 + 1e-9)


def test_wrong_arguments_are_rejected_by_name(front):
    def stop(positions=(0, 0), velocities=(1, 0), joints="r", deceleration=1.0, **more):
        return front.check_stop(positions, velocities, joints, deceleration, **more)

    for arguments, text in [
        ({"positions": [0]}, r"positions: expected shape \(2,\)"),
        ({"velocities": [[1, 0]]}, r"velocities: expected shape \(2,\)"),
        ({"velocities": [1, math.nan]}, "velocities: expected finite numbers"),
        ({"deceleration": 0.0}, "deceleration: expected finite numbers above 0"),
        ({"deceleration": math.inf}, "deceleration: expected finite numbers above 0"),
        ({"deceleration": [1, 1, 1]}, r"deceleration: expected \(2,\)"),
        ({"deceleration": [1, math.nan]}, "deceleration: expected finite numbers above 0"),
        ({"deceleration": None}, "deceleration: "),
        ({"reaction_s": -1}, "reaction_s: expected a number >= 0"),
        ({"reaction_s": math.inf}, "reaction_s: expected a finite number"),
        ({"others": ["person"]}, "others: expected a dict"),
        ({"others": {"person": -1}}, r"others\['person'\]: expected a number >= 0"),
        ({"others": {"persn": 1}}, "others: no body or group is named 'persn'; did you mean 'person'"),
        ({"others": {99: 1}}, "others: no body has the id 99"),
        ({"others": {"*": 1}}, r"others: expected bodies and groups, got '\*'"),
        ({"others": {"wall": 1}}, "others: no pose of 'wall' has been received"),
        ({"margin": {("*", "*"): 0.1}}, "margin: expected a number"),
        ({"together": 1}, "together: expected True or False"),
        ({"joints": None}, "joints: expected some, that move"),
    ]:
        with pytest.raises((TypeError, ValueError), match=text):
            stop(**arguments)
    assert stop(positions=[math.nan, 0]).speed_scale == 0


def test_every_front_answers_alike(arm_front, arm_engine):
    arm = arm_front.joints("arm")
    rng = np.random.default_rng(1)
    seen = set()
    for _ in range(12):
        q = np.clip(rng.uniform(-1, 1, len(arm)), arm.lower, arm.upper)
        v, a = rng.uniform(-3, 3, len(arm)), rng.uniform(1, 5, len(arm))
        for together in (True, False):
            here, there = (f.check_stop(q, v, "arm", a, 0.1, pairs=("arm", "cup"), margin=0.2, together=together)
                           for f in (arm_engine, arm_front))  # fmt: skip
            assert here.speed_scale == there.speed_scale and here.check.free == there.check.free
            assert (here.path == there.path).all()
            seen.add(here.check.free)
    assert seen == {True, False}
