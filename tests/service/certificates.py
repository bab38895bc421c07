"""Certificates of a test: authority, certificate and key, all in one."""

from __future__ import annotations

from pathlib import Path

from distributed import Security


def certificates(folder: Path) -> dict[str, str]:
    """Write a certificate and its key; return the variables that name them."""
    own = Security.temporary()
    certificate, key = folder / "cluster.pem", folder / "cluster.key"
    certificate.write_text(own.tls_ca_file)
    key.write_text(own.tls_worker_key)
    return {
        "MUTUNE_TLS_CA_FILE": str(certificate),
        "MUTUNE_TLS_CERT_FILE": str(certificate),
        "MUTUNE_TLS_KEY_FILE": str(key),
    }
