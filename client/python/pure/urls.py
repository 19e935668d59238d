"""Urls and keys of daemons. Messages are those of the C++ client (client/channel/url.cpp, wire/key_file.cpp)."""

from __future__ import annotations

import os
import stat
from typing import Optional

from .._errors import ConnectionError

#: server_key and key: paths of files, or empty.
Keys = tuple[str, str]

_Z85 = set("0123456789abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ.-:+=^!/*?&<>()[]{}@%$#")


def check_url(url: str) -> None:
    """Raises ValueError for a url of an unknown kind."""
    kind, _, rest = url.partition("://")
    if kind == "shm":
        if not rest.startswith("/"):
            raise ValueError(
                f'"{url}": the path of the socket must be absolute, as in shm:///run/user/1000/clearance.sock'
            )
    elif kind in ("ipc", "tcp"):
        endpoint, _, options = rest.partition("?")
        if kind == "ipc":
            endpoint, options = rest, ""
        for option in filter(None, options.split("&")):
            if option.partition("=")[0] not in ("server_key", "key"):
                raise ValueError(f'"{url}": "{option}" is not an option: expected server_key=FILE&key=FILE')
        if not endpoint:
            raise ValueError(f'"{url}": the endpoint is missing, as in ipc:///run/user/1000/clearance.ipc')
    elif kind != "udpm":
        raise ValueError(
            f'"{url}" is not a url of a daemon: expected shm:///path, ipc:///path, tcp://host:port or '
            "udpm://group:port?ttl=0"
        )


def keys_of(url: str, given: Keys) -> Optional[tuple[str, str, str]]:
    """Returns the daemon's public key and the client's key pair, from the options, the url or the environment."""
    if not url.startswith("tcp://"):
        return None
    in_url = dict(option.partition("=")[::2] for option in url.partition("?")[2].split("&"))
    names = (("server_key", "CLEARANCE_SERVER_KEY"), ("key", "CLEARANCE_KEY"))
    server, own = (
        path or in_url.get(name, "") or os.environ.get(variable, "") for path, (name, variable) in zip(given, names)
    )
    if bool(server) != bool(own):
        missing = "key" if server else "server_key"
        raise ValueError(f"{url}: needs both the daemon's key and this client's; {missing} is missing")
    if not server:
        return None
    try:
        public, secret = _read_key(own)
        if not secret:
            raise RuntimeError(f"{own}: there is no secret key in it")
        if stat.S_IMODE(os.stat(own).st_mode) & 0o077:
            raise RuntimeError(f"{own}: others may read this secret key; chmod 600 it")
        return _read_key(server)[0], public, secret
    except RuntimeError as error:
        raise ConnectionError(f"{url}: {error}") from None


def _read_key(path: str) -> tuple[str, str]:
    """Reads public and secret key from a file with one key, or with "public" and "secret" and a key each."""
    try:
        with open(path) as file:
            words = iter(file.read().split())
    except OSError as error:
        raise RuntimeError(f"{path}: {error.strerror}") from None
    keys = {"public": "", "secret": ""}
    for word in words:
        kind = word if word in keys else "public"
        key = next(words, "") if word in keys else word
        if not key:
            raise RuntimeError(f"{path}: a key is missing")
        if len(key) != 40 or not set(key) <= _Z85:
            raise RuntimeError(f"{path}: expected a key of 40 characters (Z85), as clearance keygen writes it")
        keys[kind] = key
    if not keys["public"]:
        raise RuntimeError(f"{path}: there is no public key in it")
    return keys["public"], keys["secret"]
