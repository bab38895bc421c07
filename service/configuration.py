"""Settings of the service, read from ``MUTUNE_*`` environment variables."""

from __future__ import annotations

import os
import sys
from pathlib import Path

from pydantic import Field
from pydantic_settings import BaseSettings, SettingsConfigDict

__all__ = ["Configuration"]


def _default_data_dir() -> Path:
    """Return the user's folder for application data."""
    if sys.platform == "darwin":
        base = Path.home() / "Library" / "Application Support"
    elif sys.platform == "win32":
        base = Path(os.environ.get("LOCALAPPDATA", Path.home() / "AppData" / "Local"))
    else:
        base = Path(os.environ.get("XDG_DATA_HOME", Path.home() / ".local" / "share"))
    return base / "mutune"


class Configuration(BaseSettings):
    """Settings of the service."""

    model_config = SettingsConfigDict(env_prefix="MUTUNE_", extra="ignore", frozen=True)

    data_dir: Path = Field(
        default_factory=_default_data_dir, description="Folder of the SQLite file."
    )
    database_url: str | None = Field(
        default=None,
        description="postgresql+psycopg://user:password@host/name; unset: SQLite in data_dir.",
    )
    scheduler: str | None = Field(
        default=None,
        description="Address of a Dask scheduler; unset: local worker processes.",
    )
    workers: int = Field(
        default_factory=lambda: os.cpu_count() or 1,
        ge=1,
        description="Local worker processes, where no scheduler is set.",
    )
    analysis_processes: int = Field(
        default=1, ge=1, description="Processes for analyses within the request."
    )
    analysis_time_limit: float = Field(
        default=30.0, gt=0, description="Longest analysis within the request, seconds."
    )
    max_body_bytes: int = Field(
        default=1_000_000, ge=1, description="Largest request body, batches excepted."
    )
    max_batch_bytes: int = Field(default=64_000_000, ge=1, description="Largest body of a batch.")
    max_batch_items: int = Field(default=10_000, ge=1, description="Tunings in a batch.")
    max_queued: int = Field(
        default=100_000, ge=1, description="Jobs that one caller may have in the queue."
    )
    max_time_limit: float = Field(
        default=3600.0, gt=0, description="Longest time limit of a job, seconds."
    )
    requests_per_minute: int = Field(
        default=6000, ge=1, description="Requests that one API key may make."
    )
    retention_days: float = Field(
        default=30.0, gt=0, description="Days that a finished job is kept."
    )
    api_keys_file: Path | None = Field(
        default=None, description="File of API keys; unset: no keys, for loopback only."
    )
    cors_origins: tuple[str, ...] = Field(
        default=(), description="Origins whose pages may call; JSON list. Default: none."
    )
    worker_wait: float = Field(
        default=120.0,
        gt=0,
        description="Longest wait of a batch for the first worker of a scheduler, seconds.",
    )
    max_wait: float = Field(
        default=60.0, gt=0, description="Longest wait that `Prefer: wait=N` gets, seconds."
    )
    max_attempts: int = Field(
        default=3, ge=1, description="Workers that a job may lose before it counts as failed."
    )

    @property
    def url(self) -> str:
        """Database URL."""
        return self.database_url or f"sqlite:///{self.data_dir / 'mutune.sqlite3'}"
