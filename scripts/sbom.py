"""Write what an installation consists of, as CycloneDX 1.6: ``python scripts/sbom.py FILE.json``.

Components are the locked requirements with the hashes that pip checks; licences are what the
installed packages declare. The same lock gives the same file.
"""

from __future__ import annotations

import json
import re
import sys
import uuid
from importlib.metadata import PackageNotFoundError, metadata, requires
from pathlib import Path
from typing import Any

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parent.parent
LOCK = ROOT / "requirements" / "run.txt"
_NAMESPACE = uuid.UUID("6d757475-6e65-4000-8000-000000000000")


def document(lock: str, version: str) -> dict[str, Any]:
    """Return the bill of materials of a lock file's text."""
    text = lock.replace("\\\n", " ")
    parts = [_component(line) for line in text.splitlines() if line.strip()]
    names = {part["name"]: part["bom-ref"] for part in parts}
    own = f"pkg:pypi/mutune@{version}"
    return {
        "bomFormat": "CycloneDX",
        "specVersion": "1.6",
        "serialNumber": f"urn:uuid:{uuid.uuid5(_NAMESPACE, version + text)}",
        "version": 1,
        "metadata": {
            "component": {
                "type": "application",
                "bom-ref": own,
                "name": "mutune",
                "version": version,
                "purl": own,
                "licenses": [{"license": {"id": "MIT"}}],
            }
        },
        "components": parts,
        "dependencies": [
            {"ref": own, "dependsOn": _needed("mutune", names)},
            *({"ref": ref, "dependsOn": _needed(name, names)} for name, ref in names.items()),
        ],
    }


def _component(line: str) -> dict[str, Any]:
    given, *hashes = line.split("--hash=sha256:")
    requirement = Requirement(given.strip())
    name = canonicalize_name(requirement.name)
    (pin,) = requirement.specifier
    purl = f"pkg:pypi/{name}@{pin.version}"
    found: dict[str, Any] = {
        "type": "library",
        "bom-ref": purl,
        "name": name,
        "version": pin.version,
        "purl": purl,
        "hashes": [{"alg": "SHA-256", "content": value.strip()} for value in hashes],
        "scope": "required" if requirement.marker is None else "optional",
    }
    if licence := _licence(name):
        found["licenses"] = [licence]
    if requirement.marker is not None:
        found["properties"] = [{"name": "pip:marker", "value": str(requirement.marker)}]
    return found


def _licence(name: str) -> dict[str, Any] | None:
    """Return the licence that an installed package declares."""
    try:
        declared = metadata(name)
    except PackageNotFoundError:  # of another system
        return None
    if expression := declared.get("License-Expression"):
        return {"expression": expression}
    named = [
        line.rpartition(" :: ")[2]
        for line in declared.get_all("Classifier") or []
        if line.startswith("License :: ")
    ]
    text = named[0] if named else (declared.get("License") or "").partition("\n")[0]
    return {"license": {"name": text[:100]}} if text else None


def _needed(name: str, names: dict[str, str]) -> list[str]:
    """Return what an installed package requires, of what is in the lock."""
    try:
        given = requires(name) or []
    except PackageNotFoundError:
        return []
    plain = [text for text in given if not re.search(r"extra\s*==", text)]
    found = {canonicalize_name(Requirement(text).name) for text in plain}
    return sorted(names[each] for each in found & names.keys())


def main() -> None:
    """Write the file."""
    from importlib.metadata import version  # noqa: PLC0415 - of this installation

    result = document(LOCK.read_text(encoding="utf-8"), version("mutune"))
    Path(sys.argv[1]).write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
