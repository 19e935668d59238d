"""Certificates that come through the daemon equal those of the engine, and a program without Clearance's code proves
them."""

import subprocess
import sys

import numpy as np
import pytest

import clearance
from patience import PATIENCE_S
from robots import rows_of

pytestmark = pytest.mark.filterwarnings("ignore::clearance.MeshWarning")


@pytest.fixture
def client(daemon, kind):
    with clearance.connect(daemon.urls[kind], timeout_s=PATIENCE_S) as client:
        yield client


def proved(root, tmp_path, certificate, rows):
    """The document, all of whose rows the separate checker has proved."""
    path = tmp_path / "rows.json"
    certificate.save(path)
    command = [sys.executable, str(root / "tools" / "check_certificate.py"), str(path)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout
    assert done.stdout.endswith(f"{rows} of {rows} rows are proved\n")
    return certificate.document


def test_rows_are_proved_and_are_those_of_distances(client, root, tmp_path):
    result = client.distances(signed_distance=True)
    numbers = list(range(0, result.lower.size, 7))
    document = proved(root, tmp_path, client.certificate(numbers, signed_distance=True), len(numbers))
    assert [row["row"] for row in document["rows"]] == numbers
    for name in ("lower", "upper"):
        bounds = np.array([float(row[name]) for row in document["rows"]])
        assert np.array_equal(bounds, getattr(result, name).ravel()[numbers]), name


def test_links_in_configurations_are_proved(arm_daemon, arm_engine, kind, root, tmp_path):
    with clearance.connect(arm_daemon.urls[kind], timeout_s=PATIENCE_S) as client:
        arm = client.joints("arm")
        requested = {"joints": arm.names, "configurations": rows_of(arm, 4)}
        count = client.distances(**requested).lower.size
        document = proved(root, tmp_path, client.certificate(**requested), count)
        assert {row["configuration"] for row in document["rows"]} == {0, 1, 2, 3}
        assert document["rows"] == arm_engine.certificate(**requested).document["rows"]


def test_motions_are_proved(arm_daemon, arm_engine, kind, root, tmp_path):
    with clearance.connect(arm_daemon.urls[kind], timeout_s=PATIENCE_S) as client:
        arm = client.joints("arm")
        start = rows_of(arm, 1)
        requested = {
            "joints": arm.names,
            "start": start,
            "end": start + 0.05,
            "reduce": "none",
            "pairs": ("arm", "cup"),
        }
        requested["margin"] = 0.4  # which a pair reaches during its motion
        result = client.motions(**requested)
        document = proved(root, tmp_path, client.certificate(**requested), result.lower.size)
        assert [row["lower"] for row in document["rows"]] == result.lower.ravel().tolist()
        assert [row["upper"] for row in document["rows"]] == result.upper.ravel().tolist()
        first = [[float(row["first_contact"][name]) for name in ("free_until", "hit_at")] for row in document["rows"]]
        assert first == result.first_contact.reshape(-1, 2).tolist()
        assert any(until < hit < np.inf for until, hit in first), "something is hit"
        assert any(len(pair["spans"]) > 1 for row in document["rows"] for pair in row["pairs"]), "not all overlap"
        assert document["rows"] == arm_engine.certificate(**requested).document["rows"]


def test_what_is_refused_is_named(client):
    with pytest.raises(clearance.QueryError, match=r"rows\[1\]: expected one of \d+ rows, got 100000"):
        client.certificate(rows=[0, 100000])
    with pytest.raises(clearance.QueryError, match="only rows of reduce none"):
        client.certificate(reduce="min")
    with pytest.raises(clearance.QueryError, match=r"at most 100000 rows at a time, got 100001"):
        client.certificate(rows=[0] * 100001)
    with pytest.raises(ValueError, match=r"rows\[0\]: expected an integer >= 0"):
        client.certificate(rows=[-1])
    assert client.certificate(rows=[]).document["rows"] == []
    assert client.distances(reduce="min").lower.size == 1


def test_a_tampered_one_is_found(client, root, tmp_path):
    certificate = client.certificate([0])
    row = certificate.document["rows"][0]
    text = certificate.to_json()
    assert row["status"] == "ok" and text.count(f'"lower":{row["lower"]!r}') == 2, "the row's, and that of its pair"
    path = tmp_path / "rows.json"
    path.write_text(text.replace(f'"lower":{row["lower"]!r}', f'"lower":{row["lower"] * 1.001!r}'))
    command = [sys.executable, str(root / "tools" / "check_certificate.py"), str(path)]
    assert subprocess.run(command, capture_output=True).returncode == 1
