"""The tables."""

from __future__ import annotations

from sqlalchemy import (
    BigInteger,
    Boolean,
    Double,
    ForeignKey,
    Index,
    Integer,
    String,
    Text,
    UniqueConstraint,
)
from sqlalchemy.orm import DeclarativeBase, Mapped, mapped_column

from service.jobs.packed import PackedText

__all__ = ["Base", "BatchItemRow", "BatchRow", "CallbackRow", "ClockRow", "JobRow"]

# SQLite numbers rows by itself for INTEGER PRIMARY KEY only.
_Sequence = BigInteger().with_variant(Integer(), "sqlite")


class Base(DeclarativeBase):
    """Base of the tables."""


class BatchRow(Base):
    """A batch of tunings; `sequence` orders the batches."""

    __tablename__ = "batches"
    __table_args__ = (
        UniqueConstraint("owner", "idempotency_key"),
        {"sqlite_autoincrement": True},
    )

    sequence: Mapped[int] = mapped_column(_Sequence, primary_key=True, autoincrement=True)
    id: Mapped[str] = mapped_column(String(32), unique=True)
    owner: Mapped[str] = mapped_column(String(64))
    created_at: Mapped[float] = mapped_column(Double)
    count: Mapped[int] = mapped_column(Integer)
    idempotency_key: Mapped[str | None] = mapped_column(String(255))
    digest: Mapped[str] = mapped_column(String(64))


class JobRow(Base):
    """A job; times are seconds since 1970, `sequence` orders the jobs."""

    __tablename__ = "jobs"
    __table_args__ = (
        UniqueConstraint("owner", "idempotency_key"),
        Index("jobs_by_share", "status", "owner", "priority", "sequence"),
        Index("jobs_by_owner", "owner", "sequence"),
        Index("jobs_by_state", "owner", "status"),
        Index("jobs_by_end", "finished_at"),
        Index("jobs_by_computation", "owner", "computation"),
        {"sqlite_autoincrement": True},  # a cursor must not meet a reused number
    )

    sequence: Mapped[int] = mapped_column(_Sequence, primary_key=True, autoincrement=True)
    id: Mapped[str] = mapped_column(String(32), unique=True)
    owner: Mapped[str] = mapped_column(String(64))
    resource: Mapped[str] = mapped_column(String(32))
    batch_id: Mapped[str | None] = mapped_column(
        ForeignKey("batches.id", ondelete="CASCADE"), index=True
    )
    priority: Mapped[int] = mapped_column(Integer)
    status: Mapped[str] = mapped_column(String(10))
    attempts: Mapped[int] = mapped_column(Integer)
    cancel_requested: Mapped[bool] = mapped_column(Boolean)
    fraction: Mapped[float] = mapped_column(Double)
    best: Mapped[float | None] = mapped_column(Double)
    created_at: Mapped[float] = mapped_column(Double)
    started_at: Mapped[float | None] = mapped_column(Double)
    finished_at: Mapped[float | None] = mapped_column(Double)
    idempotency_key: Mapped[str | None] = mapped_column(String(255))
    digest: Mapped[str] = mapped_column(String(64))
    computation: Mapped[str | None] = mapped_column(String(64))
    time_limit: Mapped[float] = mapped_column(Double)
    request: Mapped[str] = mapped_column(Text)
    error: Mapped[str | None] = mapped_column(Text)
    result: Mapped[str | None] = mapped_column(PackedText)


class BatchItemRow(Base):
    """Position of a job in a batch; equal requests share one job."""

    __tablename__ = "batch_items"

    batch_id: Mapped[str] = mapped_column(
        ForeignKey("batches.id", ondelete="CASCADE"), primary_key=True
    )
    position: Mapped[int] = mapped_column(Integer, primary_key=True)
    job_id: Mapped[str] = mapped_column(ForeignKey("jobs.id", ondelete="CASCADE"), index=True)


class ClockRow(Base):
    """The one row of the clock that retention goes by, see `service.jobs.retention`."""

    __tablename__ = "clock"

    id: Mapped[int] = mapped_column(Integer, primary_key=True)
    believed: Mapped[float] = mapped_column(Double)
    doubted: Mapped[float] = mapped_column(Double)


class CallbackRow(Base):
    """Whom to tell of the end of a job or a batch; gone once that is done."""

    __tablename__ = "callbacks"

    sequence: Mapped[int] = mapped_column(_Sequence, primary_key=True, autoincrement=True)
    job_id: Mapped[str | None] = mapped_column(
        ForeignKey("jobs.id", ondelete="CASCADE"), index=True
    )
    batch_id: Mapped[str | None] = mapped_column(
        ForeignKey("batches.id", ondelete="CASCADE"), index=True
    )
    url: Mapped[str] = mapped_column(Text)
    due: Mapped[float] = mapped_column(Double, index=True)
    tries: Mapped[int] = mapped_column(Integer)
