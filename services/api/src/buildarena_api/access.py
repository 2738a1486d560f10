"""Identity and permissions of a request's sender: API keys, scopes and rate limits.

Reading needs the scope ``read``, everything else ``submit``, the service's own affairs ``admin``;
each includes those before it. The scope ``runner`` is separate: it may lease trials, as no other
scope may, and nothing else. Only its owner or an admin may change a submission. Where the operator
requires no keys, which is allowed on loopback only, every caller is admin.
"""

from __future__ import annotations

import hmac
from collections.abc import AsyncIterator, Awaitable, Callable, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from fastapi import Depends, Request
from fastapi.security import HTTPAuthorizationCredentials, HTTPBearer
from fastapi.security.utils import get_authorization_scheme_param
from sqlalchemy.exc import OperationalError
from sqlalchemy.exc import TimeoutError as PoolTimeoutError
from starlette.datastructures import Headers
from starlette.types import Scope

from buildarena_api.dependencies import Services, services_of
from buildarena_api.http.bodies import Admit
from buildarena_api.http.places import Kind
from buildarena_api.http.problems import ErrorCode, ProblemError, database_problem
from buildarena_api.http.rate_limits import Count, RateLimits
from buildarena_backend.leases.runner_leases import runner_prefix
from buildarena_backend.settings import Settings

SCOPES = ("read", "submit", "admin")
"""From the least to the most; each includes those before it."""
RUNNER = "runner"
"""The scope of runner keys, which have no other."""
LOOPBACK = ("127.0.0.1", "::1", "localhost")
METRICS_PATH = "/v1/metrics"
OPERATOR = "operator"
"""Name under which the operator's open requests count."""
READING = ("GET", "HEAD", "OPTIONS")
_KEYS = HTTPBearer(auto_error=False, description="An API key, of `buildarena admin key create`")
GivenKey = Annotated[HTTPAuthorizationCredentials | None, Depends(_KEYS)]


@dataclass(frozen=True, slots=True, kw_only=True)
class RunnerRights:
    """Trials that a caller's runners may lease.

    Attributes:
        prefix: What the names of the key's runners begin with.
        simulators: The simulators whose jobs they may lease; None for all.
        job_owners: The keys whose jobs they may lease; None for all.
    """

    prefix: str
    simulators: Sequence[str] | None = None
    job_owners: Sequence[str] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Caller:
    """The sender of a request.

    Attributes:
        key_id: The key's id; None for the operator and where no keys are required.
        scope: The greatest scope that was given.
        runner: Jobs it may lease; None for all but runner keys and where no keys are required.
    """

    key_id: str | None
    scope: str
    runner: RunnerRights | None = None

    @property
    def is_admin(self) -> bool:
        """Return whether the caller may change the property of others."""
        return self.scope == "admin"

    def require(self, scope: str) -> None:
        """Check the caller's permission.

        Raises:
            ProblemError: 403, when it may not.
        """
        if self.scope == RUNNER:
            raise _scope_error(scope, "a runner key leases trials")
        if SCOPES.index(self.scope) < SCOPES.index(scope):
            raise _scope_error(scope, f"the key has {self.scope!r}")

    def require_owner(self, owner: str | None, noun: str) -> None:
        """Check that the caller owns something.

        Args:
            owner: The key that submitted it.
            noun: Noun for the message.

        Raises:
            ProblemError: 403, when another key owns it.
        """
        if not self.is_admin and owner != self.key_id:
            detail = f"{noun} was submitted with another key; only an admin may"
            raise ProblemError(ErrorCode.NOT_OWNER, detail)


def check_binding(settings: Settings) -> None:
    """Check that an open service can't be reached from other machines.

    Raises:
        ValueError: It could.
    """
    if not settings.require_keys and settings.host not in LOOPBACK:
        raise ValueError(
            f"the API would listen on {settings.host}, where others can reach it: set "
            "BUILDARENA_REQUIRE_KEYS=true and BUILDARENA_ADMIN_KEY, or listen on 127.0.0.1"
        )
    if settings.require_keys and settings.admin_key is None:
        raise ValueError(
            "BUILDARENA_REQUIRE_KEYS is set but BUILDARENA_ADMIN_KEY is not: the first key could "
            "not be made; set it to a long random text"
        )


async def caller_of(request: Request, bearer: GivenKey) -> Caller:
    """Return the sender of the request if they may send it now.

    Raises:
        ProblemError: 401 for no valid key, 403 for too small a scope, 429 for too many
            requests.
    """
    caller = await _admit(request, bearer)
    caller.require("read" if request.method in READING else "submit")
    return caller


async def admin_of(request: Request, bearer: GivenKey) -> Caller:
    """Do the same as `caller_of` for requests that only admins may send.

    Raises:
        ProblemError: The same as for `caller_of`.
    """
    caller = await _admit(request, bearer)
    caller.require("admin")
    return caller


async def runner_of(request: Request, bearer: GivenKey) -> Caller:
    """Do the same as `caller_of` for runners: only runner keys may, and all callers without keys.

    Raises:
        ProblemError: The same as for `caller_of`.
    """
    caller = await _admit(request, bearer)
    if caller.runner is None:
        raise _scope_error(RUNNER, f"the key has {caller.scope!r}")
    return caller


async def _rights_of(caller: Annotated[Caller, Depends(runner_of)]) -> RunnerRights:
    assert caller.runner is not None, "runner_of admits only runners"  # noqa: S101
    return caller.runner


RightsDep = Annotated[RunnerRights, Depends(_rights_of)]


