"""A client of the service for Python programs.

>>> from service.client import Client  # doctest: +SKIP
>>> with Client("http://127.0.0.1:8000") as client:  # doctest: +SKIP
...     result = client.tune(request)
>>> result.tau_p  # doctest: +SKIP
18.446
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from types import TracebackType
from typing import TYPE_CHECKING, Any, Literal, Self, TypeVar

import httpx
from pydantic import BaseModel, ValidationError

from service import registry
from service.analysis import Analysis
from service.problems import MEDIA_TYPE, Problem
from service.schemas import TuningRequest, TuningResult
from service.schemas.batches import Batch, BatchList
from service.schemas.fields import AnalysisRequest
from service.schemas.jobs import Job, JobProgress, JobState

__all__ = ["BatchItem", "Client", "JobEndedError", "ServiceError", "ServiceUnreachableError"]

_WAIT = {"Prefer": "wait=30"}  # most jobs that are analyses end within that
_SILENCE = 60.0  # seconds without an event; the service sends a sign of life every 15
_PATIENCE = 60.0  # seconds in which a service that went away may come back
_RETRY = 0.5
_TRANSIENT = {502, 503, 504}  # what the service, or a proxy before it, says while it restarts

OnProgress = Callable[[JobProgress], None]
_Request = TypeVar("_Request", bound=AnalysisRequest)
_Result = TypeVar("_Result", bound=BaseModel)


class ServiceUnreachableError(Exception):
    """The service does not answer."""


class ServiceError(Exception):
    """The service refused a request.

    Parameters
    ----------
    status : int
        HTTP status.
    problem : Problem or None
        What the service said, None where something else answered in its place.

    """

    def __init__(self, status: int, problem: Problem | None) -> None:
        reason = "no problem document" if problem is None else f"{problem.title}: {problem.detail}"
        super().__init__(f"{status}: {reason}")
        self.status = status
        self.problem = problem


class JobEndedError(Exception):
    """A job ended without a result.

    Parameters
    ----------
    job : JobState
        The job, with its status and error.

    """

    def __init__(self, job: JobState) -> None:
        reason = "" if job.error is None else f": {job.error.detail}"
        super().__init__(f"job {job.id} {job.status.replace('_', ' ')}{reason}")
        self.job = job


class Client:
    """Connection to a running service. A context manager.

    Parameters
    ----------
    url : str
        Where the service is.
    api_key : str or None
        Key from ``mutune keys create``, where the service asks for one.

    """

    def __init__(self, url: str = "http://127.0.0.1:8000", api_key: str | None = None) -> None:
        headers = {} if api_key is None else {"Authorization": f"Bearer {api_key}"}
        timeout = httpx.Timeout(30.0, read=_SILENCE)
        self._http = httpx.Client(base_url=url, headers=headers, timeout=timeout)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close the connections."""
        self._http.close()

    def tune(
        self, request: TuningRequest | Mapping[str, Any], on_progress: OnProgress | None = None
    ) -> TuningResult:
        """Submit a tuning and wait for its result.

        Parameters
        ----------
        request : TuningRequest or mapping
            The request, or its JSON object.
        on_progress : callable or None
            Called at each change.

        Raises
        ------
        ServiceError, ServiceUnreachableError, JobEndedError
            See there.

        """
        job = self.wait(self.submit(request).id, on_progress)
        if job.result is None:
            raise JobEndedError(job)
        return job.result

    def submit(
        self, request: TuningRequest | Mapping[str, Any], idempotency_key: str | None = None
    ) -> Job:
        """Submit a tuning; the service keeps it, come what may.

        Parameters
        ----------
        request : TuningRequest or mapping
            The request, or its JSON object.
        idempotency_key : str or None
            Submitting again under the same key returns the same job.

        """
        headers = {} if idempotency_key is None else {"Idempotency-Key": idempotency_key}
        response = self._send("POST", "/v1/tunings", _document(request), headers)
        return Job.model_validate_json(response.content)

    def get(self, job_id: str) -> Job:
        """Return the job as it is now."""
        return Job.model_validate_json(self._send("GET", f"/v1/tunings/{job_id}").content)

    def cancel(self, job_id: str) -> Job:
        """Ask a job to stop; one that has ended stays as it is."""
        return Job.model_validate_json(self._send("DELETE", f"/v1/tunings/{job_id}").content)

    def forget(self, job_id: str) -> Job:
        """Delete a job that has ended, for ever; return it as it was."""
        path = f"/v1/tunings/{job_id}?forget=true"
        return Job.model_validate_json(self._send("DELETE", path).content)

    def wait(self, job_id: str, on_progress: OnProgress | None = None) -> Job:
        """Return the job once it has ended, however it ended.

        A service that is restarted meanwhile goes on with the job, and the wait with it.

        Raises
        ------
        ServiceUnreachableError
            The service went away and did not come back within a minute.

        """
        return Job.model_validate_json(self._ended(f"/v1/tunings/{job_id}", on_progress))

    def _ended(self, path: str, on_progress: OnProgress | None) -> str:
        """Return the job at `path` as JSON once it has ended."""
        recovery = _Recovery()
        while True:
            with recovery:
                for event, data in _parse(self._lines(f"{path}/events")):
                    recovery.succeeded()
                    if event == "done":
                        return data
                    if on_progress is not None:
                        on_progress(_Event.model_validate_json(data).progress)
            time.sleep(_RETRY)

    def submit_batch(
        self,
        requests: Iterable[TuningRequest | Mapping[str, Any]],
        idempotency_key: str | None = None,
        *,
        on_error: Literal["refuse", "skip"] = "refuse",
    ) -> Batch:
        """Submit many tunings at once; the service accepts all of them, or none.

        Parameters
        ----------
        requests : iterable of TuningRequest or mapping
            The requests.
        idempotency_key : str or None
            Submitting again under the same key returns the same batch.
        on_error : str
            ``"skip"``: faulty tunings become jobs that have failed; ``"refuse"``: they have the
            whole batch refused.

        """
        headers = {} if idempotency_key is None else {"Idempotency-Key": idempotency_key}
        tunings = [_document(request) for request in requests]
        document = {"tunings": tunings, "on_error": on_error}
        response = self._send("POST", "/v1/batches", document, headers)
        return Batch.model_validate_json(response.content)

    def batches(self) -> list[Batch]:
        """Return the newest batches, newest first."""
        content = self._send("GET", "/v1/batches").content
        return BatchList.model_validate_json(content).items

    def results(self, batch_id: str, *, curves: bool = True) -> Iterator[BatchItem]:
        """Yield the results of a batch in order, each as soon as it is there.

        Parameters
        ----------
        batch_id : str
            The batch.
        curves : bool
            Whether they keep their curves over frequency, most of their size.

        Raises
        ------
        ServiceUnreachableError
            The service went away and did not come back within a minute.

        """
        count = self._batch(batch_id).count
        start = 0
        recovery = _Recovery()
        while start < count:
            with recovery:
                path = f"/v1/batches/{batch_id}/results?start={start}&curves={curves}"
                for line in self._lines(path):
                    recovery.succeeded()
                    start += 1
                    yield BatchItem.model_validate_json(line)
            if start < count:
                time.sleep(_RETRY)

    def table(self, batch_id: str, *, rows: str = "request", form: str = "cascade") -> str:
        """Return the results of a batch as comma-separated values, once all have ended.

        Parameters
        ----------
        batch_id : str
            The batch.
        rows : str
            ``"request"`` or ``"loop"``: what a row stands for.
        form : str
            Form of the settings: ``"cascade"``, ``"ideal"`` or ``"parallel"``.

        Raises
        ------
        ServiceUnreachableError
            The service went away and did not come back within a minute.

        """
        recovery = _Recovery()
        finished = False
        while not finished:
            with recovery:
                finished = self._batch(batch_id).status == "finished"
                recovery.succeeded()
            if not finished:
                time.sleep(_RETRY)
        path = f"/v1/batches/{batch_id}/results?rows={rows}&form={form}"
        return self._send("GET", path, headers={"Accept": "text/csv"}).text

    def _batch(self, batch_id: str) -> Batch:
        return Batch.model_validate_json(self._send("GET", f"/v1/batches/{batch_id}").content)

    def analyse(
        self, analysis: Analysis[_Request, _Result], request: _Request | Mapping[str, Any]
    ) -> _Result:
        """Return the result of an analysis; each is also a method of its own name.

        Parameters
        ----------
        analysis : Analysis
            The `ANALYSIS` of a module in `service.analyses`.
        request : model or mapping
            The request, or its JSON object.

        Raises
        ------
        ServiceError, ServiceUnreachableError, JobEndedError
            See there.

        """
        response = self._send("POST", analysis.path, _document(request), _WAIT)
        if analysis.job is None:
            return analysis.result.model_validate_json(response.content)
        job = analysis.job.model.model_validate_json(response.content)
        if job.finished_at is None:
            content = self._ended(f"{analysis.path}/{job.id}", None)
            job = analysis.job.model.model_validate_json(content)
        result: _Result | None = getattr(job, "result", None)
        if result is None:
            raise JobEndedError(job)
        return result

    if TYPE_CHECKING:  # the methods of the analyses are added below

        def __getattr__(self, name: str) -> Callable[[BaseModel | Mapping[str, Any]], Any]: ...

    def _send(
        self,
        method: str,
        path: str,
        document: object | None = None,
        headers: Mapping[str, str] | None = None,
    ) -> httpx.Response:
        try:
            response = self._http.request(method, path, json=document, headers=headers)
        except httpx.TransportError as error:
            message = f"{self._http.base_url}: {error}"
            raise ServiceUnreachableError(message) from error
        _check(response)
        return response

    def _lines(self, path: str) -> Iterator[str]:
        """Yield the lines of a stream as they come."""
        with self._http.stream("GET", path) as response:
            if response.is_error:
                response.read()
            _check(response)
            yield from response.iter_lines()


