# docker build -t rcopterx .     (podman build works the same way)
FROM python:3.11-slim AS build
WORKDIR /source
COPY . .
RUN pip wheel --no-cache-dir --no-deps --wheel-dir /wheels .

FROM python:3.11-slim
COPY --from=build /wheels /wheels
# The group opens serial devices; numbers of groups differ between computers, see docs/container.md.
RUN pip install --no-cache-dir "$(ls /wheels/*.whl)[ground]" \
    && rm -r /wheels \
    && useradd --create-home --groups dialout lab
USER lab
WORKDIR /home/lab
# For the kind of processor on which the image is built; on others the first start compiles.
RUN python -m rcopterx.compiling
# Router, web page.
EXPOSE 7447 8080
ENTRYPOINT ["rcopterx"]
CMD ["demo", "--no-browser"]
