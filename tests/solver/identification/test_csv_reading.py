"""Files as loggers write them."""

import re
from pathlib import Path

import numpy as np
import pytest

from solver.identification.reading import read_record
from solver.model.errors import InvalidInputError

EXAMPLES = Path(__file__).parents[3] / "examples"
ROWS = [(k, float(k > 5), 20 + 0.25 * k) for k in range(30)]


def written(tmp_path, text, encoding="utf-8"):
    """Return a file with that text."""
    path = tmp_path / "log.csv"
    path.write_bytes(text.encode(encoding))
    return path


def text(delimiter=",", decimal=".", heads=("t", "u", "y"), form="{}"):
    """Return a table as text."""
    lines = [delimiter.join(heads)] if heads else []
    for k, u, y in ROWS:
        cells = (form.format(k), f"{u:.1f}", f"{y:.2f}")
        lines.append(delimiter.join(cell.replace(".", decimal) for cell in cells))
    return "\n".join(lines) + "\n"


def minutes(each):
    """Return a table whose times are told to the minute, `each` samples in one."""
    rows = [f"2026-03-01 12:{k // each:02d},{u},{y}" for k, u, y in ROWS]
    return "\n".join(["t,u,y", *rows])


def clock_set_back():
    """Return a table whose clock is set back by an hour after 20 of 30 samples, 5 min each."""
    at = [k - 12 * (k >= 20) for k in range(30)]
    rows = [f"2026-10-25 0{1 + k // 12}:{5 * (k % 12):02d}:00,{k % 7},{k % 5}" for k in at]
    return "\n".join(["t,u,y", *rows])


@pytest.mark.parametrize(
    ("content", "encoding", "names"),
    [
        (text(), "utf-8", "tuy"),
        (text(";", ","), "utf-8-sig", "tuy"),
        (text("\t"), "utf-16", "tuy"),
        (text("|"), "utf-8", "tuy"),
        (text(heads=None), "utf-8", "123"),
        (text(heads=("t (s)", "u [%]", "y (°C)")), "latin-1", "tuy"),
        (text(heads=("T", "U", "Y")), "utf-8", "tuy"),
        ("# a logger\n\n" + text(), "utf-8", "tuy"),
        (text().replace("t,u,y\n", "t,u,y\ns,%,degC\n"), "utf-8", "tuy"),
        (text().replace("\n", ",\r\n"), "utf-8", "tuy"),
        (text(form="2026-03-01T12:00:{:02d}"), "utf-8", "tuy"),
        (
            text(";", form="01/03/2026 12:00:{:02d}").replace("01/03/2026", "2026/03/01"),
            "utf-8",
            "tuy",
        ),
        (text(form="2026-03-01 12:00:{:02d}+02:00"), "utf-8", "tuy"),
        (text(form="2026-03-01 12:00:{:02d}.000 UTC"), "utf-8", "tuy"),
        (text(form="29/03/2026 12:00:{:02d}"), "utf-8", "tuy"),
        (text(form="3/1/2026 1:45:{:02d} PM"), "utf-8", "tuy"),
        (text(";", form="29,03,26 12:00:{:02d}").replace("29,03,26", "29.03.26"), "utf-8", "tuy"),
        (text(form="29-Mar-26 12:00:{:02d}"), "utf-8", "tuy"),
        (text(form="202603011200{:02d}"), "utf-8", "tuy"),
        (text(form="17743200000{:02d}"), "utf-8", "tuy"),
        (text(" "), "utf-8", "tuy"),
        (text("   ", ","), "utf-8", "tuy"),
        ("sep=;\n" + text(";"), "utf-8", "tuy"),
        ("Plant Alpha;Export\nCreated;today\n" + text(";", ","), "utf-8", "tuy"),
        (text().replace("\n5,", "\n5,0.0,21.25\n5,"), "utf-8", "tuy"),
        ("\n".join(text().splitlines()[:1] + text().splitlines()[:0:-1]), "utf-8", "tuy"),
    ],
)
def test_every_form_is_the_same_record(tmp_path, content, encoding, names):
    """Delimiters, decimal signs, heads, units, encodings, time stamps."""
    path = written(tmp_path, content, encoding)
    t, u, y = names
    record = read_record(path, time=t, inputs=[u], outputs=[y])
    assert record.time - record.time[0] == pytest.approx(np.arange(30))
    assert record.inputs[u] == pytest.approx([row[1] for row in ROWS])
    assert record.outputs[y] == pytest.approx([row[2] for row in ROWS])
    assert record.name == "log"


