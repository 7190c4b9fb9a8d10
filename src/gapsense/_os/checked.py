"""Facts as JSON with a checksum."""

from __future__ import annotations

import json
from collections.abc import Mapping
from hashlib import sha256
from typing import Any

SEAL = "checksum"  # of a file of JSON


def fingerprint(facts: Any) -> str:
    """Hash of facts of JSON, whatever the order of names in them."""
    return sha256(json.dumps(facts, sort_keys=True).encode()).hexdigest()


def sealed(facts: Mapping[str, Any]) -> dict[str, Any]:
    """Facts as JSON has them, with their hash."""
    plain = json.loads(json.dumps(facts))
    return {**plain, SEAL: fingerprint(plain)}


def is_sealed(facts: Mapping[str, Any]) -> bool:
    """Whether facts are those that were sealed."""
    return facts.get(SEAL) == fingerprint({name: value for name, value in facts.items() if name != SEAL})
