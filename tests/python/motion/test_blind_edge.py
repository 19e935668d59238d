"""An edge that is free by sampling, and contact between two of its samples: both are checked by exact arithmetic, with
poses from independent kinematics."""

import sys

import numpy as np
import pytest

from clearance import Status


@pytest.fixture(scope="module")
def edge(root):
    sys.path[:0] = [str(root / "tools"), str(root / "scenes" / "cell")]
    try:
        from edge import Edge

        yield Edge()
    finally:
        del sys.path[:2]


@pytest.fixture(scope="module")
def tools(edge, root):
    """The checker of certificates, and the arm's kinematics; neither uses Clearance."""
    sys.path[:0] = [str(root / "tools"), str(root / "scenes" / "cell")]
    try:
        import arm

        import check_certificate

        return check_certificate, arm
    finally:
        del sys.path[:2]


def exact_rows(tools, certificate):
    """The rows of a certificate, each of them proved."""
    checker, _ = tools
    document = certificate.document
    for good, why in checker.verdicts(document):
        assert good, why
    return document["rows"]


def probe_pose(tools, edge, time):
    """x, y, z, qw, qx, qy, qz of the probe by independent kinematics; only its axis and centre matter."""
    _, arm = tools
    links = arm.link_poses(np.degrees(edge.at([time])[0, :6]))
    t, q = links["flange"][:3], links["flange"][3:]
    half = 0.5**0.5
    return np.array([*(t + arm.rotated(q, (0, 0.078 + 0.18, 0))), *arm.product(q, np.array([half, half, 0, 0]))])


def test_samples_call_it_free(edge, tools):
    sampled = edge.sampled()
    assert sampled.free and sampled.count == 31 and sampled.nearest > 2e-3
    pair = [body.id for body in edge.engine.bodies if body.name in ("probe", "sheet")]
    times = edge.times(0.02)
    rows = exact_rows(tools, edge.certificate(times, pair))
    assert [row["status"] for row in rows] == ["ok"] * 31
    assert min(row["lower"] for row in rows) > 2e-3
    for row, time in zip(rows, times):
        np.testing.assert_allclose(row["witness"]["poses"][0], probe_pose(tools, edge, time), atol=1e-7)


def test_a_margin_of_2_mm_does_not_help_samples(edge):
    rows = edge.at(edge.times(0.02))
    assert edge.engine.check(rows, joints=edge.joints, margin=2e-3).free.all()


def test_the_whole_edge_is_proved_to_be_in_contact(edge, tools):
    proved = edge.proved()
    assert proved.status == Status.OVERLAP and proved.bodies == ("probe", "sheet")
    assert 15 / 30 < proved.free_until <= proved.contact < 16 / 30, "between two samples"
    (row,) = exact_rows(tools, proved.witness)
    assert row["status"] == "overlap" and row["upper"] == 0
    np.testing.assert_allclose(row["witness"]["poses"][0], probe_pose(tools, edge, proved.contact), atol=1e-7)


def test_first_contact_is_where_finer_samples_find_it(edge):
    proved = edge.proved()
    assert not edge.sampled(1e-3).free
    before = np.linspace(0, proved.free_until, 400, endpoint=False)
    assert edge.engine.check(edge.at(before), joints=edge.joints).free.all()
    assert proved.contact - proved.free_until < 0.01


def test_a_path_along_it_stops_there(edge):
    done = edge.engine.check_path([edge.start, edge.end], joints=edge.joints)
    names = {edge.engine.bodies[i].name for i in done.pair}
    assert not done.free and done.hit and names == {"probe", "sheet"}
    assert 15 / 30 < done.t < 16 / 30
