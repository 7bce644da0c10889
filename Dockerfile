# docker build -t perch-hil .
# docker run --rm -it --shm-size=512m -v "$PWD/runs:/home/crew/runs" perch-hil run simple-i --live
FROM python:3.11-slim AS wheel
WORKDIR /source
COPY . .
RUN pip wheel --no-cache-dir --no-deps -w /wheels .

FROM python:3.11-slim
COPY constraints.txt /constraints.txt
RUN --mount=type=bind,from=wheel,source=/wheels,target=/wheels \
    pip install --no-cache-dir -c /constraints.txt /wheels/*.whl
RUN useradd --create-home crew
USER crew
WORKDIR /home/crew
RUN mkdir runs && perch-hil run hard-i --out /tmp/warm || test $? -eq 1; rm -rf /tmp/warm
ENTRYPOINT ["perch-hil"]
CMD ["run", "hard-i"]
