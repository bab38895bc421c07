"""Jobs are of several kinds, each a resource of its own."""

import sqlalchemy as sa
from alembic import op

revision = "0007"
down_revision = "0006"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Name the resource of what is there: tunings."""
    column = sa.Column("resource", sa.String(32), nullable=False, server_default="tunings")
    op.add_column("jobs", column)
