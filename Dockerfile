# The service, and with another command the worker or the command line.
FROM python:3.11-slim AS build
ENV PIP_DISABLE_PIP_VERSION_CHECK=1 PIP_NO_CACHE_DIR=1
WORKDIR /source
RUN python -m venv /opt/mutune
COPY requirements/run.txt requirements/
RUN /opt/mutune/bin/pip install --require-hashes -r requirements/run.txt
COPY pyproject.toml README.md LICENSE ./
COPY mutune mutune
COPY solver solver
COPY service service
COPY examples examples
RUN /opt/mutune/bin/pip install --no-deps --no-build-isolation .

FROM python:3.11-slim
RUN useradd --system --uid 10001 --user-group --create-home --home-dir /var/lib/mutune mutune \
    && chmod 0700 /var/lib/mutune
COPY --from=build /opt/mutune /opt/mutune
ENV PATH=/opt/mutune/bin:$PATH \
    PYTHONUNBUFFERED=1 \
    PYTHONDONTWRITEBYTECODE=1 \
    OPENBLAS_NUM_THREADS=1 \
    MUTUNE_DATA_DIR=/var/lib/mutune \
    MUTUNE_API_KEYS_FILE=/var/lib/mutune/keys
# Beside the modules, where any user reads the compiled kernels and nobody can change them.
RUN env -u PYTHONDONTWRITEBYTECODE python -m solver.warm
USER mutune
WORKDIR /var/lib/mutune
VOLUME /var/lib/mutune
EXPOSE 8000
HEALTHCHECK --interval=30s --timeout=5s --start-period=30s \
    CMD ["python", "-c", "import urllib.request; urllib.request.urlopen('http://127.0.0.1:8000/healthz', timeout=4)"]
CMD ["mutune", "serve", "--host", "0.0.0.0", "--port", "8000"]
