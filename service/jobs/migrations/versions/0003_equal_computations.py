"""Digest of what a job computes, by which results of equal requests are found."""

import sqlalchemy as sa
from alembic import op

revision = "0003"
down_revision = "0002"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Add the column and its index; jobs from before have none and are not found."""
    op.add_column("jobs", sa.Column("computation", sa.String(64)))
    op.create_index("jobs_by_computation", "jobs", ["owner", "computation"])
