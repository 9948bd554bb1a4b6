"""Tables as they are found: read right, or refused in a sentence with the remedy."""

import re
from datetime import datetime, timedelta

import numpy as np
import pytest

from nrdob.measured import checked_record, identify, read_data
from nrdob.measured.parsing import seconds_in

STEP = 0.5
COUNT = 400
T = STEP * np.arange(COUNT)
U = 20.0 + 30.0 * (np.arange(COUNT) // 40 % 2)
Y = np.round(20 + 25 * np.convolve(U - 20, 0.02 * 0.98 ** np.arange(COUNT))[:COUNT] / 30, 4)
"""One record of a slow plant; all that follows are dresses of it."""


def lines(heading, row, between=",", keep=None):
    """The record as a table, one sample in a row."""
    rows = [
        between.join(row(k, T[k], U[k], Y[k])) for k in (range(COUNT) if keep is None else keep)
    ]
    return "\n".join(([heading] if heading else []) + rows) + "\n"


def plain(k, t, u, y):
    return f"{t}", f"{u}", f"{y}"


def comma(k, t, u, y):
    return tuple(each.replace(".", ",") for each in plain(k, t, u, y))


def clocked(form):
    begin = datetime(2024, 1, 31, 11, 58, 30)
    return lambda k, t, u, y: (
        (begin + timedelta(seconds=t)).strftime(form),
        f"{u}",
        f"{y}",
    )


def in_unit(seconds):
    return lambda k, t, u, y: (f"{t / seconds:.12g}", f"{u}", f"{y}")


def jittered(k, t, u, y):
    late = 0.04 * STEP * np.sin(k * 1.7)
    slope = (Y[min(k + 1, COUNT - 1)] - y) / STEP
    return f"{t + late:.5f}", f"{u}", f"{y + late * slope:.5f}"


def four(k, t, u, y):
    return f"{t}", f"{u}", f"{u + 1}", f"{y}", f"{y - 3}"


ISO, SLASHED = "%Y-%m-%dT%H:%M:%S.%f", "%d/%m/%Y %H:%M:%S.%f"
NO_TIMES = {"sampling_time": STEP}
ASKED = {"columns": {"t": "Time", "u": "Q1", "y": "T2"}}

DRESSES = {
    "plain": (lines("t,u,y", plain), {}),
    "other names": (lines("Time,MV,PV", plain), {}),
    "German names, u last": (
        lines("Zeit;Istwert;Stellgrad", lambda *row: [comma(*row)[k] for k in (0, 2, 1)], ";"), {},
    ),
    "one name is known": (lines("time,voltage,temperature", plain), {}),
    "no name is known": (lines("ts,q,th", plain), {}),
    "no headings": (lines("", plain), {}),
    "a tab behind each line": (lines("", lambda *each: (*plain(*each), ""), "\t"), {}),
    "two inputs and outputs": (
        lines("Time,Q1,Q2,T1,T2", lambda *each: (*four(*each)[:4], plain(*each)[2])), ASKED,
    ),
    "by number": (lines("a,b,c,d,e", four), {"columns": {"t": 1, "u": 2, "y": 4}}),
    "milliseconds": (lines("time [ms],u,y", in_unit(1e-3)), {}),
    "minutes": (lines("t (min);u;y", in_unit(60), ";"), {}),
    "hours after a comma": (lines('"Time, h",u,y', in_unit(3600)), {}),
    "unit after an underscore": (lines("time_ms,u,y", in_unit(1e-3)), {}),
    "row of units": (lines("Time;Input;Output\nms;%;degC", in_unit(1e-3), ";"), {}),
    "ISO 8601": (lines("timestamp,u,y", clocked(ISO)), {}),
    "time of the test": (
        lines("Time,u,y", lambda k, t, u, y: (f"0 days 00:0{t // 60:.0f}:{t % 60:04.1f}", f"{u}",
        f"{y}")), {},
    ),
    "time of day, to the second": (lines("Time,u,y", clocked("%H:%M:%S")), {}),
    "commas in quotes": (
        lines("t,u,y", lambda *e: tuple(f'"{each}"' for each in comma(*e))), {},
    ),
    "time of day": (lines("Time,u,y", clocked("%I:%M:%S.%f %p")), {}),
    "one day, in doubt which": (lines("Date,u,y", clocked(SLASHED)), {}),
    "Unix time": (lines("t,u,y", lambda k, t, u, y: (f"{1.7e9 + t:.1f}", f"{u}", f"{y}")), {}),
    "Unix time in ms": (
        lines("time [ms],u,y", lambda k, t, u, y: (f"{1.7e12 + 1e3 * t:.0f}", f"{u}", f"{y}")), {},
    ),
    "Latin-1": (lines("Zeit [s];u [%];y [°C]", plain, ";").encode("latin-1"), {}),
    "UTF-16": (lines("time\tu\ty", plain, "\t").encode("utf-16"), {}),
    "UTF-8 with a mark": (lines("t,u,y", plain).encode("utf-8-sig"), {}),
    "semicolons, decimal comma": (lines("t;u;y", comma, ";"), {}),
    "blanks, decimal comma": (lines("t u y", comma, "   "), {}),
    "tabs": (lines("t\tu\ty", plain, "\t"), {}),
    "bars": (lines("t|u|y", plain, " | "), {}),
    "comments and a preamble": (
        "# logged on Monday\nLogger 7\nRate;2 Hz\n" + lines("y;t;u", lambda *e: (
            plain(*e)[2], *plain(*e)[:2]), ";"), {},
    ),
    "headings in a comment": (lines("# t u y", plain, " "), {}),
    "foreign headings in a comment": (
        lines("# dt (ms);PWM;giri", in_unit(1e-3), ";"), {"columns": {"u": "PWM"}},
    ),
    "one sample is late": (
        lines("t,u,y", lambda k, t, u, y: (
            f"{t + 0.3 * STEP * (k == 150):g}", f"{u}", f"{y + 0.3 * (Y[151] - y) * (k == 150)}",
        )), {},
    ),
    "index and more columns": (
        lines(",note,t,u,y", lambda k, *e: (f"{k}", "ok", *plain(k, *e))), {},
    ),
    "no times": (lines("u,y", lambda *e: plain(*e)[1:]), NO_TIMES),
    "trailing separators": (lines("t,u,y", lambda *e: (*plain(*e), "")), {}),
    "units in the cells": (
        lines("Time,u,y", lambda k, t, u, y: (f"{1e3 * t:.0f} ms", f"{u} %", f"{y} °C")), {},
    ),
    "units in the cells, after a date": (
        lines("Zeit;u;y", lambda k, t, u, y: (
            clocked(ISO)(k, t, u, y)[0].replace("T", " "), f"{comma(k, t, u, y)[1]}%",
            f"{comma(k, t, u, y)[2]} m³/h",
        ), ";"), {},
    ),
    "a serial monitor": (
        lines("11:58:29.900 -> u,y", lambda *e: (
            f"{clocked('%H:%M:%S.%f')(*e)[0]} -> {e[2]}", f"{e[3]}")), {},
    ),
    "a serial monitor that begins within a line": (
        lines("50.0\t2", lambda *e: (f"{clocked('%H:%M:%S')(*e)[0]} -> {e[2]}", f"{e[3]}"), "\t"),
        {},
    ),
    "a serial plotter": (
        lines("Ready.", lambda *e: (f"T:{e[3]}", f"Q:{e[2]}"), " "),
        NO_TIMES | {"columns": {"u": "Q", "y": "T"}},
    ),
    "a serial plotter in a monitor": (
        lines("", lambda *e: (
            f"{clocked('%H:%M:%S.%f')(*e)[0]} -> u = {e[2]}", f"y = {e[3]}"), ", "), {},
    ),
    "comments behind numbers": (
        lines("t\tu\ty", lambda k, *e: (
            *plain(k, *e)[:2], f"{e[2]}" + " # switched, or not" * (k % 40 == 0)), "\t"), {},
    ),
    "a heading like a number": (lines("t,u,y,2024", lambda *e: (*plain(*e), "7")), {}),
    "headings like numbers with units": (
        lines("Time;24V;u;y;5V", lambda *e: (plain(*e)[0], "24.1", *plain(*e)[1:], "5"), ";"), {},
    ),
    "commas between blanks": (lines("t, u, y", plain, " , "), {}),
    "commas between blanks, no headings": (lines("", plain, " , "), {}),
    "units with digits in the cells": (
        lines("t;u;y", lambda k, t, u, y: (f"{t} s", f"{u} m3/h", f"{y} m/s^2"), ";"), {},
    ),
    "units with exponents in the cells": (
        lines("t,u,y", lambda k, t, u, y: (f"{t} s", f"{u} min-1", f"{y} kg*m^-3")), {},
    ),
    "microseconds since the start": (lines("time_usec,u,y", in_unit(1e-6)), {}),
    "nanoseconds": (lines("nanosec,u,y", in_unit(1e-9)), {}),
    "seconds and a fraction that is not needed": (
        lines("sec,nanosec,u,y", lambda k, t, u, y: (f"{t}", "0", f"{u}", f"{y}")), {},
    ),
    "currents and speeds": (lines("time,i [A],n [rpm]", plain), {}),
    "microseconds": (lines("micros,u,y", in_unit(1e-6)), {}),
    "missing values": (
        lines("t,u,y", lambda k, t, u, y: (
            f"{t}", f"{u}" if k != 95 else "null",
            f"{y}" if k % 60 != 57 else ("NaN", "-", "---", "#N/A", "n/a", "")[k // 60],
        )), {},
    ),
    "missing values without times": (
        lines("u,y", lambda k, t, u, y: (f"{u}", f"{y}" if k != 57 else "NaN")),
        NO_TIMES,
    ),
    "an instrument's header": (
        "Name\tScope\nEnd\t1335\tMonday\t12:10:00\n\nName\tu\tName\ty\nSymbol\tMAIN.u\tSymbol\t"
        "MAIN.y\nPort\t851\tPort\t851\n" + lines("Sample time[ms]\t500\tSample time[ms]\t500",
        lambda k, t, u, y: (f"{1e3 * t:.0f}", f"{u}", f"{1e3 * t:.0f}", f"{y}"), "\t"),
        {"columns": {"t": "1 [ms]"}},
    ),
    "bars and a line of dashes": (
        lines("| t | u | y |\n|---|:-:|--:|", lambda *e: ("", *plain(*e), ""), "|"), {},
    ),
    "times before a trigger": (
        lines("Time;u;y", lambda k, t, u, y: (
            f"{'-' if t < 5 else ''}00:0{abs(t - 5) // 60:.0f}:{abs(t - 5) % 60:05.2f}",
            *plain(k, t, u, y)[1:],
        ), ";"), {},
    ),
    "times before a trigger, in minutes and seconds": (
        lines("Time,u,y", lambda k, t, u, y: (
            f"{'-' if t < 5 else ''}0{abs(t - 5) // 60:.0f}:{abs(t - 5) % 60:04.1f}",
            *plain(k, t, u, y)[1:],
        )), {},
    ),
    "times before a trigger, by pandas": (
        lines("Time,u,y", lambda k, t, u, y: (
            f"{'-1 days +23:59:' if t < 5 else f'0 days +00:0{(t - 5) // 60:.0f}:'}"
            f"{(t - 5) % 60:07.4f}", f"{u}", f"{y}",
        )), {},
    ),
    "what tells of the columns": (
        lines("t,u,y\ns,%,K\nMin,0,0\nMax,100,60", plain), {},
    ),
    "a word between headings and numbers": (lines("t,u,y\n[Data]", plain), {}),
    "minutes and seconds": (
        lines("Time,u,y", lambda k, t, u, y: (f"{t // 60:02.0f}:{t % 60:04.1f}", f"{u}", f"{y}")),
        {},
    ),
    "old line ends": (lines("t,u,y", plain).replace("\n", "\r"), {}),
    "sep=": ("sep=;\n" + lines("t;u;y", comma, ";"), {}),
    "a row is missing": (lines("t,u,y", plain, keep=[k for k in range(COUNT) if k != 57]), {}),
    "jitter": (lines("t,u,y", jittered), {}),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("dress", DRESSES)
def test_a_record_is_read_right_in_whatever_dress(tmp_path, dress):
    content, options = DRESSES[dress]
    path = tmp_path / "data.csv"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    record = read_data(path, **options)
    assert record.t - record.t[0] == pytest.approx(T, rel=2e-4, abs=0.05 * STEP)
    # A step that falls between two samples of the even grid is shared between them.
    late = 0.05 if dress in ("jitter", "one sample is late") else 0.0
    assert record.u == pytest.approx(U, abs=1e-9 + late * 30)
    assert record.u.sum() == pytest.approx(U.sum(), rel=1e-3)
    assert record.y == pytest.approx(Y, abs=5e-3 + late)


GOOD = [f"{k},{k // 7 % 2},{k % 5}" for k in range(60)]


def spoilt(row, *instead, heading="t,u,y"):
    """A good table with some rows in the place of one; line 1 has the headings."""
    return "\n".join([heading, *GOOD[: row - 2], *instead, *GOOD[row - 1 :]]) + "\n"


def replaced(change, heading="t,u,y", rows=60):
    return "\n".join([heading, *(change(k) for k in range(rows))]) + "\n"


REFUSED = {
    "nothing": ("", "is empty"),
    "one row": ("t,u,y\n0,1,2\n", "1 samples; at least 20"),
    "separators only": (",,\n,,\n", "anything but separators"),
    "headings only": ("t,u,y\n", "0 samples"),
    "a spreadsheet": (b"PK\x03\x04\x14\0\x06\0", "no table of text, see line 1: save it as CSV"),
    "control characters": (b"t,u,y\n0,\x01,1\n", "see line 2"),
    "no number": (spoilt(9, "7,on,2"), "line 9: u is 'on', which is no finite number; cut"),
    "text in the second line": (spoilt(2, "0,on,2"), "line 2: u is 'on'"),
    "many missing": (
        replaced(lambda k: f"{k},{k // 7 % 2 if k % 7 == 0 else ''},{k % 5}"),
        "line 3: u is empty, .* missing in 51 of 60 lines; .* 5 % .* written only where it changes",
    ),
    "missing times": (spoilt(9, "nan,1,1"), "line 9: t is 'nan'.* take the line out"),
    "infinite": (spoilt(9, "7,-inf,1"), "line 9: u is '-inf'"),
    "too long": (spoilt(9, f"7,{'1' * 61},2"), "line 9: u is '1{60}…', which is no finite number"),
    "too large": (spoilt(9, "7,1e300,1"), "u is 1e.300 at line 9"),
    "an empty cell": (spoilt(9, ",7,1"), "line 9: t is empty"),
    "a short row": (spoilt(9, "7,1"), "line 9 has 2 cells where .*; take that line out"),
    "a long row": (spoilt(9, "7,1,2,3"), "line 9 has 4 cells .* semicolons"),
    "half a line at the end": (
        "\n".join(["t,u,y", *GOOD, "60,1"]), "line 62 has 2 cells .*; take that line out",
    ),
    "numbered rows without a heading": (
        replaced(lambda k: f'"{k + 1}" {k} {k // 7 % 2} {k % 5}', '"t" "u" "y"'),
        "line 2 has 4 cells where the first has 3; a heading is missing: give each column one",
    ),
    "a zone with a name": (
        replaced(lambda k: f"2024-01-31 12:00:{k:02} CET,{k // 7 % 2},{k % 5}", "Time,u,y"),
        "line 2: t is '2024-01-31 12:00:00 CET', and no line .* write times as 2024-01-31 12:00:00",
    ),
    "a formula": (spoilt(9, "7,=1+1,2"), "line 9: u is '=1\\+1'"),
    "code": (spoilt(9, "7,__import__('os'),2"), "line 9: u is"),
    "underscores": (spoilt(9, "7,1_0,2"), "line 9: u is '1_0'"),
    "times twice": (spoilt(9, "7,1,2", "7,1,2"), "from 7 to 7 at line 10; times must increase"),
    "times back": (spoilt(9, "3,1,2"), "from 6 to 3 at line 9"),
    "two tables": ("\n".join(["t,u,y", *GOOD, "t,u,y", *GOOD]), "line 62: u is 'u'"),
    "two tables without headings": ("\n".join([*GOOD, "", *GOOD]), "from 59 to 0 at line 62"),
    "a row of units at the end": ("\n".join(["t,u,y", *GOOD, "s,V,K"]), "line 62: u is 'V'"),
    "a sum at the end": ("\n".join(["t,u,y", *GOOD, "Sum,30,120"]), "line 62: t is 'Sum'"),
    "a quotation mark left open": (
        spoilt(9, '7,"1,2'), "line 9 opens a quotation mark that it does not close, nor do the 2"
    ),
    "thousands": (spoilt(9, '7,"1,234.5",2'), "line 9: u is '1,234.5'.* thousands without"),
    "points and commas": (
        replaced(lambda k: f"{k};{k // 7 % 2}{'.,'[k == 30]}5;{k % 5}", "t;u;y"),
        "line 32: u is '0,5' where another line has '0.5': use one decimal mark",
    ),
    "thousands and decimals": (
        replaced(lambda k: f"{k},000;1.000,{k // 7 % 2};1.050,{k % 5}", "t;u;y"),
        "line 2: u is '1.000,0'.* thousands without",
    ),
    "thousands parted by blanks": (
        replaced(lambda k: f"{k};{k // 7 % 2};1\u202f00{k % 5}", "t;u;y"), "thousands without",
    ),
    "points as thousands beside decimal commas": (
        replaced(lambda k: f"{k},5;{k // 7 % 2},0;1.00{k % 5}", "t;u;y"),
        "line 2: y is '1.000', which may have a point between thousands where t has '0,5'",
    ),
    "thousands beside small numbers": (
        replaced(lambda k: f"{k};{k // 7 % 2};{format(990 + k, ',')}", "t;u;y"),
        "line 12: y is '1,000', which may be 1.000 or 1000",
    ),
    "thousands beside decimal points": (
        replaced(lambda k: f"{k}.5;{k // 7 % 2};5,00{k % 5}", "t;u;y"),
        "line 2: y is '5,000', which may have a comma between thousands where t has '0.5'",
    ),
    "thousands by points beside smaller numbers": (
        replaced(lambda k: f"{k};{k // 7 % 2};{f'{950 + 5 * k:,}'.replace(',', '.')}", "t;u;y"),
        "line 12: y is '1.000', which may be 1.000 or 1000: write thousands without",
    ),
    "decimal commas beside commas": (
        replaced(lambda k: f"{k},0,{k // 7 % 2},5,{k % 5},5"),
        "line 2 has 6 cells where the first has 3; .*semicolons",
    ),
    "two units of a signal": (
        replaced(lambda k: f"{k} s,{k // 7 % 2} V,{950 + k if k < 50 else 1.0} {'mW'[k > 49 :]}"),
        "line 52: y is '1.0 W' where line 2 has '950 mW': write all in one unit, or without any",
    ),
    "numbers with and without a unit": (
        spoilt(9, "7,1 V,2"), "line 9: u is '1 V' where line 2 has '0'",
    ),
    "a number that goes on as a word": (spoilt(9, "7,1x2,2"), "line 9: u is '1x2', which is no f"),
    "times in two units": (
        replaced(lambda k: f"{k} s,{k // 7 % 2},{k % 5}", "time [ms],u,y"),
        "t is in ms by its heading, and 's' stands in its cells: correct one",
    ),
    "times in a unit that is none": (
        replaced(lambda k: f"{k} V,{k // 7 % 2},{k % 5}"), "t is in 'V', which is no unit of time"
    ),
    "a gap": ("\n".join(["t,u,y", *GOOD[:20], *GOOD[30:]]), "10 of them in a row before line 22"),
    "a step in a gap": (
        replaced(lambda k: f"{k + 2 * (k > 149)},{(k > 149) * 1},{k % 5}", rows=300),
        "u changes from 0 to 1 while 2 samples are missing before line 152",
    ),
    "irregular times": (
        replaced(lambda k: f"{k**1.3},{k // 7 % 2},{k % 5}"),
        "the times lie between 1 and 4.406 s apart.*, and y moves too fast",
    ),
    "irregular times with a gap": (
        replaced(lambda k: f"{k**1.3 + 9 * (k > 40)},{k // 7 % 2},{k}"),
        "the times lie between 1 and 12.95 s apart, most before line 43; use a stretch",
    ),
    "fast and with jitter": (
        replaced(lambda k: f"{k + 0.08 * (k % 3)},{k // 7 % 2},{(-1) ** (k // 2)}"),
        "moves too fast between samples to be resampled",
    ),
    "unknown unit": (
        replaced(lambda k: GOOD[k], "time [weeks],u,y"), "t is in 'weeks', .*\\[ms\\]",
    ),
    "unknown unit in a row": (
        replaced(lambda k: GOOD[k], "t,u,y\nfortnights,V,K"), "t is in 'fortnights'",
    ),
    "days that may be months": (
        replaced(lambda k: f"{k // 2 + 1}/01/2024 {12 * (k % 2):02}:00:00,{k // 7 % 2},{k % 5}"),
        "line 2: t is '1/01/2024 00:00:00'; where the day changes, .* write 2024-01-31",
    ),
    "minutes or hours": (
        replaced(lambda k: f"{k // 60:02}:{k % 60:02},{k // 7 % 2},{k % 5}"),
        "line 2: t is '00:00', which may be hours and minutes or minutes and seconds",
    ),
    "midnight": (
        replaced(lambda k: f"{(86390 + k) % 86400 // 3600}:00:{k % 60:02},{k // 7 % 2},{k % 5}"),
        "line 12: t goes from 23:00:09 to 0:00:10; where midnight passes, the day is needed",
    ),
    "rows that are numbered": (
        replaced(lambda k: GOOD[k], "sample,u,y"), "no time: add a column t in seconds, or give",
    ),
    "rows that pandas numbered": (
        replaced(lambda k: GOOD[k], "Unnamed: 0,u,y"), "no time: add a column t in seconds",
    ),
    "rows that are numbered in words": (
        replaced(lambda k: GOOD[k], "Sample Number,u,y"), "no time: add a column t in seconds",
    ),
    "rows of a scanner": (replaced(lambda k: GOOD[k], "Scan,u,y"), "no time: add a column t"),
    "input and output of a controller": (
        replaced(lambda k: f"{k},40,{k % 5},{k // 7 % 2}", "Time,Setpoint,Input,Output"),
        "u, y is not known; beside a set point, input and .* such as .* t=Time,u=Output,y=Input;",
    ),
    "output of a controller": (
        replaced(lambda k: f"{k},40,{k % 5},{k // 7 % 2}", "Time,SP_INT,PV_IN,OUT"),
        "choose, such as .* t=Time,u=OUT,y=PV_IN;",
    ),
    "thousands in quotes": (
        replaced(lambda k: f'{k},{k // 7 % 2},"{1990 + k:,}"'), "may be 1.990 or 1990",
    ),
    "no headings, another order": (
        replaced(lambda k: f"{k // 7 % 2},{k % 5},{k}", "0,0,-1"), "t goes .*--columns t=1,u=2",
    ),
    "a first sample at no time": (
        replaced(lambda k: f"{k - 1 if k else 'start'},{k // 7 % 2},{k % 5}"),
        "line 2: t is 'start', which is no finite number; cut the record there, take the line out",
    ),
    "a countdown": (
        replaced(lambda k: f"{k - 9 if k > 8 else f'T-{9 - k}'};{k // 7 % 2};{k % 5},5"),
        "line 2: t is 'T-9', which is no finite number",
    ),
    "numbers among dates": (
        spoilt(2, "2024-01-31 12:00:00,1,0"), "line 3: t is '1', which is no time like",
    ),
    "no day": (replaced(lambda k: f"2024-02-{k + 1},{k // 7 % 2},{k % 5}"), "line 31: .* no day"),
    "days of a spreadsheet": (
        replaced(lambda k: f"{45322.5 + k / 86400:.7f},{k // 7 % 2},{k % 5}", "Time,u,y"),
        "can hardly be seconds: .* --columns .t=Time \\[d\\]",
    ),
    "days of a spreadsheet from midnight on": (
        replaced(lambda k: f"{45322 + k / 86400:.8f},{k // 7 % 2},{k % 5}", "Time,u,y"),
        "45322, with steps of 1.157e-05, .* can hardly be seconds: .* --columns .t=Time \\[d\\]",
    ),
    "days since the year 0": (
        replaced(lambda k: f"{739282.5 + k / 172800:.8f},{k // 7 % 2},{k % 5}", "Time,u,y"),
        "can hardly be seconds: .* --columns .t=Time \\[d\\]",
    ),
    "Julian dates": (
        replaced(lambda k: f"{2460340.99 + k / 172800:.8f},{k // 7 % 2},{k % 5}", "Time,u,y"),
        "can hardly be seconds: .* --columns .t=Time \\[d\\]",
    ),
    "days since 1970": (
        replaced(lambda k: f"{19753.49 + k / 172800:.8f},{k // 7 % 2},{k % 5}", "Time,u,y"),
        "can hardly be seconds: .* --columns .t=Time \\[d\\]",
    ),
    "nanoseconds from 0 on": (
        replaced(lambda k: f"{500000000 * k},{k // 7 % 2},{k % 5}"),
        "with steps of 5e.08, .* can hardly be seconds: .* \\[ns\\]",
    ),
    "counts of 100 ns": (
        replaced(lambda k: f"{638422991100000000 + 5000000 * k},{k // 7 % 2},{k % 5}"),
        "looks like a count of 100 ns: divide by 10000000, .* give the sampling time",
    ),
    "counts of 100 ns since 1601": (
        replaced(lambda k: f"{133512345000000000 + 5000000 * k},{k // 7 % 2},{k % 5}"),
        "looks like a count of 100 ns",
    ),
    "a date without marks": (
        replaced(lambda k: f"202401311200{k:02}.25,{k // 7 % 2},{k % 5}"),
        "begins with 20240131120000.25 .* looks like 2024-01-31 12:00:00 without the marks",
    ),
    "Unix times of no unit": (
        replaced(lambda k: f"{1700000000000 + 1000 * k},{k // 7 % 2},{k % 5}", "t,u,y"),
        "can hardly be seconds: .* \\[ms\\]",
    ),
    "Unix times in microseconds": (
        replaced(lambda k: f"{1700000000000000 + 500000 * k},{k // 7 % 2},{k % 5}"),
        "can hardly be seconds: .* \\[us\\]",
    ),
    "summer time": (
        replaced(lambda k: f"2024-03-31 0{1 + (k > 29)}:59:{k:02},{k // 7 % 2},{k % 5}"),
        "samples are missing, .* an hour is what summer time",
    ),
    "the end of summer time": (
        replaced(lambda k: f"2024-10-27 0{2 - (k > 29)}:59:{k:02},{k // 7 % 2},{k % 5}"),
        "at line 32; times must increase: .* an hour is what summer time",
    ),
    "words that are no switch": (
        replaced(lambda k: f"{k},{'idle' if k // 7 % 2 else 'heating'},{k % 5}"),
        "line 2: u is 'heating'.*write numbers in place of words",
    ),
    "a set point beside an output of a controller": (
        replaced(lambda k: f"{k},40,{k % 5},{k // 7 % 2}", "time,SP,PV,CO"),
        "choose, such as .*u=CO,y=PV",
    ),
    "rows for columns": (
        "\n".join(",".join(row) for row in zip(*(each.split(",") for each in GOOD), strict=True)),
        "the table has 3 rows and 60 columns; a record has a row for each sample: exchange rows",
    ),
    "two signals in one column": (
        replaced(lambda k: f"{k},lab.heater,{k % 5}\n{k},lab.oven,{k % 7}", "time,u,y"),
        "line 2: u is 'lab.heater', and no line has a number there: .* a column each",
    ),
    "times in words": (
        replaced(lambda k: f"Wed Jan 31 12:00:{k} 2024;{k // 7 % 2};{k % 5}", "time;u;y"),
        "line 2: t is 'Wed Jan 31 .* write times as 2024-01-31 12:00:00, or give the sampling",
    ),
    "times of which the heading says nothing": (
        replaced(lambda k: f"{GOOD[k]},3", "Name,u,y,room"),
        "no time: name the column that holds it, such as --columns t=Name,u=u,y=y;",
    ),
    "a preamble that is taken for headings": (
        replaced(lambda k: GOOD[k], "Lab 7,Monday"),
        "line 2 has 3 cells where the first has 2; .*; take out what stands above the headings",
    ),
    "which input": (
        replaced(lambda k: f"{GOOD[k]},1", "Time,u1,y,u2"),
        "u may be 'u1' or 'u2': choose, such as --columns t=Time,u=u1,y=y; in Python columns=",
    ),
    "which of four": (
        replaced(lambda k: f"{GOOD[k]},1,1", "Time,T1,T2,Q1,Q2"),
        "the columns 1 'Time', 2 'T1', .* not known: choose, such as --columns t=Time,u=Q1,y=T1",
    ),
    "a counter beside the times": (
        replaced(lambda k: f"{k},20,{GOOD[k]}", "Nr,room,Uhr [min],valve,oven"),
        "choose, such as --columns t=3,u=valve,y=room",
    ),
    "two columns, one called T": (
        replaced(lambda k: f"T:{k % 5} Q:{k // 7 % 2}", "Ready."),
        "'T', 2 'Q'; 3 are needed: t, u, y; without times give the sampling time",
    ),
    "one name twice": (
        replaced(lambda k: f"{GOOD[k]},1", "t,u,y,u"), "u may be 'u' or 'u'",
    ),
    "output before input": (
        replaced(lambda k: f"{k},{k**0.5},{k // 30 % 2}", "Time,oven,heater"),
        "name them, such as --columns u=3,y=2",
    ),
    "output before a busy input": (
        replaced(lambda k: f"{k},{k**0.5},{k * k // 7 % 2}", "Time,oven,heater", rows=90),
        "jump between a few values, as an input does, .*such as --columns u=3,y=2",
    ),
    "constant input": (
        replaced(lambda k: f"{k},50,{k}"), "u is 50 in the whole .*--input-before 0",
    ),
}  # fmt: skip


@pytest.mark.parametrize("fault", REFUSED)
def test_what_cannot_be_read_is_refused_with_the_place_and_the_remedy(tmp_path, fault):
    content, said = REFUSED[fault]
    path = tmp_path / "data.csv"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(ValueError, match=said):
        read_data(path)


def test_times_with_a_day_go_on_past_midnight(tmp_path):
    path, begin = tmp_path / "data.csv", datetime(2024, 2, 28, 23, 59, 30)
    rows = replaced(lambda k: f"{begin + timedelta(minutes=k)},{k // 7 % 2},{k % 5}", rows=3000)
    path.write_text(rows, encoding="utf-8")
    assert read_data(path).t == pytest.approx(60.0 * np.arange(3000))


def test_a_sampling_time_goes_before_times_that_are_wrong(tmp_path):
    path = tmp_path / "data.csv"
    path.write_text(replaced(lambda k: f"{k**1.3},{k // 7 % 2},{k % 5}"), encoding="utf-8")
    assert read_data(path, sampling_time=0.1).t[-1] == pytest.approx(5.9)
    with pytest.raises(ValueError, match="one of them must do"):
        read_data(path, sampling_time=0.1, columns={"t": 1})
    path.write_text("u,y\n" + "\n".join(f"{k // 7 % 2},{k % 5}" for k in range(40)) + "\n\n1,1\n")
    with pytest.raises(ValueError, match="line 42 is empty, and without times"):
        read_data(path, sampling_time=0.1)


@pytest.mark.parametrize(
    ("columns", "kind", "said"),
    [
        ("u", TypeError, "columns is 'u'"),
        ({"x": 1}, ValueError, "columns has 'x'; it may name t, u and y"),
        ({"u": 1.5}, TypeError, "columns has 1.5 for u"),
        ({"u": "Q3"}, ValueError, "there is no 'Q3', which is asked for as u"),
        ({"u": 6}, ValueError, "the columns 1 'Time', .* there is no '6'"),
        ({"u": 2, "y": "Q1"}, ValueError, "asked for twice"),
        ({"u": "Q1"}, ValueError, "which holds y is not known"),
    ],
)
def test_columns_that_are_not_there_are_named(tmp_path, columns, kind, said):
    path = tmp_path / "data.csv"
    path.write_text(lines("Time,Q1,Q2,T1,T2", four), encoding="utf-8")
    with pytest.raises(kind, match=said):
        read_data(path, columns=columns)


def test_the_unit_of_times_may_be_said(tmp_path):
    path = tmp_path / "data.csv"
    path.write_text(lines("", in_unit(60)), encoding="utf-8")
    record = read_data(path, columns={"t": "1 [min]", "u": "2", "y": 3})
    assert record.t == pytest.approx(T)
    assert record.remarks == () and "times are in min" in record.notes[0]


@pytest.mark.parametrize(
    ("heading", "asked", "last"),
    [
        ("time,u,y", "time [ms]", 0.059),
        ("Time,u,y", "time(min)", 59 * 60),
        ("time [ms],u,y", "time [ms]", 0.059),
        ("time [ms],u,y", "Time (msec)", 0.059),
        ("time [ms],u,y", "time", 0.059),
        ("time [ms],u,y", "1 [s]", 59),
    ],
)
def test_the_unit_behind_a_heading_is_heeded(tmp_path, heading, asked, last):
    path = tmp_path / "data.csv"
    path.write_text(replaced(lambda k: GOOD[k], heading))
    assert read_data(path, columns={"t": asked}).t[-1] == pytest.approx(last)


def test_times_that_begin_like_days_are_seconds_if_their_steps_say_so(tmp_path):
    path = tmp_path / "data.csv"
    for begin, step in ((20000.5, 0.1), (739282, 0.1), (2460340, 1), (45322, 1), (0, 86401)):
        path.write_text(replaced(lambda k, b=begin, s=step: f"{b + s * k},{k // 7 % 2},{k % 5}"))
        assert np.ptp(read_data(path).t) == pytest.approx(59 * step)


def test_times_that_count_the_rows_are_seconds_only_by_assumption(tmp_path):
    path = tmp_path / "data.csv"
    for step, said in ((1, "1 s a sample is assumed"), (0.5, "seconds were taken")):
        path.write_text(replaced(lambda k, step=step: f"{step * k},{k // 7 % 2},{k % 5}"))
        (note,) = read_data(path).notes
        assert said in note and ("1 s a" in note) == (step == 1)


def test_a_unit_that_contradicts_the_heading_is_refused(tmp_path):
    path = tmp_path / "data.csv"
    path.write_text(replaced(lambda k: GOOD[k], "time [s],u,y"))
    with pytest.raises(ValueError, match=r"in ms, and its heading, 'time \[s\]', says s: .*1 \[ms"):
        read_data(path, columns={"t": "time [ms]"})


def test_what_is_told_of_a_unit_helps(tmp_path):
    path = tmp_path / "data.csv"
    path.write_text(replaced(lambda k: f"{1700000000000 + 500 * k},{k // 7 % 2},{k % 5}", "t,u,y"))
    with pytest.raises(ValueError, match="can hardly be seconds") as refused:
        read_data(path)
    (told,) = re.findall(r'--columns "t=(.*?)"', str(refused.value))
    assert read_data(path, columns={"t": told}).t[-1] == pytest.approx(29.5)


def test_decimals_that_might_be_thousands_stay_decimals(tmp_path):
    path = tmp_path / "data.csv"
    for cells in (("0", "33.333", "66.667", "100"), ("0", "1.150", "1.160", "2"), ("1.250", "99")):
        path.write_text(replaced(lambda k, cells=cells: f"{k};{cells[k % len(cells)]};{k % 5}.5"))
        assert read_data(path).u[: len(cells)].tolist() == [float(cell) for cell in cells]


def test_what_is_taken_for_granted_is_said(tmp_path):
    path = tmp_path / "data.csv"
    path.write_text(lines("time,voltage,temperature", plain), encoding="utf-8")
    (said,) = read_data(path).remarks
    assert "u = 'voltage', y = 'temperature'" in said
    assert "--columns t=time,u=voltage,y=temperature" in said
    assert read_data(path, columns={"u": "voltage", "y": "temperature"}).remarks == ()


def test_an_input_before_the_record_makes_its_first_sample_a_step():
    t = np.arange(300.0)
    y = 20 + 15 * (1 - np.exp(-t / 30))
    record = checked_record(t, 0 * t + 50, y, input_before=0)
    assert (record.inputs == 50).all() and record.input_before == 0
    assert np.array_equal(record.t, t) and np.array_equal(record.y, y)
    later = checked_record(t, (t > 10) * 5.0 + 3, y)
    assert np.array_equal(later.inputs, (t > 10) * 5.0)
    for before, kind in ((50, ValueError), (np.inf, ValueError), ("0", TypeError)):
        with pytest.raises(kind, match=r"50 in the whole record|input_before is"):
            checked_record(t, 0 * t + 50, y, input_before=before)


def test_missing_samples_are_filled_in_and_not_used():
    t = np.delete(np.arange(300.0), [7, 120, 121, 200])
    u = (t > 20) * 1.0
    record = checked_record(t, u, np.sqrt(t))
    assert record.t == pytest.approx(np.arange(300.0))
    assert np.flatnonzero(~record.free).tolist() == [7, 120, 121, 200]
    assert (record.u == (record.t > 20)).all()
    assert record.y == pytest.approx(np.sqrt(np.arange(300.0)), abs=0.02)
    assert "4 of 300 samples are missing" in " ".join(record.remarks)


def test_a_step_while_one_sample_is_missing_is_a_remark():
    t = np.delete(np.arange(300.0), 100)
    record = checked_record(t, (t >= 100) * 1.0, np.sqrt(t))
    assert record.u.tolist() == [0] * 101 + [1] * 199
    assert "wrong by up to one sample" in " ".join(record.remarks)


@pytest.mark.parametrize("digits", [0, 1])
def test_rounded_times_are_even_times(digits):
    t = 1.37 * 10**-digits * np.arange(500)
    record = checked_record(np.round(t, digits), (t > t[60]) * 1.0, np.sqrt(t))
    assert record.t == pytest.approx(t, abs=10**-digits)
    assert record.u.size == 500 and record.sampling_time == pytest.approx(t[1], rel=2e-3)
    assert f"given to {10**-digits:g} s only" in " ".join(record.remarks)


def test_times_off_a_clock_that_shows_only_minutes_are_even_times():
    t = 100.0 * np.arange(200)
    record = checked_record(60 * np.floor(t / 60), (t > t[60]) * 1.0, np.sqrt(t))
    assert record.t == pytest.approx(t, abs=60) and record.u.size == 200
    assert "given to 60 s only" in " ".join(record.remarks)


@pytest.mark.thorough
@pytest.mark.parametrize("waits", ["uniform", "exponential"])
def test_times_without_any_order_are_resampled(waits):
    """A lag of 30 s logged whenever the logger came to it: its numbers are found all the same."""
    rng = np.random.default_rng(4)
    slow = rng.uniform(0.4, 1.6, 400) if waits == "uniform" else 1 + rng.exponential(0.6, 400)
    t = np.cumsum(slow)
    u = (t >= t[50]) * 1.0 - (t >= t[220]) * 1.0
    y = sum(
        sign * 2 * (1 - np.exp(-np.maximum(t - at - 5, 0) / 30))
        for sign, at in ((1, t[50]), (-1, t[220]))
    )
    with pytest.warns(UserWarning, match=r"the times lie between .* s apart: resampled"):
        found = identify(t, u, y + 0.01 * rng.standard_normal(400))
    told = {name: p.value for name, p in found.parameters.items()}
    assert told == pytest.approx({"gain": 2, "lag": 30, "dead time": 5}, rel=0.05)
    assert found.record.y.size == 400 and found.record.free.all()


@pytest.mark.parametrize("seed", range(5))
def test_resampled_records_keep_the_dynamics(seed):
    """A drifting clock with jitter, a lag of 30 samples: closed form at the even times."""
    rng = np.random.default_rng(seed)
    t = np.cumsum(1 + 0.2 * rng.random(400))
    step = t[50]

    def y(at):
        return np.where(at > step, 1 - np.exp(-(at - step) / 30), 0.0)

    record = checked_record(t, (t >= step) * 1.0, y(t))
    assert record.y == pytest.approx(y(record.t), abs=0.02)
    area = np.sum(record.u) * record.sampling_time
    assert area == pytest.approx(record.t[-1] + record.sampling_time - step, rel=1e-9)
    assert "resampled to one sample every" in " ".join(record.remarks + record.notes)


@pytest.mark.parametrize("quantum", [0.0907, 0.0129, 0.0634])
def test_a_coarse_sensor_with_printed_decimals_is_not_taken_for_cut_off(quantum):
    t = np.arange(400.0)
    drift = 1.2 * np.exp(-t / 10)
    y = 3000 * (1 - np.exp(-np.maximum(t - 61, 0) / 9000)) + drift
    printed = np.round(quantum * np.round(220 + y), 3)
    assert len(set(np.diff(printed).round(6)) - {0.0}) > 2  # one step, printed in several ways
    assert checked_record(t, (t > 60) * 50.0, printed).free.all()


def test_a_resampled_value_beside_a_cut_off_one_is_left_out_too():
    t = np.arange(200.0)
    t[1:-1] += 0.06 * (-1.0) ** np.arange(199)[:-1]
    y = np.minimum(0.05 * np.maximum(t - 20.5, 0), 2.0)
    record = checked_record(t, 1.0 * (t > 20.5), y)
    first = int(np.argmax(y == 2.0))
    after = np.searchsorted(t, record.t[: first + 2])
    assert t[first - 1] < record.t[first - 1] < t[first] == t[after[first - 1]]
    assert not record.free[first - 1] and record.free[first - 2]


def test_a_record_is_shown_without_its_numbers():
    shown = repr(checked_record(T, U, Y, name="pump"))
    assert "pump" in shown and "[" not in shown


@pytest.mark.parametrize(
    "cell",
    ["2024-01-31 24:00:00", "12:60:00", "12:00:60", "2024-01-31 13:00:00 PM", "0:30:00 PM"],
)
def test_what_is_no_time_of_a_day_is_refused(cell):
    with pytest.raises(ValueError, match="which is no time of a day"):
        seconds_in([cell], "line {}".format)


def test_a_clock_is_not_taken_for_the_input(tmp_path):
    path = tmp_path / "two.csv"
    t = np.arange(60) * 0.1
    np.savetxt(path, np.column_stack([t, 1 - np.exp(-t)]), delimiter=",")
    with pytest.raises(ValueError, match=r"column 1 of two\.csv grows in every line, as times do"):
        read_data(path, sampling_time=0.1)
    assert read_data(path, sampling_time=0.1, columns={"u": 1, "y": 2}).u[-1] == t[-1]


RECORD = [(0.1 * k, k % 9 // 5, k % 7 / 4) for k in range(40)]


def _read(tmp_path, head, row, **options):
    path = tmp_path / "data.csv"
    path.write_text(head + "".join(row(k, *each) + "\n" for k, each in enumerate(RECORD)))
    record = read_data(path, **options)
    assert record.u.tolist() == [u for _, u, _ in RECORD]
    assert record.y == pytest.approx([y for *_, y in RECORD])
    return record


def test_a_comma_and_a_blank_between_cells_beside_dates(tmp_path):
    _read(
        tmp_path, "",
        lambda k, t, u, y: f"heater, {u}, {y}, 2024-01-31 12:00:{k:02d}.5",
        columns={"t": 4, "u": 2, "y": 3},
    )  # fmt: skip


def test_a_cell_in_quotes_may_go_on_in_the_next_line(tmp_path):
    _read(tmp_path, 't,u,"y\n(°C)"\n', lambda k, t, u, y: f'{t},{u},"{y}\n"')


def test_what_describes_a_table_above_it_is_no_row_of_it(tmp_path):
    scope = _read(
        tmp_path, "x-axis,1,2\nsecond,Volt,Volt\n", lambda k, t, u, y: f"{t},{u},{y}"
    )  # fmt: skip
    # The headings are alike, so the option in the remark has their numbers.
    assert "--columns t=second,u=2,y=3;" in scope.remarks[0]
    logger = _read(
        tmp_path,
        "Logger\nChannels\t2\nSamples\t40\t40\nX0\t0,0\t0,0\n***\t\nX_Value\tu\ty\tComment\n",
        lambda k, t, u, y: f"{t}\t{u}\t{y}".replace(".", ",") + "\tstart" * (k == 3),
        columns={"t": "X_Value"},
    )
    assert any("above the headings" in note for note in logger.notes)


def test_a_heading_with_a_comma_is_not_taken_for_one_without_cells(tmp_path):
    with pytest.raises(ValueError, match="line 2 has 4 cells where the first has 5"):
        _read(tmp_path, "t,y (°C, top),u,v\n", lambda k, t, u, y: f"{t},{y},{u},0")


def test_words_above_numbers_without_headings(tmp_path):
    record = _read(tmp_path, "Ready.\n", lambda k, t, u, y: f"{t} {u} {y}")
    assert any(note.startswith("line 1 is above the numbers") for note in record.notes)


def test_times_are_the_column_of_dates_and_empty_columns_are_nothing(tmp_path):
    record = _read(
        tmp_path,
        "created_at,entry_id,field1,field2,latitude\n",
        lambda k, t, u, y: f"2024-01-31 12:00:{k:02d} UTC,{k + 7},{u},{y},",
    )
    assert record.t.tolist() == list(range(40))
    assert record.remarks[0].startswith("the headings do not say which columns hold u and y: ")
    record = _read(
        tmp_path,
        "Datum;Uhrzeit;Heizung;Ofen\n",
        lambda k, t, u, y: f"31.01.2024;12:00:{k:02d};{u};{y}",
    )
    assert record.t.tolist() == list(range(40))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('{"12:00:00": {"u": 1, "y": 2}}', "no table, but looks like JSON or XML: save it as CSV"),
        ("t,u,y\n0,1,2\n1,\x004,3\n", "see line 3.*if that line alone is damaged, take it out"),
        ("t,u,y\n0,idle,2\n1,heat,3\n", "line 2: u is 'idle'.*write numbers in place of words"),
        ("yVal,uVal,v,Ts\n" + "1,2,3,4\n" + "1,2,3,\n" * 30, "choose.*u=uVal,y=yVal;"),
        ("u,y,Ts\n" + "1,2,4\n" + "1,2,\n" * 30, "t is empty.*give the sampling time"),
    ],
)
def test_what_to_do_with_a_file_that_cannot_be_read_as_it_is(tmp_path, text, said):
    path = tmp_path / "data.csv"
    path.write_text(text)
    with pytest.raises(ValueError, match=f"(?s){said}"):
        read_data(path)


def test_a_row_between_two_samples_is_no_missing_one():
    t = np.insert(np.arange(100.0), 50, 49.3)
    record = checked_record(t, np.sign(np.sin(t / 5)), np.sin(t / 9))
    (said,) = record.remarks
    assert "between 0.3 and 1 s apart: resampled" in said and "missing" not in said
    assert record.y == pytest.approx(np.sin(record.t / 9), abs=5e-3)


def test_a_heater_that_is_on_or_off_is_an_input_of_1_and_0(tmp_path):
    path = tmp_path / "data.csv"
    for words in (("off", "on"), ("FALSE", "TRUE")):
        path.write_text(replaced(lambda k, words=words: f"{k},{words[k // 7 % 2]},{k % 5}"))
        record = read_data(path)
        assert record.u.tolist() == [k // 7 % 2 for k in range(60)]
        (said,) = record.remarks
        assert said.startswith(f"u is '{words[0]}' or '{words[1]}', read as 0 and 1")


def test_a_minus_sign_may_be_that_of_print(tmp_path):
    path = tmp_path / "data.csv"
    path.write_text(replaced(lambda k: f"{k};{k // 7 % 2};{k % 5 - 2}").replace("-", "\u2212"))
    assert read_data(path).y[:5].tolist() == [-2, -1, 0, 1, 2]


def test_missing_values_are_missing_samples(tmp_path):
    text, options = DRESSES["missing values"]
    path = tmp_path / "data.csv"
    path.write_text(text)
    record = read_data(path, **options)
    assert np.flatnonzero(~record.free).tolist() == [57, 95, 117, 177, 237, 297, 357]
    assert any("missing in line 59 and 6 more" in note for note in record.notes)


@pytest.mark.slow
def test_what_moves_like_an_output_and_is_called_u_is_doubted():
    with pytest.warns(UserWarning, match="as if u and y were swapped"):
        identify(T, Y, U, structure="one lag with dead time")
