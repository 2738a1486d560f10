"""Authorities are read once a process: every client of httpx would read them, which takes 25 ms.

The tests make thousands of clients, nearly all of them for plain HTTP.
"""

import os
import ssl
from functools import cache
from typing import Any

import httpx
import httpx2

NAMES = ("SSL_CERT_FILE", "SSL_CERT_DIR")


def _kept(make: Any) -> Any:
    @cache
    def made(verify: bool, trust_env: bool, *_: str | None) -> ssl.SSLContext:
        return make(verify=verify, trust_env=trust_env)

    def kept(verify: Any = True, cert: Any = None, trust_env: bool = True) -> ssl.SSLContext:
        if cert is None and isinstance(verify, bool):
            return made(verify, trust_env, *map(os.environ.get, NAMES))
        return make(verify=verify, cert=cert, trust_env=trust_env)

    return kept


for library in (httpx, httpx2):
    transports = library._transports.default
    transports.create_ssl_context = _kept(transports.create_ssl_context)
