"""Index that counts the unfinished jobs of a caller, however many have ended."""

from alembic import op

revision = "0002"
down_revision = "0001"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Create the index."""
    op.create_index("jobs_by_state", "jobs", ["owner", "status"])
