"""Certificates that mu <= gamma at every frequency: record, document and independent check.

They are made by `solver.certificate.search`; nothing here depends on how.
"""

from solver.certificate.reading import read_certificate
from solver.certificate.record import Certificate, Claim, ProvenInterval
from solver.certificate.verify import Verdict, Verification, check, verify

__all__ = [
    "Certificate",
    "Claim",
    "ProvenInterval",
    "Verdict",
    "Verification",
    "check",
    "read_certificate",
    "verify",
]
