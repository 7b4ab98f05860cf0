# The server and the command-line client, without GPU code. From the repository's root:
#   docker build -f deploy/container/server.Dockerfile -t guardsplat-server .
FROM rust:1.95-bookworm AS build
WORKDIR /src
COPY . .
RUN cargo build --release --locked -p guardsplat-server -p guardsplat-client

FROM debian:bookworm-slim
# Certificates of public authorities, for databases, stores and collectors that are reached with TLS.
RUN apt-get update \
    && apt-get install -y --no-install-recommends ca-certificates \
    && rm -rf /var/lib/apt/lists/* \
    && useradd --system --uid 10001 --home-dir /var/lib/guardsplat --create-home guardsplat
COPY --from=build /src/target/release/guardsplat-server /src/target/release/guardsplat /usr/local/bin/
USER 10001
# There is no worker in this image. Who may come in is for whoever runs it to say: without GUARDSPLAT_ACCESS the server
# does not start on an address that others can reach.
ENV GUARDSPLAT_DATA_DIR=/var/lib/guardsplat \
    GUARDSPLAT_LISTEN=0.0.0.0:50051 \
    GUARDSPLAT_METRICS_LISTEN=0.0.0.0:9464 \
    GUARDSPLAT_EMBEDDED_WORKER=false \
    GUARDSPLAT_LOG_FORMAT=json
VOLUME /var/lib/guardsplat
EXPOSE 50051 9464
ENTRYPOINT ["guardsplat-server"]
