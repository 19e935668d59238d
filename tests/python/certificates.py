"""Shared by tests of certificates: names of statuses, both checkers, and ways to tamper with documents."""

import copy
import json
import pathlib
import re
import subprocess

from clearance import Status

NAMES = [status.name.lower() for status in Status]


class Judges:
    """tools/check_certificate.py and, if it is built, the oracle in C++, which must reject the same rows."""

    def __init__(self, checker, program: "pathlib.Path | None"):
        self.checker, self.program, self.MALFORMED = checker, program, checker.MALFORMED

    def verdicts(self, document):
        """For each row, whether both find it proved, and the checker's message; or the checker's exception."""
        rejected = self.rejected(document) if self.program else None
        try:
            found = list(self.checker.verdicts(document))
        except self.checker.MALFORMED:
            assert rejected is None or rejected, "the judge finds good what the checker calls no certificate"
            raise
        if rejected is None:
            return iter(found)
        for place, (is_proved, why) in enumerate(found):
            assert is_proved or place in rejected, f"the judge finds row {place} good: {why}"
        return iter([(is_proved and place not in rejected, why) for place, (is_proved, why) in enumerate(found)])

    def each_rejects(self, document):
        """Whether the checker rejects any row, and whether the oracle does; True for the oracle if it is not built."""
        try:
            refuses = not all(is_proved for is_proved, _ in self.checker.verdicts(document))
        except self.checker.MALFORMED:
            refuses = True
        return [refuses, bool(len(self.rejected(document))) if self.program else refuses]

    def rejected(self, document):
        """The rows that the oracle rejects: a container, which is not empty if it finds an error."""
        text = json.dumps(document)
        done = subprocess.run([self.program, "/dev/stdin"], input=text, capture_output=True, text=True, check=False)
        assert done.stderr == "" and done.returncode in (0, 1), done.stderr
        if "no certificate: " in done.stdout:
            return range(10**9)
        found = re.findall(r"(?m)^/dev/stdin: rows\[(\d+)\]: NOT PROVED", done.stdout)
        rejected = {int(place) for place in found}
        assert bool(rejected) == bool(done.returncode), done.stdout
        return rejected


def turned(vector):
    return [[-high, -low] for high, low in vector]


def junk_rejected(checker, documents, rng, times):
    """Number of rejections of junk in place of any part of one of the documents; nothing else may result from it."""
    junk = [None, True, -1, 0, 1e300, "inf", "nan", "", [], {}, [[]], {"a": 1}, 10**400, [1, 2, 3]]
    found = 0
    for _ in range(times):
        document = copy.deepcopy(rng.choice(documents))
        part = document
        while True:
            key = rng.choice(sorted(part) if isinstance(part, dict) else range(len(part)))
            if not isinstance(part[key], (dict, list)) or not part[key] or rng.random() < 0.15:
                break
            part = part[key]
        part[key] = rng.choice(junk)
        try:
            found += not all(is_proved for is_proved, _ in checker.verdicts(document))
        except checker.MALFORMED:
            found += 1
    return found
