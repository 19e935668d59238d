"""All requests of one client."""

from __future__ import annotations

from .query_requests import QueryRequests
from .updates import UpdateRequests


class Session(QueryRequests, UpdateRequests):
    """Requests of one client over a connection. Not thread-safe."""
