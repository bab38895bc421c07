"""Certificates that mu <= gamma at every frequency: record, document and independent check.

They are made by `solver.certificate.search`; nothing else here depends on how.
"""
