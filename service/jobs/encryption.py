"""TLS between service, scheduler and workers, each of which runs whatever the others send it.

Dask trusts everyone who reaches its ports. A cluster of this machine alone therefore gets a key
that exists in memory only; one of several machines takes the files that the settings name. Both
sides show a certificate of the same authority, so who has none is refused before a word is read.
"""

from __future__ import annotations

from distributed import Security

from service.configuration import Configuration

__all__ = ["for_cluster", "for_this_machine", "protocol"]


def for_this_machine() -> Security:
    """Return a new certificate with its key, for one cluster of processes of this machine."""
    own: Security = Security.temporary()
    return own


def for_cluster(configuration: Configuration) -> Security | None:
    """Return the certificate that the settings name, for every part of the cluster; or None."""
    certificate = configuration.tls_cert_file
    if certificate is None:
        return None
    parts = ("client", "scheduler", "worker")
    return Security(
        require_encryption=True,
        tls_ca_file=str(configuration.tls_ca_file),
        **{f"tls_{part}_cert": str(certificate) for part in parts},
        **{f"tls_{part}_key": str(configuration.tls_key_file) for part in parts},
    )


def protocol(security: Security | None) -> str:
    """Return the scheme of addresses."""
    return "tcp" if security is None else "tls"
