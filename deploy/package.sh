#!/usr/bin/env bash
# Debian packages of client, server and worker, in target/debian, and what is in them tried: files, man pages, programs
# from an empty root. cargo-deb is built once, pinned, and kept below target/.
#
#     deploy/package.sh
#
# The packages' maintainer is whoever builds them: DEBFULLNAME and DEBEMAIL, as for Debian's own tools.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
source deploy/setup.sh
VERSION=3.8.0
# Where the manifests say that what goes into packages is.
target=$PWD/target
tools=$target/cargo-deb-$VERSION
programs=(guardsplat guardsplat-server guardsplat-worker guardsplat-credentials)
crates=(guardsplat-client guardsplat-server guardsplat-worker)

maintainer="${DEBFULLNAME:-$(id -un)} <${DEBEMAIL:-$(id -un)@$(uname -n)}>"

setup
command -v dpkg-deb >/dev/null || { echo "package: dpkg-deb was not found; this is for Debian and Ubuntu" >&2; exit 1; }
command -v dpkg-shlibdeps >/dev/null || install_packages dpkg-dev
[ -x "$tools/bin/cargo-deb" ] ||
    cargo install --quiet --locked --root "$tools" --target-dir "$tools/build" "cargo-deb@$VERSION"
# All of the workspace: with fewer packages burn would be built a second time.
cargo build --release --workspace --locked --target-dir "$target"
CARGO_TARGET_DIR=$target bash deploy/credentials.sh build

rm -rf "$target/package" "$target/debian"
mkdir -p "$target/package/completions"
for program in "${programs[@]}"; do
    "$target/release/$program" manual "$target/package/man/$program"
    for shell in bash zsh fish; do
        "$target/release/$program" completions "$shell" >"$target/package/completions/$program.$shell"
    done
done
for crate in "${crates[@]}"; do
    CARGO_TARGET_DIR=$target "$tools/bin/cargo-deb" deb --quiet --locked --no-build --package "$crate" \
        --maintainer "$maintainer" --output "$target/debian/"
done

# From here on as whoever is given the packages.
root=$(mktemp -d)
trap 'rm -rf "$root"' EXIT
for package in "$target"/debian/*.deb; do
    dpkg-deb --extract "$package" "$root"
    told=$(dpkg-deb --field "$package" Maintainer)
    [ "$told" = "$maintainer" ] || { echo "package: $package names $told, not $maintainer" >&2; exit 1; }
done
for program in "${programs[@]}"; do
    "$root/usr/bin/$program" --version
    for file in "man/man1/$program.1.gz" "bash-completion/completions/$program" \
        "zsh/vendor-completions/_$program" "fish/vendor_completions.d/$program.fish"; do
        [ -s "$root/usr/share/$file" ] || { echo "package: no package has /usr/share/$file" >&2; exit 1; }
    done
    # shellcheck source=/dev/null
    (source "$root/usr/share/bash-completion/completions/$program" && complete -p "$program" >/dev/null)
done
for file in /etc/guardsplat/server.toml /usr/lib/systemd/system/guardsplat-{server,worker}.service \
    /usr/lib/sysusers.d/guardsplat-{server,worker}.conf; do
    [ -s "$root$file" ] || { echo "package: no package has $file" >&2; exit 1; }
done
if command -v groff >/dev/null; then
    for page in "$root"/usr/share/man/man1/*.gz; do
        warnings=$(gunzip -c "$page" | groff -man -Tutf8 -z -ww 2>&1)
        [ -z "$warnings" ] || { echo "package: $page: $warnings" >&2; exit 1; }
    done
fi
du -h "$target"/debian/*.deb
