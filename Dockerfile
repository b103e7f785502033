# docker build -t towval . && docker run --rm --user "$(id -u):$(id -g)" -v "$PWD:/work" towval run lab_a
FROM python:3.12-slim
COPY . /tmp/towval
RUN pip install --no-cache-dir /tmp/towval && rm -rf /tmp/towval
# Compiled solvers and settings: folders that any user may write to. What root cached for itself goes.
ENV HOME=/tmp NUMBA_CACHE_DIR=/tmp/numba MPLCONFIGDIR=/tmp/matplotlib
RUN mkdir /tmp/warm && cd /tmp/warm && towval demo && rm -r /tmp/warm /tmp/.cache && chmod -R a+rwX /tmp/numba /tmp/matplotlib
WORKDIR /work
ENTRYPOINT ["towval"]
CMD ["--help"]