async def _admit(request: Request, bearer: HTTPAuthorizationCredentials | None) -> Caller:
    """Return the sender of the request after counting it; permissions are not checked."""
    services, secret = services_of(request), bearer.credentials if bearer else ""
    caller = _reader_of_metrics(request, services.context.settings, secret)
    caller = caller or await _identify_or_count(services, request.scope, secret)
    request.state.caller = caller
    count = await _count(services.rate_limits, _name(caller, request.scope))
    request.state.rate = count.headers
    return caller


async def _identify_or_count(services: Services, scope: Scope, secret: str) -> Caller:
    try:
        return await _identify(services, secret)
    except ProblemError:
        # Guessing keys is limited too.
        await _count(services.rate_limits, f"refused:{address_of(scope)}")
        raise


def admission(services: Services) -> Admit:
    """Return the check that refuses requests by their headers before the body is read."""

    async def admit(scope: Scope) -> str:
        try:
            return _name(await _identify_or_count(services, scope, _secret(scope)), scope)
        except (OperationalError, PoolTimeoutError) as error:
            # Before the routes, whose handlers answer the same.
            raise database_problem(error) from error

    return admit


def known_sender(services: Services) -> Callable[[Scope], str]:
    """Return a function that names a request's sender, a recently valid key or an address.

    A key that was not checked yet proves nothing: a sender that invents one for each request has
    one address.
    """

    def name_of(scope: Scope) -> str:
        secret = _secret(scope)
        if secret and _is_operators(secret, services.context.settings):
            return OPERATOR
        return (secret and services.key_checks.known(secret)) or address_of(scope)

    return name_of


def address_of(scope: Scope) -> str:
    """Return the address that a request came from, as a caller."""
    client = scope.get("client")
    return "address:unknown" if client is None else f"address:{client[0]}"


def _secret(scope: Scope) -> str:
    """Return the key that a request carries; empty without one."""
    scheme, secret = get_authorization_scheme_param(Headers(scope=scope).get("authorization"))
    return secret if scheme.lower() == "bearer" else ""


def _name(caller: Caller, scope: Scope) -> str:
    """Return the name whose rate limit a request counts against: key or address."""
    return caller.key_id or address_of(scope)


def limited(
    kind: Kind | Callable[[Request], Kind] = "ordinary",
    *,
    until: Literal["function", "request"] = "function",
    caller: Callable[..., Awaitable[Caller]] = caller_of,
) -> Any:
    """Yield a dependency: the caller's place among those of a kind.

    Args:
        kind: The kind, or a function that derives it from a request.
        until: ``function``, or ``request`` to keep the place until the answer was sent.
        caller: Dependency that returns the caller.
    """

    # Annotations are looked up outside of this function, where its arguments are not.
    async def take_place(request: Request, sender: Caller = Depends(caller)) -> AsyncIterator[None]:  # noqa: B008
        chosen = kind(request) if callable(kind) else kind
        async with services_of(request).places[chosen].of(_name(sender, request.scope)):
            yield

    return Depends(take_place, scope=until)


CallerDep = Annotated[Caller, Depends(caller_of)]


async def _count(limits: RateLimits, caller: str) -> Count:
    count = await limits.hit(caller)
    if not count.passes:
        raise ProblemError(
            ErrorCode.RATE_LIMITED,
            f"more than {limits.spelled} requests; wait {count.reset_s} s",
            headers={"Retry-After": str(count.reset_s), **count.headers},
        )
    return count


async def _identify(services: Services, secret: str) -> Caller:
    settings = services.context.settings
    if not secret:
        if settings.require_keys:
            detail = "an API key is needed: send `Authorization: Bearer KEY`"
            raise _unauthorized(ErrorCode.KEY_REQUIRED, detail)
        return Caller(key_id=None, scope="admin", runner=RunnerRights(prefix=runner_prefix(None)))
    if _is_operators(secret, settings):
        return Caller(key_id=None, scope="admin")
    check = await services.key_checks.check(secret)
    if check is None:
        raise _unauthorized(ErrorCode.KEY_UNKNOWN, "unknown API key")
    if check.refusal is not None:
        cause = check.key.suspended_for if check.refusal == "suspended" else None
        refuted = f": {cause} refuted a trial of its runners" if cause else ""
        detail = f"API key {check.key.id} is {check.refusal}{refuted}"
        raise _unauthorized(ErrorCode.KEY_REFUSED, detail)
    key = check.key
    if RUNNER in key.scopes:
        rights = RunnerRights(
            prefix=runner_prefix(key.id),
            simulators=key.simulators or (),
            job_owners=key.job_owners,
        )
        return Caller(key_id=key.id, scope=RUNNER, runner=rights)
    scopes = [scope for scope in SCOPES if scope in key.scopes]
    return Caller(key_id=key.id, scope=scopes[-1])


def _reader_of_metrics(request: Request, settings: Settings, secret: str) -> Caller | None:
    """Return the caller with the key of the metrics, which permits nothing else."""
    is_metrics = getattr(request.scope.get("route"), "path", None) == METRICS_PATH
    if settings.metrics_key is None or not is_metrics:
        return None
    key = settings.metrics_key.get_secret_value().encode()
    is_equal = hmac.compare_digest(secret.encode(), key)
    return Caller(key_id=None, scope="read") if is_equal else None


def _is_operators(secret: str, settings: Settings) -> bool:
    """Return whether it is one of the operator's keys, in constant time."""
    presented = secret.encode()
    return sum(hmac.compare_digest(presented, key.encode()) for key in settings.admin_keys) > 0


def _unauthorized(code: ErrorCode, detail: str) -> ProblemError:
    return ProblemError(code, detail, headers={"WWW-Authenticate": "Bearer"})


def _scope_error(scope: str, but: str) -> ProblemError:
    return ProblemError(ErrorCode.SCOPE_MISSING, f"this needs the scope {scope!r}; {but}")
