"""Results are held compressed."""

import sqlalchemy as sa
from alembic import op

from service.jobs.packed import pack

revision = "0004"
down_revision = "0003"
branch_labels = None
depends_on = None

_MANY = 500  # results in memory at once
_JOBS = sa.table(
    "jobs",
    sa.column("sequence", sa.BigInteger),
    sa.column("result", sa.Text),
    sa.column("packed", sa.LargeBinary),
)


def upgrade() -> None:
    """Compress what is there, part by part; the room that falls free is used for new rows."""
    op.add_column("jobs", sa.Column("packed", sa.LargeBinary))
    connection = op.get_bind()
    done = 0
    while rows := connection.execute(
        sa.select(_JOBS.c.sequence, _JOBS.c.result)
        .where(_JOBS.c.sequence > done, _JOBS.c.result.is_not(None))
        .order_by(_JOBS.c.sequence)
        .limit(_MANY)
    ).all():
        connection.execute(
            sa.update(_JOBS)
            .where(_JOBS.c.sequence == sa.bindparam("row"))
            .values(packed=sa.bindparam("text")),
            [{"row": row.sequence, "text": pack(row.result)} for row in rows],
        )
        done = rows[-1].sequence
    op.drop_column("jobs", "result")
    op.execute("ALTER TABLE jobs RENAME COLUMN packed TO result")
