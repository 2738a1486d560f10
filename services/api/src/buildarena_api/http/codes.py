"""The codes of errors: what programs go by, each with its HTTP status and its meaning."""

from __future__ import annotations

from enum import StrEnum
from typing import Self


class ErrorCode(StrEnum):
    """What went wrong, for programs: a code never changes its meaning."""

    status: int
    meaning: str

    def __new__(cls, code: str, status: int, meaning: str) -> Self:
        """Give a code its status and meaning."""
        made = str.__new__(cls, code)
        made._value_, made.status, made.meaning = code, status, meaning
        return made

    INVALID_FIELD = "invalid_field", 422, "A field or parameter has no valid value."
    UNKNOWN_FIELD = "unknown_field", 422, "The body has a field that does not exist."
    UNKNOWN_PARAMETER = "unknown_parameter", 422, "The operation has no such query parameter."
    REPEATED_PARAMETER = "repeated_parameter", 422, "A parameter for one value was given twice."
    CONTRADICTORY_PARAMETERS = "contradictory_parameters", 422, "Two parameters exclude each other."
    UNKNOWN_NAME = "unknown_name", 422, "A name is unknown; `choices` has the valid ones."
    INVALID_CURSOR = "invalid_cursor", 422, "The cursor is not one of this list in this order."
    INVALID_JSON = "invalid_json", 422, "The body is not JSON; the message has line and column."
    INVALID_YAML = "invalid_yaml", 422, "The body is not YAML, or uses what is refused of YAML."
    INVALID_FILE = "invalid_file", 422, "The uploaded file is not what it should be."
    UPLOAD_REFUSED = "upload_refused", 422, "A runner's file or outcome does not fit its trial."
    TOO_DEEP = "too_deep", 422, "The body is nested too deeply."
    BROKEN_BODY = "broken_body", 400, "The body was cut off, or its header is no HTTP."
    KEY_REQUIRED = "key_required", 401, "The request carries no API key."
    KEY_UNKNOWN = "key_unknown", 401, "Nobody has this API key."
    KEY_REFUSED = "key_refused", 401, "The key is revoked, expired, suspended or replaced."
    SCOPE_MISSING = "scope_missing", 403, "The key lacks the scope that the operation needs."
    NOT_OWNER = "not_owner", 403, "It belongs to another key; only an admin may change it."
    NAME_TAKEN = "name_taken", 403, "The name belongs to another key, or looks like one that does."
    NOT_ALLOWED = "not_allowed", 403, "The key's runners may not lease this simulator's jobs."
    FOREIGN_ORIGIN = "foreign_origin", 403, "Without keys, other sites' pages may ask nothing."
    PATH_NOT_FOUND = "path_not_found", 404, "There is no such path."
    JOB_NOT_FOUND = "job_not_found", 404, "There is no such job."
    SWEEP_NOT_FOUND = "sweep_not_found", 404, "There is no such sweep."
    TASK_NOT_FOUND = "task_not_found", 404, "There is no such task, or not in this version."
    SESSION_NOT_FOUND = "session_not_found", 404, "There is no such session of an agent."
    KEY_NOT_FOUND = "key_not_found", 404, "There is no such API key."
    VERIFICATION_NOT_FOUND = "verification_not_found", 404, "There is no such verification."
    ARTIFACT_NOT_FOUND = "artifact_not_found", 404, "The job has no such artifact, or not yet."
    RESULT_WITHHELD = "result_withheld", 404, "It would tell hidden numbers before the job ends."
    METHOD_NOT_ALLOWED = "method_not_allowed", 405, "The path has other methods."
    BODY_TIMEOUT = "body_timeout", 408, "The body did not come in time."
    ILLEGAL_STATE = "illegal_state", 409, "The state of the job, sweep or key does not allow it."
    SESSION_CLOSED = "session_closed", 409, "The session takes no calls, or no more of them."
    NOTHING_TO_SUBMIT = "nothing_to_submit", 409, "The session has no machine to submit."
    NO_TEST_TRIAL = "no_test_trial", 409, "The task has no test trials, or none is left."
    LEASE_ENDED = "lease_ended", 409, "The runner's lease is over, or another key's."
    IDEMPOTENCY_KEY_REUSED = "idempotency_key_reused", 409, "The Idempotency-Key had another body."
    TOO_LARGE = "too_large", 413, "The request, or its answer, is too large."
    UNSUPPORTED_MEDIA_TYPE = "unsupported_media_type", 415, "The body is of a type not read here."
    FOREIGN_HOST = "foreign_host", 421, "Without keys, the service answers only to local names."
    HEADER_TOO_LARGE = "header_too_large", 431, "The request's header is too large."
    RATE_LIMITED = "rate_limited", 429, "More requests than the caller may send; see Retry-After."
    TOO_MANY_OPEN = "too_many_open", 429, "The caller has too much of this kind going on."
    INTERNAL_ERROR = "internal_error", 500, "A bug of the service; its log has it."
    ARTIFACT_DAMAGED = "artifact_damaged", 500, "Stored bytes are damaged; a backup has them."
    BUSY = "busy", 503, "All callers together have too much of this kind going on."
    DATABASE_UNAVAILABLE = "database_unavailable", 503, "The database does not answer."
    STORE_UNAVAILABLE = "store_unavailable", 503, "The artifact store does not answer."
