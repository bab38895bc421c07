"""Whom to tell of a vulnerability: ``/.well-known/security.txt`` (RFC 9116)."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

from fastapi import APIRouter, Request
from fastapi.responses import PlainTextResponse

from service.problems import NotFoundError

__all__ = ["router"]

router = APIRouter(include_in_schema=False)

_GOOD_FOR = timedelta(days=90)


@router.get("/.well-known/security.txt")
async def security(request: Request) -> PlainTextResponse:
    """Return the contact that the administrator has named."""
    contact: str | None = request.app.state.configuration.security_contact
    if contact is None:
        message = "No contact is named (MUTUNE_SECURITY_CONTACT); see SECURITY.md of mutune."
        raise NotFoundError(message)
    expires = (datetime.now(UTC) + _GOOD_FOR).strftime("%Y-%m-%dT00:00:00Z")
    return PlainTextResponse(
        f"Contact: {contact}\nExpires: {expires}\nPreferred-Languages: en\n",
        headers={"Cache-Control": "max-age=86400"},
    )
