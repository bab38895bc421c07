"""What an administrator installs by: bill of materials, unit of systemd, compose file, image."""

from __future__ import annotations

import importlib.util
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest
import yaml
from packaging.requirements import Requirement

ROOT = Path(__file__).parent.parent


def bill() -> dict[str, Any]:
    """Return the bill of materials of the lock."""
    spec = importlib.util.spec_from_file_location("sbom", ROOT / "scripts" / "sbom.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    document: dict[str, Any] = module.document(module.LOCK.read_text(), "1.0")
    return document


def test_bill_of_materials_lists_what_is_locked() -> None:
    """Each requirement with its version and hashes, and what requires it."""
    document = bill()
    assert (document["bomFormat"], document["specVersion"]) == ("CycloneDX", "1.6")
    text = (ROOT / "requirements" / "run.txt").read_text()
    pins = re.findall(r"^([a-zA-Z0-9._-]+)==([^ ;\\]+)", text, re.MULTILINE)
    parts = {(part["name"], part["version"]) for part in document["components"]}
    assert {(name.lower().replace("_", "-").replace(".", "-"), pin) for name, pin in pins} == parts
    assert len(document["components"]) == len(parts)
    hashes = sum(len(part["hashes"]) for part in document["components"])
    assert hashes == text.count("--hash=sha256:")
    references = {part["bom-ref"] for part in document["components"]}
    own, *others = document["dependencies"]
    assert "numba" in {Requirement(ref.partition("pypi/")[2].replace("@", "==")).name
                       for ref in own["dependsOn"]}  # fmt: skip
    assert {ref for each in (own, *others) for ref in each["dependsOn"]} <= references
    assert bill() == document


def test_unit_of_systemd_is_one_and_shuts_the_service_in() -> None:
    """Checked by systemd itself, where that is there."""
    unit = ROOT / "deploy" / "mutune.service"
    text = unit.read_text()
    for line in ("NoNewPrivileges=yes", "ProtectSystem=strict", "CapabilityBoundingSet="):
        assert f"{line}\n" in text
    program = shutil.which("systemd-analyze")
    if program is None:
        pytest.skip("systemd-analyze is not installed")
    checked = subprocess.run(  # noqa: S603 - as found on the PATH
        [program, "verify", str(unit)], capture_output=True, text=True, check=False
    )
    faults = [line for line in checked.stderr.splitlines() if "mutune.service" in line]
    # The program is where it will be installed.
    assert [line for line in faults if "/opt/mutune/bin/mutune" not in line] == []


def test_containers_have_few_rights_and_so_much_memory() -> None:
    """Each service of the compose file."""
    services = yaml.safe_load((ROOT / "compose.yaml").read_text())["services"]
    for name, service in services.items():
        assert service["read_only"] is True, name
        assert service["cap_drop"] == ["ALL"], name
        assert service["security_opt"] == ["no-new-privileges:true"], name
        assert service["mem_limit"], name
        assert service["pids_limit"], name


def test_image_compiles_before_it_gives_up_its_rights() -> None:
    """The kernels lie beside the modules, which the user of the service cannot change."""
    lines = (ROOT / "Dockerfile").read_text().splitlines()
    compiles = next(n for n, line in enumerate(lines) if "solver.warm" in line)
    user = next(n for n, line in enumerate(lines) if line.startswith("USER "))
    assert compiles < user
    assert not any("NUMBA_CACHE_DIR" in line for line in lines)


def test_bundle_is_made_by_a_script_that_bash_can_read() -> None:
    """And installs from its own folder alone, by hashes."""
    script = ROOT / "scripts" / "bundle"
    subprocess.run(["/bin/bash", "-n", str(script)], check=True)  # noqa: S603 - our own
    text = script.read_text()
    assert "--no-index" in text
    assert text.count("--require-hashes") == 2
