"""Alembic's entry point: migrates over the connection that `service.jobs.database` passes."""

from alembic import context

from service.jobs.models import Base

context.configure(connection=context.config.attributes["connection"], target_metadata=Base.metadata)
context.run_migrations()
