"""mutune: robust settings of PI and PID loops for units in parallel, from Python.

What is named here is the public interface; the packages behind it may move. A part is loaded
when it is first used.

>>> import mutune
>>> plant = mutune.first_order(2, gain=1, time_constant=100, interaction=0.949)
>>> uncertainty = mutune.Uncertainty.from_error(0.2, 1)
>>> result = mutune.tune(plant, uncertainty, max_peak=2)  # doctest: +SKIP
>>> print(result)  # doctest: +SKIP
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from solver import __version__

if TYPE_CHECKING:
    from service.client import Client, JobEndedError, ServiceError, ServiceUnreachableError
    from service.configuration import Configuration
    from service.http.app import create_app
    from solver.certificate.reading import read_certificate
    from solver.certificate.record import Certificate, Claim, ProvenInterval
    from solver.certificate.search import CertificateFailure, Obstacle, certify
    from solver.certificate.verify import Verdict, Verification, check, verify
    from solver.identification.cover import cover, cover_by_error
    from solver.identification.equality import Equality
    from solver.identification.findings import Estimate, FittedElement
    from solver.identification.identify import Alternative, Identification, identify
    from solver.identification.prediction import Prediction
    from solver.identification.problem import PlantStructure
    from solver.identification.reading import read_record
    from solver.identification.record import Record
    from solver.identification.relay_record import relay_record, relay_records
    from solver.identification.selection import Allowed
    from solver.identification.uncertainty import Cover
    from solver.interaction.analysis import Interaction, RelativeGainCurves, analyse_interaction
    from solver.interaction.decoupling import Decoupling, DecouplingSpecification, decouple
    from solver.interaction.drive_simulation import (
        DriveExperiment,
        DriveScenario,
        DriveSimulation,
        simulate_drives,
    )
    from solver.interaction.loop_effect import LoopEffect, loop_effect
    from solver.interaction.loop_effect_query import LoopEffectQuery
    from solver.interaction.loop_shape import RobustnessLimits
    from solver.interaction.pairing import (
        Pairing,
        PairingRanking,
        niederlinski_index,
        rank_pairings,
    )
    from solver.interaction.parallel_drives import (
        Drive,
        DriveAnalysis,
        ParallelDrives,
        analyse_drives,
    )
    from solver.interaction.relative_gain import relative_gain_array
    from solver.interaction.zeros import TransmissionZeros, Zero, transmission_zeros
    from solver.limits.comparison import ControllerComparison, compare_controllers
    from solver.limits.lower_bound import LowerBound
    from solver.limits.multivariable import multivariable_limit
    from solver.limits.record import Limit, LimitStatus, Realised
    from solver.model.arranged import paired, sampled
    from solver.model.controllers import Controller, IdealForm, ParallelForm
    from solver.model.errors import Cancelled, InvalidInputError, MutuneError, UnsupportedPlantError
    from solver.model.from_state_space import from_state_space
    from solver.model.measured import MeasuredPlant
    from solver.model.mixing import Mixing, mixed
    from solver.model.mode_controller import ModeController
    from solver.model.neighbours import NeighbourPlant
    from solver.model.parallel_equipment import (
        BurnerPasses,
        ParallelCompressors,
        ParallelExchangers,
    )
    from solver.model.peaks import Peak
    from solver.model.physical_models import Blender, CooledReactors, StreamSplit
    from solver.model.plants import MatrixPlant, ParallelPlant, Plant, first_order
    from solver.model.state_space import StateSpace
    from solver.model.transfer_function import TransferFunction
    from solver.model.weights import Performance, Structure, Uncertainty
    from solver.optimality.record import Optimality, Proof
    from solver.relay.analysis import RelayOutcome, relay_experiment
    from solver.relay.experiment import PlacedLoop, Relay, RelayExperiment
    from solver.robustness.analysis import analyse
    from solver.robustness.centralised import (
        Centralised,
        analyse_centralised,
    )
    from solver.robustness.integrity import Detuning, Integrity, ServiceClass, integrity
    from solver.robustness.margins import LoopMargins, Margins, loop_margins
    from solver.robustness.record import (
        Curves,
        Guarantee,
        GuaranteeStatus,
        MarginsGuarantee,
        Peaks,
        Robustness,
    )
    from solver.robustness.worst_case import DiagonalPerturbation, RankOnePerturbation, WorstCase
    from solver.simulation.actuators import CoupledActuators, OwnActuators
    from solver.simulation.directions import difficult_direction, easy_direction
    from solver.simulation.experiment import Experiment, Step, StepKind
    from solver.simulation.integrator import End
    from solver.simulation.loops import Limits, Loop
    from solver.simulation.step_response import Metrics, StepResponse, UnitResponse, step_response
    from solver.simulation.worst_actuators import with_worst_actuators, worst_actuators
    from solver.tuning.beside import (
        AsFound,
        PriceOfResolution,
        SettingMove,
        SettingRange,
        SettingsTolerance,
    )
    from solver.tuning.demands import DemandOutcome, Demands, IntegrityDemand
    from solver.tuning.record import (
        Comparison,
        LocalOptimum,
        Progress,
        ScenarioOutcome,
        SearchSummary,
        Status,
        Tuning,
    )
    from solver.tuning.resolution import Resolution
    from solver.tuning.scenarios import Scenario
    from solver.tuning.specification import (
        Arrangement,
        Bounds,
        ControllerKind,
        Objective,
        Signs,
        Specification,
    )
    from solver.tuning.spread import Spread, SpreadOutcome, SpreadProof
    from solver.workbench.interchange import from_control, plant, to_control
    from solver.workbench.response import Response
    from solver.workbench.tuned import InfeasibleError, Tuned, load
    from solver.workbench.tuning import tune

__all__ = [
    "Allowed",
    "Alternative",
    "Arrangement",
    "AsFound",
    "Blender",
    "Bounds",
    "BurnerPasses",
    "Cancelled",
    "Centralised",
    "Certificate",
    "CertificateFailure",
    "Claim",
    "Client",
    "Comparison",
    "Configuration",
    "Controller",
    "ControllerComparison",
    "ControllerKind",
    "CooledReactors",
    "CoupledActuators",
    "Cover",
    "Curves",
    "Decoupling",
    "DecouplingSpecification",
    "DemandOutcome",
    "Demands",
    "Detuning",
    "DiagonalPerturbation",
    "Drive",
    "DriveAnalysis",
    "DriveExperiment",
    "DriveScenario",
    "DriveSimulation",
    "End",
    "Equality",
    "Estimate",
    "Experiment",
    "FittedElement",
    "Guarantee",
    "GuaranteeStatus",
    "IdealForm",
    "Identification",
    "InfeasibleError",
    "Integrity",
    "IntegrityDemand",
    "Interaction",
    "InvalidInputError",
    "JobEndedError",
    "Limit",
    "LimitStatus",
    "Limits",
    "LocalOptimum",
    "Loop",
    "LoopEffect",
    "LoopEffectQuery",
    "LoopMargins",
    "LowerBound",
    "Margins",
    "MarginsGuarantee",
    "MatrixPlant",
    "MeasuredPlant",
    "Metrics",
    "Mixing",
    "ModeController",
    "MutuneError",
    "NeighbourPlant",
    "Objective",
    "Obstacle",
    "Optimality",
    "OwnActuators",
    "Pairing",
    "PairingRanking",
    "ParallelCompressors",
    "ParallelDrives",
    "ParallelExchangers",
    "ParallelForm",
    "ParallelPlant",
    "Peak",
    "Peaks",
    "Performance",
    "PlacedLoop",
    "Plant",
    "PlantStructure",
    "Prediction",
    "PriceOfResolution",
    "Progress",
    "Proof",
    "ProvenInterval",
    "RankOnePerturbation",
    "Realised",
    "Record",
    "RelativeGainCurves",
    "Relay",
    "RelayExperiment",
    "RelayOutcome",
    "Resolution",
    "Response",
    "Robustness",
    "RobustnessLimits",
    "Scenario",
    "ScenarioOutcome",
    "SearchSummary",
    "ServiceClass",
    "ServiceError",
    "ServiceUnreachableError",
    "SettingMove",
    "SettingRange",
    "SettingsTolerance",
    "Signs",
    "Specification",
    "Spread",
    "SpreadOutcome",
    "SpreadProof",
    "StateSpace",
    "Status",
    "Step",
    "StepKind",
    "StepResponse",
    "StreamSplit",
    "Structure",
    "TransferFunction",
    "TransmissionZeros",
    "Tuned",
    "Tuning",
    "Uncertainty",
    "UnitResponse",
    "UnsupportedPlantError",
    "Verdict",
    "Verification",
    "WorstCase",
    "Zero",
    "__version__",
    "analyse",
    "analyse_centralised",
    "analyse_drives",
    "analyse_interaction",
    "certify",
    "check",
    "compare_controllers",
    "cover",
    "cover_by_error",
    "create_app",
    "decouple",
    "difficult_direction",
    "easy_direction",
    "first_order",
    "from_control",
    "from_state_space",
    "identify",
    "integrity",
    "load",
    "loop_effect",
    "loop_margins",
    "mixed",
    "multivariable_limit",
    "niederlinski_index",
    "paired",
    "plant",
    "rank_pairings",
    "read_certificate",
    "read_record",
    "relative_gain_array",
    "relay_experiment",
    "relay_record",
    "relay_records",
    "sampled",
    "simulate_drives",
    "step_response",
    "to_control",
    "transmission_zeros",
    "tune",
    "verify",
    "with_worst_actuators",
    "worst_actuators",
]

# Where each name lives; a test holds it to the imports above.
_HOMES = {
    "service.client": "Client JobEndedError ServiceError ServiceUnreachableError",
    "service.configuration": "Configuration",
    "service.http.app": "create_app",
    "solver.certificate.reading": "read_certificate",
    "solver.certificate.record": "Certificate Claim ProvenInterval",
    "solver.certificate.search": "CertificateFailure Obstacle certify",
    "solver.certificate.verify": "Verdict Verification check verify",
    "solver.identification.cover": "cover cover_by_error",
    "solver.identification.equality": "Equality",
    "solver.identification.findings": "Estimate FittedElement",
    "solver.identification.identify": "Alternative Identification identify",
    "solver.identification.prediction": "Prediction",
    "solver.identification.problem": "PlantStructure",
    "solver.identification.reading": "read_record",
    "solver.identification.record": "Record",
    "solver.identification.relay_record": "relay_record relay_records",
    "solver.identification.selection": "Allowed",
    "solver.identification.uncertainty": "Cover",
    "solver.interaction.analysis": "Interaction RelativeGainCurves analyse_interaction",
    "solver.interaction.decoupling": "Decoupling DecouplingSpecification decouple",
    "solver.interaction.drive_simulation": (
        "DriveExperiment DriveScenario DriveSimulation simulate_drives"
    ),
    "solver.interaction.loop_effect": "LoopEffect loop_effect",
    "solver.interaction.loop_effect_query": "LoopEffectQuery",
    "solver.interaction.loop_shape": "RobustnessLimits",
    "solver.interaction.pairing": "Pairing PairingRanking niederlinski_index rank_pairings",
    "solver.interaction.parallel_drives": "Drive DriveAnalysis ParallelDrives analyse_drives",
    "solver.interaction.relative_gain": "relative_gain_array",
    "solver.interaction.zeros": "TransmissionZeros Zero transmission_zeros",
    "solver.limits.lower_bound": "LowerBound",
    "solver.limits.comparison": "ControllerComparison compare_controllers",
    "solver.limits.multivariable": "multivariable_limit",
    "solver.limits.record": "Limit LimitStatus Realised",
    "solver.model.controllers": "Controller IdealForm ParallelForm",
    "solver.model.errors": "Cancelled InvalidInputError MutuneError UnsupportedPlantError",
    "solver.model.parallel_equipment": "BurnerPasses ParallelCompressors ParallelExchangers",
    "solver.model.peaks": "Peak",
    "solver.model.physical_models": "Blender CooledReactors StreamSplit",
    "solver.model.arranged": "paired sampled",
    "solver.model.from_state_space": "from_state_space",
    "solver.model.measured": "MeasuredPlant",
    "solver.model.mixing": "Mixing mixed",
    "solver.model.neighbours": "NeighbourPlant",
    "solver.model.plants": "MatrixPlant ParallelPlant Plant first_order",
    "solver.model.state_space": "StateSpace",
    "solver.model.transfer_function": "TransferFunction",
    "solver.model.weights": "Performance Structure Uncertainty",
    "solver.optimality.record": "Optimality Proof",
    "solver.relay.analysis": "RelayOutcome relay_experiment",
    "solver.relay.experiment": "PlacedLoop Relay RelayExperiment",
    "solver.robustness.analysis": "analyse",
    "solver.model.mode_controller": "ModeController",
    "solver.robustness.centralised": "Centralised analyse_centralised",
    "solver.robustness.integrity": "Detuning Integrity ServiceClass integrity",
    "solver.robustness.margins": "LoopMargins Margins loop_margins",
    "solver.robustness.record": (
        "Curves Guarantee GuaranteeStatus MarginsGuarantee Peaks Robustness"
    ),
    "solver.robustness.worst_case": "DiagonalPerturbation RankOnePerturbation WorstCase",
    "solver.simulation.actuators": "CoupledActuators OwnActuators",
    "solver.simulation.directions": "difficult_direction easy_direction",
    "solver.simulation.experiment": "Experiment Step StepKind",
    "solver.simulation.integrator": "End",
    "solver.simulation.loops": "Limits Loop",
    "solver.simulation.step_response": "Metrics StepResponse UnitResponse step_response",
    "solver.simulation.worst_actuators": "with_worst_actuators worst_actuators",
    "solver.tuning.beside": (
        "AsFound PriceOfResolution SettingMove SettingRange SettingsTolerance"
    ),
    "solver.tuning.demands": "DemandOutcome Demands IntegrityDemand",
    "solver.tuning.scenarios": "Scenario",
    "solver.tuning.spread": "Spread SpreadOutcome SpreadProof",
    "solver.tuning.record": (
        "Comparison LocalOptimum Progress ScenarioOutcome SearchSummary Status Tuning"
    ),
    "solver.tuning.resolution": "Resolution",
    "solver.tuning.specification": (
        "Arrangement Bounds ControllerKind Objective Signs Specification"
    ),
    "solver.workbench.interchange": "from_control plant to_control",
    "solver.workbench.response": "Response",
    "solver.workbench.tuned": "InfeasibleError Tuned load",
    "solver.workbench.tuning": "tune",
}
_HOME = {name: module for module, names in _HOMES.items() for name in names.split()}

if not TYPE_CHECKING:  # which would take any name for one that there is

    def __getattr__(name: str) -> Any:  # noqa: ANN401 - whatever is asked for
        """Load a part when it is first used."""
        if name not in _HOME:
            message = f"module {__name__!r} has no attribute {name!r}"
            raise AttributeError(message)
        found = getattr(import_module(_HOME[name]), name)
        globals()[name] = found
        return found


def __dir__() -> list[str]:
    return sorted(__all__)
