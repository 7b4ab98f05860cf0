# Sourced by the other scripts: installs what the build and the tests need and is missing, and checks the toolchain.
# Debian and Ubuntu packages are installed by name; elsewhere it says what is missing.

# Whether some Vulkan driver is installed: the loader finds drivers by their manifests in these folders.
has_vulkan_driver() {
    [ -n "${VK_DRIVER_FILES:-${VK_ICD_FILENAMES:-}}" ] && return 0
    local folder manifest
    for folder in /etc/vulkan/icd.d /usr/local/etc/vulkan/icd.d /usr/share/vulkan/icd.d /usr/local/share/vulkan/icd.d; do
        for manifest in "$folder"/*.json; do
            [ -e "$manifest" ] && return 0
        done
    done
    return 1
}

has_vulkan_loader() {
    local ldconfig
    ldconfig=$(PATH="$PATH:/sbin:/usr/sbin" command -v ldconfig) || return 1
    # No pipe: grep -q would close it early, which counts as a failure under pipefail.
    case "$("$ldconfig" -p)" in
        *libvulkan.so.1*) return 0 ;;
        *) return 1 ;;
    esac
}

# Installs packages; fails where that is not possible.
install_packages() {
    local as_root=()
    command -v apt-get >/dev/null || return 1
    if [ "$(id -u)" -ne 0 ]; then
        command -v sudo >/dev/null || return 1
        as_root=(sudo)
    fi
    echo "setup: installing $*"
    "${as_root[@]}" apt-get update -qq &&
        "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "$@"
}

has_postgresql() {
    local initdb
    for initdb in "$(type -P initdb)" /usr/lib/postgresql/*/bin/initdb; do
        [ -x "$initdb" ] && return 0
    done
    return 1
}

# What only the tests need: npm for the check of the protos, Python for a client of another language, and kill as a
# program, which a shell has built in, for tests that send signals. Without the first two those checks are skipped,
# unless CI is set. The fuzzer is C++; a C compiler may be there without one for that. Of PostgreSQL the tests
# use the programs only, and start clusters of their own.
setup_tests() {
    local missing=()
    command -v npm >/dev/null || missing+=(npm)
    command -v c++ >/dev/null || missing+=(g++)
    type -P kill >/dev/null || missing+=(procps)
    # Pages of evidence are looked at in a browser, and the page of the server is used in one.
    type -P chromium >/dev/null || missing+=(chromium)
    # AVIF, one of the codecs that pictures go through.
    command -v avifenc >/dev/null || missing+=(libavif-bin)
    # Looks at the units in deploy/systemd.
    command -v systemd-analyze >/dev/null || missing+=(systemd)
    has_postgresql || missing+=(postgresql)
    # The interpreter may be there without what makes an environment of its own.
    python3 -c 'import venv, ensurepip' 2>/dev/null || missing+=(python3 python3-venv)
    if [ "${#missing[@]}" -gt 0 ] && ! install_packages "${missing[@]}"; then
        echo "setup: could not install what some tests need (Debian's packages: ${missing[*]})" >&2
        [ -z "${CI:-}" ]
    fi
}

setup() {
    local missing=()
    command -v cc >/dev/null || missing+=(build-essential pkg-config ca-certificates)
    has_vulkan_driver || missing+=(mesa-vulkan-drivers)
    has_vulkan_loader || missing+=(libvulkan1)
    if [ "${#missing[@]}" -gt 0 ] && ! install_packages "${missing[@]}"; then
        echo "setup: could not install what is missing (Debian's packages: ${missing[*]})" >&2
        if ! command -v cc >/dev/null; then
            echo "setup: nothing can be built without a C compiler" >&2
            return 1
        fi
        echo "setup: without a Vulkan driver and loader only --device cpu works" >&2
    fi
    if ! command -v cargo >/dev/null && [ -x "${CARGO_HOME:-$HOME/.cargo}/bin/cargo" ]; then
        export PATH="${CARGO_HOME:-$HOME/.cargo}/bin:$PATH"
    fi
    if ! command -v cargo >/dev/null; then
        echo "setup: cargo was not found; install Rust 1.95 or later (https://rustup.rs) and run this again" >&2
        return 1
    fi
}