@pytest.mark.parametrize(
    ("delimiter", "cells", "values"),
    [
        (";", ("1.200,50", "1.200", "-12.001.200"), (1200.5, 1200, -12001200)),
        (";", ("1.200", "0.85"), (1.2, 0.85)),
        (";", ("1,200", "0,85"), (1.2, 0.85)),
        (",", ('"1,200.50"', '"1,200"'), (1200.5, 1200)),
        (",", ('"12,5"', '"0,85"'), (12.5, 0.85)),
        (";", ("1'200.5", "1\u202f200", "\u22121 200"), (1200.5, 1200, -1200)),
        (";", ("1200,5", "#DIV/0!", "Bad Input"), (1200.5, np.nan, np.nan)),
    ],
)
def test_thousands_and_decimals_are_told_by_the_whole_column(tmp_path, delimiter, cells, values):
    """A point or comma before three digits means what the others say."""
    lines = [delimiter.join(("t", "u", "y"))]
    lines += [delimiter.join((str(k), str(k % 7), cells[k % len(cells)])) for k in range(66)]
    path = written(tmp_path, "\n".join(lines))
    record = read_record(path, inputs=["u"], outputs=["y"])
    assert record.outputs["y"][: len(values)] == pytest.approx(values, nan_ok=True)


def test_what_may_be_either_is_refused(tmp_path):
    """Thousands or decimals between commas; day or month where it matters."""
    lines = ["t,u,y", *(f'{k},{k % 7},"{k},{k:03}"' for k in range(1, 30))]
    path = written(tmp_path, "\n".join(lines))
    with pytest.raises(InvalidInputError, match=r"line 2, column 'y': '1,001' is no number where"):
        read_record(path, inputs=["u"], outputs=["y"])
    stamps = [f"0{k // 4 + 1}/0{k // 4 + 4}/2026 {k % 4}:00" for k in range(24)]
    lines = ["t,u,y", *(f"{stamp},{k},{k}" for k, stamp in enumerate(stamps))]
    path = written(tmp_path, "\n".join(lines))
    with pytest.raises(InvalidInputError, match="day or month first"):
        read_record(path, inputs=["u"], outputs=["y"])


def test_column_of_times_is_found(tmp_path):
    """By its name, else it is the first that is no signal."""
    for heads in (("Time (s)", "u", "y"), ("no", "u", "y", "Timestamp"), ("k", "u", "y")):
        rows = [f"{k},{k % 7},{k % 5},{2 * k}" for k in range(40)]
        lines = [",".join(heads), *(row.rsplit(",", 4 - len(heads))[0] for row in rows)]
        found = read_record(written(tmp_path, "\n".join(lines)), inputs=["u"], outputs=["y"])
        assert found.sampling_period == (2.0 if "Timestamp" in heads else 1.0)


def test_samples_before_every_input_is_known_are_left_out(tmp_path):
    """A few; a record whose half is without an input is refused."""
    lines = ["t,u,y", *(f"{k},{k % 7 if k > 2 else ''},{k % 5}" for k in range(40))]
    found = read_record(written(tmp_path, "\n".join(lines)), inputs=["u"], outputs=["y"])
    assert found.time[0] == 3.0
    lines = ["t,u,y", *(f"{k},{k % 7 if k > 20 else ''},{k % 5}" for k in range(40))]
    with pytest.raises(InvalidInputError, match="line 2, column 'u': the first reading"):
        read_record(written(tmp_path, "\n".join(lines)), inputs=["u"], outputs=["y"])


def test_times_of_the_day_pass_midnight(tmp_path):
    """Also those with a decimal part."""
    lines = ["t,u,y"]
    for k, u, y in ROWS:
        second = (86390 + k) % 86400
        stamp = f"{second // 3600:02d}:{second % 3600 // 60:02d}:{second % 60:02d}.500"
        lines.append(f"{stamp},{u},{y}")
    record = read_record(written(tmp_path, "\n".join(lines)), time="t", inputs=["u"], outputs=["y"])
    assert record.time == pytest.approx(np.arange(30))


def test_empty_cells_are_gaps(tmp_path):
    """So is what loggers write instead."""
    content = text().replace("7,1.0,21.75", "7,,n/a")
    record = read_record(written(tmp_path, content), time="t", inputs=["u"], outputs=["y"])
    assert record.inputs["u"][7] == 1.0
    assert not record.observed[0][7]


