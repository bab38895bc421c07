"""Settings of the service, read from ``MUTUNE_*`` environment variables."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import Annotated
from urllib.parse import urlsplit

from pydantic import BeforeValidator, Field, model_validator
from pydantic_settings import BaseSettings, NoDecode, SettingsConfigDict

__all__ = ["Configuration"]


_SECRET_BYTES = 32
_TLS_PAIR = ("tls_cert_file", "tls_key_file")


def _default_data_dir() -> Path:
    """Return the user's folder for application data."""
    if sys.platform == "darwin":
        base = Path.home() / "Library" / "Application Support"
    elif sys.platform == "win32":
        base = Path(os.environ.get("LOCALAPPDATA", Path.home() / "AppData" / "Local"))
    else:
        base = Path(os.environ.get("XDG_DATA_HOME", Path.home() / ".local" / "share"))
    return base / "mutune"


def _listed(value: object) -> object:
    """Return the list that the text of a variable stands for."""
    if not isinstance(value, str):
        return value
    try:
        return json.loads(value)
    except ValueError:
        message = 'write it as a JSON list: ["one", "two"]'
        raise ValueError(message) from None


_Names = Annotated[tuple[str, ...], NoDecode, BeforeValidator(_listed)]


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
    tls_ca_file: Path | None = Field(
        default=None, description="Certificate authority of scheduler, workers and service, PEM."
    )
    tls_cert_file: Path | None = Field(
        default=None, description="Certificate among scheduler, workers and service, PEM."
    )
    tls_key_file: Path | None = Field(default=None, description="Key of that certificate, PEM.")
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
    analysis_memory: int = Field(
        default=700_000_000,
        ge=200_000_000,  # what the libraries of the solver take before anything is computed
        description="Memory that the process of an analysis may take, bytes.",
    )
    max_body_bytes: int = Field(
        default=1_000_000, ge=1, description="Largest request body, batches excepted."
    )
    max_batch_bytes: int = Field(default=64_000_000, ge=1, description="Largest body of a batch.")
    max_batch_items: int = Field(default=10_000, ge=1, description="Tunings in a batch.")
    max_queued: int = Field(
        default=100_000, ge=1, description="Jobs that one caller may have in the queue."
    )
    max_running: int | None = Field(
        default=None,
        ge=1,
        description="Jobs of one caller that run at once; unset: as many as there are workers.",
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
    callback_urls: _Names = Field(
        default=(),
        description="URLs below which callers may name one to be told of ends; JSON list.",
    )
    callback_key_file: Path | None = Field(
        default=None, description="File of the secret that signs such notices, 32 bytes or more."
    )
    security_contact: Annotated[str, Field(pattern=r"^(mailto:|https://|tel:)\S+$")] | None = Field(
        default=None,
        description="Whom to tell of vulnerabilities, mailto: or https:, for security.txt.",
    )
    audit_file: Path | None = Field(
        default=None,
        description="File to which a line is added for each act; unset: they are in the log.",
    )
    allowed_hosts: _Names = Field(
        default=(),
        description="Names of this service beside localhost, addresses and the machine's own; "
        "JSON list. Unset: with API keys any name.",
    )
    cors_origins: _Names = Field(
        default=(), description="Origins whose pages may call; JSON list. Default: none."
    )
    worker_wait: float = Field(
        default=120.0,
        gt=0,
        description="Longest wait of a batch for the first worker of a scheduler, seconds.",
    )
    start_wait: float = Field(
        default=60.0,
        ge=0,
        description="How long a start waits for a database that does not answer yet, seconds.",
    )
    max_connections: int = Field(
        default=2000, ge=1, description="Open connections, beyond which requests get 503."
    )
    max_wait: float = Field(
        default=60.0, gt=0, description="Longest wait that `Prefer: wait=N` gets, seconds."
    )
    max_attempts: int = Field(
        default=3, ge=1, description="Workers that a job may lose before it counts as failed."
    )

    @model_validator(mode="after")
    def _complete(self) -> Configuration:
        """Refuse a part of the files that TLS needs."""
        files = {name: getattr(self, name) for name in ("tls_ca_file", *_TLS_PAIR)}
        missing = [name for name, path in files.items() if path is None]
        if missing and len(missing) < len(files):
            names = ", ".join(f"MUTUNE_{name.upper()}" for name in missing)
            message = f"set {names} too: TLS needs all three files"
            raise ValueError(message)
        for name, path in files.items():
            if path is not None and not path.is_file():
                message = f"MUTUNE_{name.upper()}: there is no file {path}"
                raise ValueError(message)
        return self

    @model_validator(mode="after")
    def _signed(self) -> Configuration:
        """Refuse callbacks that nothing signs."""
        if not self.callback_urls:
            return self
        for url in self.callback_urls:
            parts = urlsplit(url)
            if parts.scheme not in {"http", "https"} or not parts.hostname:
                message = f"MUTUNE_CALLBACK_URLS: {url} is no http or https URL"
                raise ValueError(message)
        try:
            secret = self.callback_key_file.read_bytes().strip() if self.callback_key_file else b""
        except OSError as error:
            message = f"MUTUNE_CALLBACK_KEY_FILE: {error.strerror}"
            raise ValueError(message) from None
        if len(secret) < _SECRET_BYTES:
            message = f"MUTUNE_CALLBACK_KEY_FILE: name a file of {_SECRET_BYTES} bytes or more"
            raise ValueError(message)
        return self

    @property
    def url(self) -> str:
        """Database URL."""
        return self.database_url or f"sqlite:///{self.data_dir / 'mutune.sqlite3'}"
