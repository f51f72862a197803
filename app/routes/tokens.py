"""POST /tokens: short-lived tokens for links that cannot have an API key."""

from datetime import UTC, datetime

from fastapi import APIRouter, Request

from app.http.problems import documented
from app.roles import Key
from app.schemas.tokens import Token
from app.state import State
from services.errors import DocumentError

router = APIRouter(tags=["tokens"])


class NoKeys(DocumentError):
    """The service has no API keys, so there is nothing to make a token from."""

    code = "not-found"


@router.post("/tokens", operation_id="create_token", status_code=201, responses=documented("not-found"))
async def create_token(request: Request, state: State) -> Token:
    """Make a token that allows to read (GET) with the request's API key for TOKEN_TTL_S seconds.

    Browsers send no headers with images and `EventSource`. Such a link has the token as the query option `token`:
    `/jobs/{id}/events?token=...`. The token does not contain the key, and it cannot change anything.
    """
    key: Key | None = request.state.key
    if key is None:
        raise NoKeys("No API keys are configured: links need no token.")
    token, expires_s = state.tokens.make(key)
    return Token(
        token=token, expires=datetime.fromtimestamp(expires_s, UTC), ttl_s=state.settings.token_ttl_s
    )
