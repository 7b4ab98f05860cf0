# A worker, with the loader of Vulkan and Mesa's drivers. From the repository's root:
#   docker build -f deploy/container/worker.Dockerfile -t guardsplat-worker .
FROM rust:1.95-bookworm AS build
WORKDIR /src
COPY . .
RUN cargo build --release --locked -p guardsplat-worker

FROM debian:bookworm-slim
# NVIDIA's driver comes from the machine, by its container toolkit, and wants libX11, libXext and libEGL beside the
# loader. Mesa has the drivers of AMD and Intel, and one that computes on the CPU.
RUN apt-get update \
    && apt-get install -y --no-install-recommends \
        ca-certificates libegl1 libvulkan1 libx11-6 libxext6 mesa-vulkan-drivers \
    && rm -rf /var/lib/apt/lists/* \
    && useradd --system --uid 10001 --home-dir /var/lib/guardsplat --create-home guardsplat
COPY --from=build /src/target/release/guardsplat-worker /usr/local/bin/
USER 10001
# What is downloaded once, such as the weights of CLIP, and the files of jobs under way.
ENV GUARDSPLAT_HOME=/var/lib/guardsplat \
    NVIDIA_DRIVER_CAPABILITIES=graphics,compute,utility
VOLUME /var/lib/guardsplat
ENTRYPOINT ["guardsplat-worker"]
CMD ["run", "--server", "http://guardsplat-server:50051", "--device", "wgpu"]
