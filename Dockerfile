# The compiler stays behind: of this stage only the services are taken, with what is compiled of them.
FROM python:3.11-slim-bookworm AS kernels
RUN apt-get update && apt-get install --yes --no-install-recommends make gcc libc6-dev && rm -rf /var/lib/apt/lists/*
WORKDIR /app
COPY Makefile ./
COPY services ./services
RUN make kernels

FROM python:3.11-slim-bookworm

ENV PYTHONDONTWRITEBYTECODE=1 \
    PYTHONUNBUFFERED=1 \
    PIP_NO_CACHE_DIR=1 \
    HOST=0.0.0.0 \
    PORT=8000 \
    DATA_DIR=/data

# Beside the compiler's, the only step that is not one of the Makefile's: it brings make.
RUN apt-get update && apt-get install --yes --no-install-recommends make && rm -rf /var/lib/apt/lists/*

WORKDIR /app

# Before the sources, so that a change of code does not install everything again.
COPY Makefile requirements.lock ./
# docker build --build-arg LANGUAGES="fra deu": what is read besides English.
ARG LANGUAGES=""
RUN make system-packages LANGUAGES="$LANGUAGES"
# docker build --build-arg HEIC=without: nothing under the GPL to encode HEVC, and no photos in HEIC.
ARG HEIC="with"
# docker build --build-arg SECOND_READER=without: 115 MB less; receipts and other poor pages are read worse.
ARG SECOND_READER="with"
RUN make venv HEIC="$HEIC" SECOND_READER="$SECOND_READER" KERNELS=without

COPY LICENSE NOTICE deploy/licences.md deploy/sbom.cdx.json ./
COPY app ./app
COPY models ./models
COPY --from=kernels /app/services ./services

RUN make data-folder
USER 10001:10001
VOLUME /data
EXPOSE 8000

HEALTHCHECK --interval=10s --timeout=3s --start-period=30s --retries=3 \
    CMD [".venv/bin/python", "-c", "import os, urllib.request; urllib.request.urlopen('http://127.0.0.1:' + os.environ['PORT'] + '/health/live', timeout=2)"]

# Python itself is process 1, so that SIGTERM reaches it: it finishes what is in flight.
CMD [".venv/bin/python", "-m", "app"]
