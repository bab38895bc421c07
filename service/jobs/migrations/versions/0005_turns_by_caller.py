"""Each caller has a queue of its own."""

from alembic import op

revision = "0005"
down_revision = "0004"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Index the queue by caller."""
    op.create_index("jobs_by_share", "jobs", ["status", "owner", "priority", "sequence"])
    op.drop_index("jobs_by_turn", "jobs")
