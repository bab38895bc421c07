"""Lines of the log."""

import json
import logging
import sys

from service.logs import Line, fields, request_id


def test_line_has_the_event_what_belongs_to_it_and_its_request() -> None:
    """A JSON object, whatever the values are."""
    token = request_id.set("abc")
    try:
        record = logging.makeLogRecord(
            {
                "name": "mutune.http",
                "levelno": 20,
                "levelname": "INFO",
                "msg": "%d \n",
                "args": (3,),
            }
            | fields(path="/a", value={1})
        )
        line = Line().format(record)
    finally:
        request_id.reset(token)
    assert "\n" not in line
    told = json.loads(line)
    assert told.pop("timestamp").endswith("+00:00")
    assert told == {
        "event": "3 \n",
        "level": "info",
        "logger": "mutune.http",
        "path": "/a",
        "request_id": "abc",
        "value": "{1}",
    }


def test_line_of_a_fault_has_its_traceback() -> None:
    """In the same line."""
    try:
        raise ValueError("wrong")  # noqa: EM101, TRY301 - to have a traceback
    except ValueError:
        record = logging.makeLogRecord({"msg": "a fault", "exc_info": sys.exc_info()})
    told = json.loads(Line().format(record))
    assert "request_id" not in told
    assert told["exception"].endswith("ValueError: wrong")
