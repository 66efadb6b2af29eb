import json

import msgspec

from holdfast_grip import FingerCommand, Limits
from holdfast_grip.documents import GripFinger, GripLimits


def test_documents_of_the_grip_have_the_fields_of_its_values():
    assert GripLimits.__struct_fields__ == Limits.__struct_fields__
    assert set(GripFinger.__struct_fields__) == {*FingerCommand.__struct_fields__, "highest"}
    document = json.loads(msgspec.json.encode(Limits(recovery=float("inf"))))
    assert msgspec.convert(document, GripLimits).recovery is None


def test_only_these_limits_may_be_null():
    schema = msgspec.json.schema(GripLimits)["$defs"]["GripLimits"]["properties"]
    nullable = {name for name, kind in schema.items() if {"type": "null"} in kind.get("anyOf", [])}
    assert nullable == {"max_force", "recovery"}
