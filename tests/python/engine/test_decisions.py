"""check(), margins, allow() and forbid(): in process, and through a daemon over every transport."""

import subprocess

import numpy as np
import pytest

import clearance
from clearance import NONE, Status
from clearance.wire import ErrorCode
from conftest import BUILD, INSTALLED
from patience import PATIENCE_S
from scenes import at

PROGRAM = "clearance" if INSTALLED else str(BUILD / "bin" / "clearance")
SCENE = """
bodies:
  - {name: ball, sphere: 0.1, pose: [0,0,0, 1,0,0,0]}
  - {name: cup, sphere: 0.1, pose: [1,0,0, 1,0,0,0]}
  - {name: wall, box: [0.2, 2, 2], static: true, pose: [3,0,0, 1,0,0,0]}
  - {name: shelf, box: [0.2, 2, 2], static: true, pose: [-3,0,0, 1,0,0,0]}
groups:
  rigid: [wall, shelf]
"""


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "scene.yaml"
    path.write_text(SCENE)
    return path


# The ball: free, at the wall with a gap of 0.05 m, in the cup.
PLACES = np.array([[at(0)], [at(2.75)], [at(0.9)]], float)


def test_check_says_what_is_free_and_what_stands_in_the_way(front):
    check = front.check(PLACES, bodies=["ball"])
    assert check.free.tolist() == [True, True, False] and check.hit.tolist() == [False, False, True]
    assert check.verdict.tolist() == [Status.BEYOND, Status.BEYOND, Status.OK] and check.verdict.dtype == np.uint8
    ball, cup, wall = (front.body_id(name) for name in ("ball", "cup", "wall"))
    assert check.pair.tolist() == [[NONE, NONE], [NONE, NONE], [ball, cup]]
    check = front.check(PLACES, 0.06, bodies=["ball"])
    assert check.free.tolist() == [True, False, False] and check.verdict[1] == Status.OK
    assert check.pair[1].tolist() == [ball, wall]
    assert "1 of 3 free" in repr(check)
    assert front.check().free.tolist() == [True]


def test_margins_of_pairs(front):
    margins = {("*", "*"): 1.0, ("ball", "rigid"): 0.06, ("cup", "ball"): 0.0}
    assert front.check(PLACES, margins, bodies=["ball"]).free.tolist() == [True, False, False]
    assert front.check(PLACES, {**margins, ("wall", "ball"): 0.0}, bodies=["ball"]).free.tolist() == [True, True, False]
    pairs = [("ball", "cup"), ("ball", "wall")]
    each = np.array([0.0, 0.06])
    assert front.check(PLACES, each, pairs, ["ball"]).free.tolist() == [True, False, False]
    assert front.check(PLACES, each[::-1], pairs, ["ball"]).free.tolist() == [True, True, False]
    prepared = front.prepare("check", pairs=pairs, bodies=["ball"], margin=each)
    each[:] = 9  # the query has a copy
    assert prepared.run(PLACES).free.tolist() == [True, False, False]
    r = front.submit(pairs, PLACES, ["ball"], reduce="any", margin={("ball", "*"): 0.06}, fields="default").result()
    assert r.status.tolist() == [Status.BEYOND, Status.OK, Status.OVERLAP]
    decided = front.distances(
        configurations=PLACES, bodies=["ball"], reduce="any", fields=["bounds", "status"], margin=0.06
    )
    assert decided.bounds[1, 0] <= 0.05 <= decided.bounds[1, 1] and decided.status.tolist() == r.status.tolist()


@pytest.mark.parametrize("others", [(), ("pair",), ("status", "lower"), ("configuration",)], ids=str)
def test_the_verdict_is_the_status_without_the_kind_of_a_hit(front, others):
    # Free, apart by less than the margin, overlapping, as far as the margin, and without a position.
    places = np.array([[at(0)], [at(2.75)], [at(0.9)], [at(1, 0.26)], [at(np.nan)]], float)
    requested = {"configurations": places, "bodies": ["ball"], "reduce": "any", "margin": 0.06}
    status = front.distances(**requested, fields="status").status.tolist()
    assert status == [Status.BEYOND, Status.OK, Status.OVERLAP, Status.UNCONVERGED, Status.BAD_POSE]
    r = front.distances(**requested, fields=("verdict", *others))
    assert set(r.columns) == {"verdict", *others}, "no other column is forced"
    assert r.verdict.dtype == np.uint8 and r.verdict.shape == (5,)
    assert r.verdict.tolist() == [Status.BEYOND, Status.OK, Status.OK, Status.UNCONVERGED, Status.BAD_POSE]
    if "pair" not in others:
        with pytest.raises(AttributeError, match="the column 'pair' was not requested"):
            _ = r.pairs


