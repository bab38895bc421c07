"""What an analysis is to the service: everything that its surfaces say and do, in one record."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from pydantic import BaseModel

from service.effort import Effort
from service.printing import Part
from service.schemas.drawn import Drawn
from service.schemas.fields import AnalysisRequest
from service.schemas.jobs import JobState

if TYPE_CHECKING:
    from solver.tuning.record import Progress

OnProgress = Callable[["Progress"], bool]

__all__ = ["Analysis", "Figures", "LongWork", "OnProgress", "always", "compute"]

_Request = TypeVar("_Request", bound=AnalysisRequest)
_Result = TypeVar("_Result", bound=BaseModel)
_Drawn = TypeVar("_Drawn", bound=Drawn)


@dataclass(frozen=True, kw_only=True)
class Figures(Generic[_Drawn]):
    """The figures of an analysis.

    Parameters
    ----------
    of : str
        What they show, with its article: ``a step response``.
    drawn : type
        Model of those parts of the result that are drawn.
    draw : callable
        From those parts and the name of the unit of time to the JSON object that
        `service.schemas.figures.FiguresResult` describes. It imports Plotly itself: a function of
        a module, called in another process.

    """

    of: str
    drawn: type[_Drawn]
    draw: Callable[[_Drawn, str], dict[str, Any]]


def always(request: AnalysisRequest) -> bool:
    """Say yes: every request of this kind is answered by the process that reads it."""
    del request
    return True


def _never(request: AnalysisRequest) -> bool:
    del request
    return False


@dataclass(frozen=True, kw_only=True)
class LongWork(Generic[_Request]):
    """How an analysis is computed over HTTP that takes longer than a request may wait: as a job.

    Parameters
    ----------
    model : type
        Model of the job.
    compute : callable
        As `Analysis.compute`, with `on_progress`: called often with how far it is. What it raises
        ends the computation; True says that no better result is wanted.
    time_limit : callable or None
        Seconds at /search/time_limit of a request, after which it ends by itself; None: it has no
        such field.

    """

    model: type[JobState]
    compute: Callable[[_Request, OnProgress], dict[str, Any]]
    time_limit: Callable[[_Request], float] | None = None


@dataclass(frozen=True, kw_only=True)
class Analysis(Generic[_Request, _Result]):
    """An analysis.

    The name of its module is that of its command.

    Parameters
    ----------
    name : str
        Method of the client, and part of the identifiers in OpenAPI.
    resource : str
        Last part of its URL path, and of that of its figures.
    text : str
        The docstring of its module: what it does, in a few words; then what it returns.
    outcome : str
        What the result is, in a few words.
    request, result : type
        Models of both.
    compute : callable
        From request to the JSON values of the result. It imports itself what it computes with: a
        function of a module, called in another process.
    computes_with : tuple of str
        Modules of the solver that it imports; the processes that compute have them imported.
    table : callable
        From result to what people read in a terminal.
    fails : callable or None
        Whether a result says that nothing further can be said, as of unstable loops: the command
        then ends with the exit code of an infeasible task.
    figures : Figures or None
        Its figures, where it has any.
    effort : callable or None
        From what a request builds to what computing it costs, where that can be more than a
        request may take.
    job : LongWork or None
        How it is computed as a job; None: its result comes with the response to its request.
    immediate : callable
        From request to whether it is computed by the process that reads it: arithmetic on a few
        numbers, which should not wait behind others.

    """

    name: str
    resource: str
    text: str
    outcome: str
    request: type[_Request]
    result: type[_Result]
    compute: Callable[[_Request], dict[str, Any]]
    computes_with: tuple[str, ...] = ()
    table: Callable[[_Result], Sequence[Part]]
    figures: Figures[Any] | None = None
    fails: Callable[[_Result], bool] | None = None
    effort: Callable[[Any], Effort | None] | None = None
    job: LongWork[_Request] | None = None
    immediate: Callable[[_Request], bool] = _never

    @property
    def summary(self) -> str:
        """What it does, without full stop."""
        return self.text.partition("\n")[0].removesuffix(".")

    @property
    def description(self) -> str:
        """What it returns."""
        return " ".join(self.text.partition("\n")[2].split())

    @property
    def path(self) -> str:
        """URL path."""
        return f"/v1/{self.resource}"


def compute(
    function: Callable[[AnalysisRequest], dict[str, Any]], request: AnalysisRequest
) -> dict[str, Any]:
    """Return what the `compute` of an analysis finds, with the identity of the request."""
    return function(request) | request.identity()
