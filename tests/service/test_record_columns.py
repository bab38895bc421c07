"""Files of plant data over HTTP: one reader with the command line."""

from __future__ import annotations

import base64

import httpx
import pytest


def sent(client: httpx.Client, raw: bytes, name: str = "log.csv") -> httpx.Response:
    """Return the answer to a file."""
    content = base64.b64encode(raw).decode()
    return client.post("/v1/record-columns", json={"name": name, "content": content})


def test_columns_with_units_times_and_gaps(client: httpx.Client) -> None:
    """Title, decimal commas, date and time apart, a gap, two columns of one name, words."""
    lines = ["Logger 7", "Datum;Zeit;Ventil [%];T;T;Note", ";;;°C;bar;"]
    for k in range(30):
        gap = "Bad Input" if k == 3 else f"20,{k:02d}"
        lines.append(f"31.01.2026;23:59:{2 * k:02d};{5 * (k > 9)},0;{gap};1,5;ok")
    answer = sent(client, "\n".join(lines).encode("latin-1"))
    assert answer.status_code == 200
    found = answer.json()
    assert (found["clock"], found["unit"]) == ("Datum", "s")
    assert found["time"] == [2.0 * k for k in range(30)]
    valve, first, second, note = found["columns"]
    assert (valve["name"], valve["unit"], valve["values"][9:11]) == ("Ventil", "%", [0.0, 5.0])
    assert (first["name"], first["unit"]) == ("T (column 4)", "°C")
    assert first["values"][2:5] == [20.02, None, 20.04]
    assert (second["name"], second["unit"]) == ("T (column 5)", "bar")
    assert note["values"] is None
    assert note["fault"] == "log.csv, line 4, column 'Note': 'ok' is no number"


@pytest.mark.parametrize(
    ("raw", "name", "told"),
    [
        (b"time,u,y\n", "a.csv", "a.csv has heads and no samples"),
        (b"", "a.csv", "a.csv is empty"),
        (b"PK\0\0", "a.xlsx", "a.xlsx is no text: export it as CSV"),
        (b"no parquet", "a.parquet", "a.parquet: "),
        (b"t,u\n" + b"".join(b"%d,1\n" % (k % 9) for k in range(30)), "a.csv",
         "a.csv, line 11: time goes backwards at sample 9"),
        (b",".join(b"c%d" % k for k in range(700)) + b"\n" + b",".join([b"1"] * 700), "a.csv",
         "a.csv has 700 columns"),
    ],
)  # fmt: skip
def test_files_that_are_no_records(client: httpx.Client, raw: bytes, name: str, told: str) -> None:
    """What is wrong is told with file and line."""
    answer = sent(client, raw, name)
    assert answer.status_code == 422
    (fault,) = answer.json()["errors"]
    assert fault["pointer"] == "/content"
    assert fault["detail"].startswith(told)


@pytest.mark.parametrize("content", ["a,b", "\u00d8\u00d9"])
def test_content_is_base64(client: httpx.Client, content: str) -> None:
    """Anything else is a fault of the caller."""
    answer = client.post("/v1/record-columns", json={"name": "a.csv", "content": content})
    assert answer.status_code == 422
    assert answer.json()["errors"][0]["pointer"] == "/content"