def test_verdicts_of_motions(front):
    start, end = np.array([[at(0)], [at(0)]], float), np.array([[at(0.5)], [at(1.5)]], float)
    requested = {"bodies": ["ball"], "reduce": "any"}
    r = front.motions(start, end, **requested, fields=["verdict"])
    assert list(r.columns) == ["verdict"] and r.verdict.tolist() == [Status.BEYOND, Status.OK]
    assert front.motions(start, end, **requested, fields="status").status.tolist() == [Status.BEYOND, Status.OVERLAP]


@pytest.mark.parametrize("reduce", ["none", "within", "nearest", "min"])
def test_a_verdict_is_of_decisions_only(front, reduce):
    with pytest.raises(clearance.QueryError, match="fields: verdict needs reduce any"):
        front.distances(reduce=reduce, fields=["default", "verdict"])


def test_a_check_has_a_verdict_and_a_pair(front):
    check = front.check(PLACES, bodies=["ball"])
    prepared = front.prepare("check", bodies=["ball"]).run(PLACES)
    for each in (check, prepared):
        assert set(each.result.columns) == {"verdict", "pair"}
        assert each.verdict.tolist() == [Status.BEYOND, Status.BEYOND, Status.OK] and not each
    assert front.check(PLACES[:2], bodies=["ball"]), "a check as a bool"
    with pytest.raises(AttributeError, match="the column 'lower' was not requested; fields were: pair, verdict"):
        _ = check.result.lower


def test_what_is_not_proved_is_not_free(front):
    places = np.array([[at(1, 0.2)], [at(np.nan)]], float)  # touching in one point; no pose
    check = front.check(places, bodies=["ball"])
    assert not check.free.any() and not check.hit.any()
    assert check.verdict.tolist() == [Status.UNCONVERGED, Status.BAD_POSE]


def test_bad_margins_are_refused_by_name(front):
    for margin, text in [
        (-0.1, "margin"),
        (np.zeros(7), "pair_margins: expected one for each of 5 pairs, got 7"),
        (np.array([0, 0, -1, 0, 0.0]), r"pair_margins\[2\]"),
        ({(77, "*"): 0.1}, "unknown body 77"),
    ]:
        with pytest.raises(clearance.QueryError, match=text):
            front.check(margin=margin)
    with pytest.raises(clearance.QueryError, match="margin: only for reduce any"):
        front.distances(margin=0.1)
    with pytest.raises(clearance.QueryError, match="max_distance: reduce any uses its margins"):
        front.distances(reduce="any", max_distance=0.1)


def test_allow_and_forbid(front):
    before, revision = front.pairs.tolist(), front.scene_revision
    assert front.allow("ball", "rigid").applied == 2
    assert front.scene_revision != revision and len(front.pairs) == len(before) - 2
    assert front.check(np.array([[at(3)]], float), bodies=["ball"]).free.all()
    done = front.forbid("wall", "ball")
    assert done.applied == 1 and done.scene_revision == front.scene_revision
    assert not front.check(np.array([[at(3)]], float), bodies=["ball"]).free.any()
    front.forbid("*", "*")
    assert front.scene_revision == revision and front.pairs.tolist() == before
    with pytest.raises(clearance.QueryError, match="unknown body 77"):
        front.allow(77, "ball")


def test_what_is_grasped_may_touch(front):
    ball, wall = front.body_id("ball"), front.body_id("wall")
    front.attach("ball", "cup", at(1.9), allow=["wall"])
    assert [ball, wall] not in front.pairs.tolist() and front.check().free.all()
    front.attach("ball", "cup", at(1.9))
    assert [ball, wall] in front.pairs.tolist() and front.check().pair.tolist() == [[ball, wall]]
    with pytest.raises(clearance.QueryError, match="allow is only for a body with a parent"):
        front.attach("ball", None, allow=["wall"])


