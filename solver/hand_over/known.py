"""Control systems whose law is public, with the page that says so.

Each equation is written as the manual has it, over signals in per cent of span and times in the
unit named beside it. Systems whose law no public page tells are not here.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from solver.hand_over.law import FilterEntry, Form, Law, Names

__all__ = ["KNOWN", "KnownController"]

_SIEMENS = "Siemens, PID Control for S7-300 and S7-400, manual C79000-G7076-C516-01, CONT_C"
_S7_1200 = "Siemens, S7-1200/S7-1500 PID control, function manual A5E35300227-AC, PID_Compact"
_PIDE = "Rockwell Automation, publication 1756-RM006K-EN-P (2018), p. 80, PIDE"
_PID = (
    "Rockwell Automation, Studio 5000 Logix Designer 37, Specifying tuning; publication "
    "1756-RM003N-EN-P (2011), p. 514, PID"
)
_GE = "GE, PACSystems CPU programmer's reference manual GFK-2950C (2018), section 7.4"
_FIELDBUS = "Emerson, Rosemount OCX8800A Fieldbus manual 00809-0500-4880 (2022), fig. 8-13"
_DELTAV = (
    "Emerson, DeltaV Books Online, PID function block parameters (ALPHA, RATE, RESET); PID "
    "function block, standard and series form"
)


@dataclass(frozen=True, kw_only=True)
class KnownController:
    """A control system's PID block.

    Parameters
    ----------
    name : str
        Identifier.
    title : str
        Maker, system and block.
    law : Law
        Its law and how settings are typed.
    time_unit : str
        Unit of typed times.
    equation : str
        The law as the maker writes it: from the deviation to the output, both in per cent of
        span; s is the Laplace variable in 1/`time_unit`.
    filter_rule : str
        How the derivative is filtered.
    source : str
        Where that is published.
    remark : str or None
        What else has to be set.

    """

    name: str
    title: str
    law: Law
    time_unit: Literal["s", "min"]
    equation: str
    filter_rule: str
    source: str
    remark: str | None = None


_RESET = Names(gain="GAIN", integral="RESET", derivative="RATE", filter="ALPHA")
_FIXED = "fixed at 0.1 RATE"
_ON_MEASUREMENT = "Set the filter on the measurement before the block, first order, as given."
_SMOOTHING = "Set .NDF, no derivative smoothing: its time is not published."
_STEPS = "The reference array takes them in steps that the manual names."


def _unfiltered(  # noqa: PLR0917 - columns of a table
    name: str,
    title: str,
    form: Form,
    names: tuple[str, str, str],
    time_unit: Literal["s", "min"],
    equation: str,
    source: str,
    remark: str = "",
) -> KnownController:
    """Return a block without a filter of its own; `names` of gain, integral and derivative."""
    gain, integral, derivative = names
    return KnownController(
        name=name,
        title=title,
        law=Law(
            form=form,
            filter=FilterEntry.MEASUREMENT,
            names=Names(gain=gain, integral=integral, derivative=derivative, filter="filter"),
        ),
        time_unit=time_unit,
        equation=equation,
        filter_rule="none of its own: a first-order filter on the measurement takes its place",
        source=source,
        remark=f"{remark} {_ON_MEASUREMENT}".lstrip(),
    )


KNOWN: tuple[KnownController, ...] = (
    KnownController(
        name="deltav_standard",
        title="Emerson DeltaV, PID block, FORM Standard",
        law=Law(form=Form.IDEAL, lowest=0.05, highest=1.0, names=_RESET),
        time_unit="s",
        equation="GAIN*(1 + 1/(RESET*s) + RATE*s/(1 + ALPHA*RATE*s))",
        filter_rule="ALPHA RATE, with ALPHA from 0.05 to 1, 0.125 by default",
        source=_DELTAV,
    ),
    KnownController(
        name="deltav_series",
        title="Emerson DeltaV, PID block, FORM Series",
        law=Law(form=Form.CASCADE, lowest=0.05, highest=1.0, names=_RESET),
        time_unit="s",
        equation="GAIN*(1 + 1/(RESET*s))*(1 + RATE*s)/(1 + ALPHA*RATE*s)",
        filter_rule="ALPHA RATE, with ALPHA from 0.05 to 1, 0.125 by default",
        source=_DELTAV,
    ),
    KnownController(
        name="fieldbus_standard",
        title="Emerson Rosemount Fieldbus, PID block, Standard",
        law=Law(form=Form.IDEAL, lowest=0.1, highest=0.1, names=_RESET),
        time_unit="s",
        equation="GAIN*(1 + 1/(RESET*s) + RATE*s/(1 + 0.1*RATE*s))",
        filter_rule=_FIXED,
        source=_FIELDBUS,
    ),
    KnownController(
        name="fieldbus_series",
        title="Emerson Rosemount Fieldbus, PID block, Series",
        law=Law(form=Form.CASCADE, lowest=0.1, highest=0.1, names=_RESET),
        time_unit="s",
        equation="GAIN*(1 + 1/(RESET*s))*(1 + RATE*s)/(1 + 0.1*RATE*s)",
        filter_rule=_FIXED,
        source=_FIELDBUS,
    ),
    KnownController(
        name="siemens_cont_c",
        title="Siemens S7-300/400, FB 41 CONT_C",
        law=Law(
            form=Form.IDEAL,
            filter=FilterEntry.TIME,
            signed=True,
            names=Names(gain="GAIN", integral="TI", derivative="TD", filter="TM_LAG"),
        ),
        time_unit="s",
        equation="GAIN*(1 + 1/(TI*s) + TD*s/(1 + TM_LAG*s))",
        filter_rule="TM_LAG, free",
        source=_SIEMENS,
        remark="Direct action is a negative GAIN.",
    ),
    KnownController(
        name="siemens_pid_compact",
        title="Siemens S7-1200/1500, PID_Compact",
        law=Law(
            form=Form.IDEAL,
            names=Names(gain="Gain", integral="Ti", derivative="Td", filter="TdFiltRatio"),
        ),
        time_unit="s",
        equation="Gain*(1 + 1/(Ti*s) + Td*s/(1 + TdFiltRatio*Td*s))",
        filter_rule="TdFiltRatio Td, free, 0.2 by default",
        source=_S7_1200,
        remark="PWeighting and DWeighting act on the set point only. Direct action: InvertControl.",
    ),
    KnownController(
        name="siemens_pidconl",
        title="Siemens PCS 7, PIDConL",
        law=Law(
            form=Form.IDEAL,
            filter=FilterEntry.GAIN,
            lowest=0.1,
            highest=1.0,
            signed=True,
            names=Names(gain="Gain", integral="TI", derivative="TD", filter="DiffGain"),
        ),
        time_unit="s",
        equation="Gain*(1 + 1/(TI*s) + TD*s/(1 + TD/DiffGain*s))",
        filter_rule="TD/DiffGain, with DiffGain from 1 to 10, 5 by default",
        source=(
            "Siemens Industry Online Support forum, conversions of PCS 7 controllers (post 384311)"
            "; industrialmonitordirect.com, PCS7 PID Tuner DiffGain configuration"
        ),
        remark="Direct action is a negative Gain.",
    ),
    KnownController(
        name="mitsubishi_s_pid",
        title="Mitsubishi MELSEC Q/L/iQ-R, S.PID (inexact differential)",
        law=Law(
            form=Form.IDEAL,
            filter=FilterEntry.GAIN,
            names=Names(gain="Kp", integral="Ti", derivative="Td", filter="Kd"),
        ),
        time_unit="s",
        equation="Kp*(1 + 1/(Ti*s) + Td*s/(1 + Td/Kd*s))",
        filter_rule="Td/Kd, free, Kd = 8 recommended",
        source=(
            "Mitsubishi Electric, MELSEC-Q/L/QnA programming manual (PID control instructions) "
            "SH-080040; MELSEC-Q/L PIDPRMW, p. 6-13"
        ),
        remark="Typed in steps: Kp 0.01, Ti 0.1 s, Td 0.01 s, Kd 0.01.",
    ),
    KnownController(
        name="rockwell_micrologix",
        title="Rockwell MicroLogix 1100/1400, PID",
        law=Law(
            form=Form.IDEAL,
            lowest=1 / 16,
            highest=1 / 16,
            names=Names(gain="Kc", integral="Ti", derivative="Td"),
        ),
        time_unit="min",
        equation="Kc*(1 + 1/(Ti*s) + Td*s/(1 + Td/16*s))",
        filter_rule="fixed at Td/16",
        source="Rockwell Automation, publication 1766-RM001A-EN-P (2008), p. 330",
        remark="With bit RG set, steps are 0.01.",
    ),
    _unfiltered(
        "rockwell_pide_dependent",
        "Rockwell Logix 5000, PIDE, dependent gains",
        Form.IDEAL,
        ("PGain", "IGain", "DGain"),
        "min",
        "PGain*(1 + 1/(IGain*s) + DGain*s)/(1 + filter*s)",
        _PIDE,
    ),
    _unfiltered(
        "rockwell_pide_independent",
        "Rockwell Logix 5000, PIDE, independent gains",
        Form.PARALLEL,
        ("PGain", "IGain", "DGain"),
        "min",
        "(PGain + IGain/s + DGain*s)/(1 + filter*s)",
        _PIDE,
    ),
    _unfiltered(
        "rockwell_pid_dependent",
        "Rockwell Logix 5000, PID, dependent gains",
        Form.IDEAL,
        ("Kp", "Ki", "Kd"),
        "min",
        "Kp*(1 + 1/(Ki*s) + Kd*s)/(1 + filter*s)",
        _PID,
        _SMOOTHING,
    ),
    _unfiltered(
        "rockwell_pid_independent",
        "Rockwell Logix 5000, PID, independent gains",
        Form.PARALLEL,
        ("Kp", "Ki", "Kd"),
        "s",
        "(Kp + Ki/s + Kd*s)/(1 + filter*s)",
        _PID,
        _SMOOTHING,
    ),
    _unfiltered(
        "ge_pid_isa",
        "GE PACSystems, PID_ISA",
        Form.IDEAL,
        ("Kc", "Ti", "Td"),
        "s",
        "Kc*(1 + 1/(Ti*s) + Td*s)/(1 + filter*s)",
        _GE,
        _STEPS,
    ),
    _unfiltered(
        "ge_pid_ind",
        "GE PACSystems, PID_IND",
        Form.PARALLEL,
        ("Kp", "Ki", "Kd"),
        "s",
        "(Kp + Ki/s + Kd*s)/(1 + filter*s)",
        _GE,
        _STEPS,
    ),
    KnownController(
        name="beckhoff_basic_pid",
        title="Beckhoff TwinCAT, FB_BasicPID",
        law=Law(
            form=Form.IDEAL,
            filter=FilterEntry.TIME,
            names=Names(gain="fKp", integral="fTn", derivative="fTv", filter="fTd"),
        ),
        time_unit="s",
        equation="fKp*(1 + 1/(fTn*s) + fTv*s/(1 + fTd*s))",
        filter_rule="fTd, free",
        source="Beckhoff Information System, TwinCAT 3 Tc2_Utilities, FB_BasicPID",
    ),
    KnownController(
        name="yokogawa_fieldbus",
        title="Yokogawa YVP110/YTA Fieldbus, PID block",
        law=Law(
            form=Form.IDEAL,
            filter=FilterEntry.MEASUREMENT,
            names=Names(gain="GAIN", integral="RESET", derivative="RATE", filter="PV_FTIME"),
        ),
        time_unit="s",
        equation="GAIN*(1 + 1/(RESET*s) + RATE*s)/(1 + PV_FTIME*s)",
        filter_rule="PV_FTIME, a first-order filter on the measurement",
        source="Yokogawa, YVP110 manual IM 21B04C01-01E, pp. 16-2 and 16-3",
    ),
)
