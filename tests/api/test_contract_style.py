"""The style of the API, held over its whole OpenAPI document, and its generic mechanisms."""

from support.contract import contract

from buildarena_api.http.problems import ErrorCode

CONTRACT = contract()
SCHEMAS = CONTRACT["components"]["schemas"]
OPERATIONS = [
    (f"{method.upper()} {path}", path, method, operation)
    for path, operations in CONTRACT["paths"].items()
    for method, operation in operations.items()
]
IDS = {"job", "sweep", "key", "session", "verification"}


def kind_of(schema: dict) -> str:
    """The name of what a schema refers to, or its type."""
    options = schema.get("anyOf", [schema])
    found = next((one for one in options if one.get("type") != "null"), schema)
    return found.get("$ref", "").rpartition("/")[2] or found.get("format") or found.get("type", "")


def test_every_list_has_the_one_envelope_with_limit_and_cursor() -> None:
    for name, _, _, operation in OPERATIONS:
        answer = operation["responses"].get("200", {}).get("content", {})
        kind = kind_of(answer.get("application/json", {}).get("schema", {}))
        parameters = {one["name"] for one in operation.get("parameters", ())}
        is_list = kind.endswith("List")
        assert is_list == ({"limit", "cursor"} <= parameters), name
        assert kind != "array", name
        if is_list:
            assert set(SCHEMAS[kind]["properties"]) == {"data", "next_cursor"}, name


def test_every_4xx_is_a_problem_with_a_known_code() -> None:
    problem = {"application/problem+json": {"schema": {"$ref": "#/components/schemas/Problem"}}}
    for name, path, method, operation in OPERATIONS:
        answers = operation["responses"]
        for status in (one for one in answers if one.startswith("4")):
            assert answers[status]["content"] == problem, (name, status)
        assert "422" in answers, name
        assert ("404" in answers) >= ("{" in path), name
        assert ("409" in answers) >= (method == "post"), name
    assert set(SCHEMAS["ErrorCode"]["enum"]) == {str(code) for code in ErrorCode}
    assert "HTTPValidationError" not in SCHEMAS


def test_what_creates_takes_an_idempotency_key_and_tells_new_from_existing() -> None:
    for name, _, _, operation in OPERATIONS:
        creates = "201" in operation["responses"]
        headers = {one["name"] for one in operation.get("parameters", ())}
        assert creates == ("Idempotency-Key" in headers), name
        if creates:
            same = [operation["responses"][status]["content"] for status in ("200", "201")]
            assert same[0] == same[1], name
        assert "202" not in operation["responses"], name


def test_names_types_and_units_are_the_same_everywhere() -> None:
    for name, schema in SCHEMAS.items():
        assert not name.endswith("View"), name
        fields = schema.get("properties", {})
        for field, of in fields.items():
            where = f"{name}.{field}"
            is_moment = field.endswith("_at") or field == "at"
            is_moment &= field != "pass_at"
            assert is_moment == (kind_of(of) == "date-time"), where
            assert not (field in IDS and name != "KeyPress" and kind_of(of) == "string"), (
                f"{where}: a job's id is job_id"
            )
            if field.startswith(("max_", "used_", "remaining_")):
                assert field.endswith(("_usd", "_s")) == (kind_of(of) == "number"), where
            if field == "usage":
                assert kind_of(of) == "Usage", where
            if "cost" in field and kind_of(of) in {"number", "integer"}:
                assert "_usd" in field or name == "Module", where
            if field in {"state", "outcome", "stage"}:
                assert kind_of(of)[0].isupper(), f"{where}: enums have names"
    tokens = {"requests", "input_tokens", "output_tokens"}
    assert set(SCHEMAS["Usage"]["properties"]) == tokens | {"cost_usd"}


def test_a_json_body_may_be_yaml() -> None:
    for name, path, _, operation in OPERATIONS:
        body = operation.get("requestBody", {}).get("content", {})
        if "application/json" in body and not path.startswith("/v1/runner"):
            assert "application/yaml" in body, name
