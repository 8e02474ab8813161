# Airflock with its live page. It was not built where it was written: no container can run there.
#
#   docker build -t airflock .
#   docker run --rm -v "$PWD:/data" airflock run vasarhelyi_2018/4ms --plot flight.png
#   docker run --rm -p 8080:8080 airflock watch vasarhelyi_2018/obstacles --host 0.0.0.0 --port 8080
FROM python:3.12-slim
COPY . /source
RUN pip install --no-cache-dir '/source[scenes,video,evolve,fly,logs]' && rm -rf /source \
    && useradd --create-home pilot && mkdir /data && chown pilot /data
USER pilot
WORKDIR /data
# Compiled drivers stay with the container; `-v airflock:/home/pilot/.cache` keeps them between runs.
ENTRYPOINT ["airflock"]
CMD ["--help"]