def test_others_are_told_that_pairs_have_changed(start_daemon, scene):
    daemon = start_daemon(scene, ["ipc"])
    ours, theirs = (clearance.connect(daemon.urls["ipc"], timeout_s=PATIENCE_S) for _ in range(2))
    ours.distances()
    assert theirs.scene_revision
    theirs.allow("ball", "wall")
    ours.distances(pairs=("cup", "*"))  # means the same
    with pytest.raises(clearance.QueryError) as info:
        ours.distances(pairs=("ball", "*"))
    assert info.value.code == ErrorCode.WRONG_SCENE
    ours.refresh()
    assert len(ours.pairs) == 4
    assert theirs.stats()["pairs.allowed"] == 1
    ours.add_body("mug", sphere=0.1, pose=at(0, 5))  # another scene, in which it is still allowed
    assert [0, 2] not in ours.pairs.tolist()
    ours.reload()
    assert [0, 2] not in ours.pairs.tolist()


def test_the_command_line(start_daemon, scene):
    daemon = start_daemon(scene, ["ipc"])

    def run(*arguments):
        command = [PROGRAM, *arguments, "--connect", daemon.urls["ipc"]]
        done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S)
        return done.returncode, done.stdout + done.stderr

    assert run("scene", "allow", "ball", "rigid") == (0, "2 pairs allowed\n")
    assert run("scene", "forbid", "ball", "wall") == (0, "1 pair forbidden\n")
    code, text = run("query", "--reduce", "any", "--margin", "0.9")
    assert code == 0 and "ok" in text and "cup" in text
    code, text = run("query", "--reduce", "any", "--margin", "0.1")
    assert code == 0 and "beyond" in text
    code, text = run("scene", "allow", "ball", "nonesuch")
    assert code != 0 and "nonesuch" in text
    code, text = run("scene", "move", "ball", "1.9", "0", "0", "--parent", "cup", "--allow", "rigid")
    assert code == 0, text
    assert run("query", "--reduce", "any")[1].count("beyond") == 1


def test_pairs_that_are_not_free_have_names(front):
    check = front.check(PLACES, 0.06, bodies=["ball"])
    assert check.pair_names.tolist() == [[None, None], ["ball", "wall"], ["ball", "cup"]]
    assert repr(check) == "<clearance.Check: 1 of 3 free; configuration 1: 'ball' hits 'wall'>"
    assert repr(front.check(PLACES[:1], bodies=["ball"])) == "<clearance.Check: 1 of 1 free>"
    touching = front.check(np.array([[at(1, 0.2)]], float), bodies=["ball"])
    assert repr(touching) == "<clearance.Check: 0 of 1 free; configuration 0: 'ball' and 'cup' not proved free>"
    stopped = front.check_path(PLACES, bodies=["ball"])
    assert stopped.hit and stopped.pair_names == ("ball", "cup") and "pair_names=('ball', 'cup')" in repr(stopped)
    assert stopped.pair == tuple(map(front.body_id, stopped.pair_names))
    assert front.check_path(np.array([[at(0)], [at(0.5)]], float), bodies=["ball"]).pair_names is None


def test_a_path_stops_with_the_details_of_its_first_motion_that_is_not_free(front):
    places = np.array([[at(0.1 * x)] for x in (0, 1, 2, 3, 4, 5, 6, 5, 4, 3, 2, 12, 0)], float)
    options = {"bodies": ["ball"], "pairs": [("ball", "cup"), ("ball", "wall")]}
    fields = ("status", "pair", "time", "first_contact")
    details = front.motions(places[:-1], places[1:], reduce="any", fields=fields, **options)
    path = front.check_path(places, **options)
    first = int(np.argmax(details.status != Status.BEYOND))
    assert first == path.index == 10 and not path.free
    assert (path.t, path.status) == (details.time[first], details.status[first])
    assert path.pair == tuple(details.pair[first].tolist()) == (front.body_id("ball"), front.body_id("cup"))
    assert front.check_path(places[:11], **options).free