def _method(analysis: Analysis[Any, Any]) -> Callable[..., Any]:
    def method(self: Client, request: BaseModel | Mapping[str, Any]) -> Any:  # noqa: ANN401 - of each its own
        return self.analyse(analysis, request)

    method.__name__ = analysis.name
    method.__qualname__ = f"{Client.__qualname__}.{analysis.name}"
    method.__doc__ = f"{analysis.summary}.\n\n{analysis.description}"
    method.__annotations__ |= {
        "request": analysis.request | Mapping[str, Any],
        "return": analysis.result,
    }
    return method


for _analysis in registry.every():
    setattr(Client, _analysis.name, _method(_analysis))


class BatchItem(BaseModel):
    """One item of a batch: its place in it, and its result or its error."""

    index: int
    result: TuningResult | None = None
    error: Problem | None = None


class _Recovery:
    """Swallows what a restart of the service causes, for a minute."""

    def __init__(self) -> None:
        self.succeeded()

    def succeeded(self) -> None:
        """Begin the minute anew."""
        self._deadline = time.monotonic() + _PATIENCE

    def __enter__(self) -> None:
        pass

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: object
    ) -> bool:
        if isinstance(error, ServiceError):
            passing = error.status in _TRANSIENT
        else:
            passing = isinstance(error, httpx.TransportError)
        if not passing:
            return False
        if time.monotonic() > self._deadline:
            raise ServiceUnreachableError(str(error)) from error
        return True


class _Event(BaseModel):
    """Data of a progress event."""

    progress: JobProgress


def _document(request: BaseModel | Mapping[str, Any]) -> object:
    return request.model_dump(mode="json") if isinstance(request, BaseModel) else dict(request)


def _check(response: httpx.Response) -> None:
    if not response.is_error:
        return
    problem = None
    if response.headers.get("content-type", "").startswith(MEDIA_TYPE):
        try:
            problem = Problem.model_validate_json(response.content)
        except ValidationError:  # a proxy's idea of a problem
            problem = None
    raise ServiceError(response.status_code, problem)


def _parse(lines: Iterable[str]) -> Iterator[tuple[str, str]]:
    """Yield name and data of server-sent events."""
    event = ""
    for line in lines:
        name, _, value = line.partition(": ")
        if name == "event":
            event = value
        elif name == "data":
            yield event, value
