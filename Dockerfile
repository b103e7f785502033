# docker build -t towval . && docker run --rm -v "$PWD:/work" towval run lab_a
FROM python:3.12-slim
COPY . /tmp/towval
RUN pip install --no-cache-dir /tmp/towval && rm -rf /tmp/towval
# Compiled solvers and Snakemake's own files: a folder that any user may write to.
ENV HOME=/tmp NUMBA_CACHE_DIR=/tmp/numba MPLCONFIGDIR=/tmp/matplotlib
WORKDIR /work
ENTRYPOINT ["towval"]
CMD ["--help"]
