"""A clock that survives jumps, and whom to tell of ends."""

import sqlalchemy as sa
from alembic import op

revision = "0006"
down_revision = "0005"
branch_labels = None
depends_on = None

_SEQUENCE = sa.BigInteger().with_variant(sa.Integer(), "sqlite")


def upgrade() -> None:
    """Create both tables."""
    op.create_table(
        "clock",
        sa.Column("id", sa.Integer, primary_key=True),
        sa.Column("believed", sa.Double, nullable=False),
        sa.Column("doubted", sa.Double, nullable=False),
    )
    op.create_table(
        "callbacks",
        sa.Column("sequence", _SEQUENCE, primary_key=True, autoincrement=True),
        sa.Column(
            "job_id", sa.String(32), sa.ForeignKey("jobs.id", ondelete="CASCADE"), index=True
        ),
        sa.Column(
            "batch_id", sa.String(32), sa.ForeignKey("batches.id", ondelete="CASCADE"), index=True
        ),
        sa.Column("url", sa.Text, nullable=False),
        sa.Column("due", sa.Double, nullable=False, index=True),
        sa.Column("tries", sa.Integer, nullable=False),
    )
