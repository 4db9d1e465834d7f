# SPDX-License-Identifier: Apache-2.0
# The HTTP service and MQTT, on a CPU, without a compiler and as a user without rights: docs/container.md.
FROM python:3.12-slim-bookworm AS build
SHELL ["/bin/bash", "-o", "pipefail", "-c"]
ENV PIP_DISABLE_PIP_VERSION_CHECK=1 PIP_NO_CACHE_DIR=1 PIP_ROOT_USER_ACTION=ignore
WORKDIR /source
COPY tools/release.lock tools/release.lock
# What builds the wheel stays in this stage.
RUN sed -n '/^setuptools==/,/[^\\]$/p' tools/release.lock > /tmp/build.lock \
 && python -m pip install --require-hashes -r /tmp/build.lock
COPY requirements-container.lock ./
RUN python -m venv /opt/doorstate \
 && /opt/doorstate/bin/python -m pip install --require-hashes -r requirements-container.lock
COPY pyproject.toml README.md LICENSE ./
COPY src src
RUN python -m pip wheel --no-deps --no-build-isolation --wheel-dir /tmp/wheels . \
 && /opt/doorstate/bin/python -m pip install --no-deps /tmp/wheels/*.whl \
 && /opt/doorstate/bin/python -m compileall -q /opt/doorstate/lib

FROM python:3.12-slim-bookworm
LABEL org.opencontainers.image.source="https://github.com/doorstate/doorstate" \
      org.opencontainers.image.licenses="Apache-2.0"
RUN useradd --uid 10001 --user-group --no-create-home --shell /usr/sbin/nologin doorstate
COPY --from=build /opt/doorstate /opt/doorstate
ENV PATH=/opt/doorstate/bin:$PATH PYTHONDONTWRITEBYTECODE=1 PYTHONUNBUFFERED=1
USER 10001:10001
WORKDIR /tmp
EXPOSE 8000
# Of the service; a container that publishes on MQTT says by its availability topic how it is.
HEALTHCHECK --interval=30s --timeout=5s --start-period=60s --retries=3 \
  CMD ["python", "-c", "import urllib.request; urllib.request.urlopen('http://127.0.0.1:8000/health', timeout=4)"]
ENTRYPOINT ["doorstate"]
CMD ["serve", "--host", "0.0.0.0", "--port", "8000"]
