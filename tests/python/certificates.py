"""What tests of certificates share: names of statuses, and ways to tamper with documents."""

import copy

from clearance import Status

NAMES = [status.name.lower() for status in Status]


def turned(vector):
    return [[-high, -low] for high, low in vector]


def junk_refused(checker, documents, rng, times):
    """How often junk in place of any part of one of the documents is not found good; nothing else may come of it."""
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