@pytest.mark.parametrize(
    ("content", "columns", "words"),
    [
        (text().replace("7,1.0,21.75", "7,1.0,abc"), "tuy", "log.csv, line 9, column 'y': 'abc'"),
        (text().replace("7,1.0,21.75", "7,1.0"), "tuy", "log.csv, line 9: 2 cells"),
        (text().replace("7,1.0,21.75", "7,1.0,21.75,9"), "tuy", "log.csv, line 9: 4 cells"),
        (text().replace("\n7,", "\nx,"), "tuy", "log.csv, line 9, column 't': 'x'"),
        (text().replace("\n7,", "\n3,"), "tuy", "log.csv, line 9: time goes backwards"),
        (
            "t,u,y\n" + "0 s,1 %,20 K\n" * 30,
            "tuy",
            "below them stands '0 s, 1 %, 20 K'",
        ),
        (text(), "tu9", "log.csv has no column '9'"),
        (minutes(8), "tuy", "line 3: time stands still at sample 1 (0 after 0): 90 % of the"),
        (
            clock_set_back(),
            "tuy",
            "sample 20 (2400 after 5700): an hour back, as at the end",
        ),
        (text(), "tuz", "log.csv has no column 'z'; it has 't', 'u', 'y'"),
        (text(heads=("t", "u", "u")), "tuy", "'u' names the columns 2, 3"),
        (text(heads=("t", "u (a)", "u (b)")), "tuy", "'u' names the columns 2, 3"),
        ("", "tuy", "log.csv is empty"),
        (text(), "tuu", "'u' is named twice"),
    ],
)
def test_errors_name_file_line_and_column(tmp_path, content, columns, words):
    """And what is there instead."""
    t, u, y = columns
    with pytest.raises(InvalidInputError, match=re.escape(words)):
        read_record(written(tmp_path, content), time=t, inputs=[u], outputs=[y])


def test_columns_go_by_their_numbers_too(tmp_path):
    """Signals are called by their heads; by head and number where two have the same."""
    content = text(heads=("t", "valve", "valve"))
    record = read_record(written(tmp_path, content), inputs=["2"], outputs=["3"])
    assert list(record.inputs) == ["valve (column 2)"]
    record = read_record(
        written(tmp_path, text(heads=("t", "V [%]", "T (K)"))), inputs=["2"], outputs=["3"]
    )
    assert [*record.inputs, *record.outputs] == ["V", "T"]


def test_examples_are_read():
    """By heads without units."""
    record = read_record(
        EXAMPLES / "two_heaters_steps.csv",
        time="Time",
        inputs=["Heater 1", "Heater 2"],
        outputs=["Temperature 1", "Temperature 2"],
    )
    assert record.time.size == 599
    assert record.sampling_period == pytest.approx(1.0, abs=0.01)


def test_heads_without_samples_are_refused(tmp_path):
    """By name, as any fault of a file."""
    path = tmp_path / "empty.csv"
    path.write_text("t,u,y\n")
    with pytest.raises(InvalidInputError, match=r"empty\.csv has heads and no samples"):
        read_record(path, time="t", inputs=["u"], outputs=["y"])


def test_fault_of_a_sample_is_told_with_line_and_column(tmp_path):
    """A number that no record holds."""
    path = tmp_path / "large.csv"
    lines = [f"{k},{k % 7},{k % 5}" for k in range(40)]
    lines[30] = "30,1,1e300"
    path.write_text("\n".join(["t,u,y", *lines]))
    with pytest.raises(InvalidInputError, match=r"large\.csv, line 32, column 'y': no finite"):
        read_record(path, time="t", inputs=["u"], outputs=["y"])


def test_parquet_is_read_as_text_is(tmp_path):
    """Numbers, nulls, time stamps; other types and doubled names are refused by column."""
    pa, pq = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    t = np.arange(40.0)
    u, y = t % 7, [None if k == 9 else float(k) for k in range(40)]
    stamps = pa.array((t * 1e9).astype("int64"), pa.timestamp("ns"))
    path = tmp_path / "record.parquet"
    pq.write_table(pa.table({"t": stamps, "u (%)": u, "y": y}), path)
    record = read_record(path, time="t", inputs=["u"], outputs=["y"])
    assert record.time == pytest.approx(t)
    assert record.observed[0].sum() == 39
    assert record.inputs["u"] == pytest.approx(u)
    for table, words in (
        (pa.table({"t": t, "u": ["a"] * 40, "y": y}), "column 'u': string is no number"),
        (pa.table([t, u, u, y], names=["t", "u", "u", "y"]), "'u' names the columns 2, 3"),
        (pa.table({"t": t, "y": y}), "no column 'u'"),
        (pa.table({"t": np.roll(t, 1), "u": u, "y": y}), "row 2: time goes backwards"),
    ):
        pq.write_table(table, path)
        with pytest.raises(InvalidInputError, match=words):
            read_record(path, time="t", inputs=["u"], outputs=["y"])
    path.write_text("PAR1 of nothing")
    with pytest.raises(InvalidInputError, match=r"record\.parquet"):
        read_record(path, time="t", inputs=["u"], outputs=["y"])
