#!/usr/bin/env bash
# Installs what a fresh Debian 12 lacks, and nothing that is there already.
#   tools/setup.sh [run] [test] [shaders] [prepare] [player] [play] [manual] [cluster] [mpi]      default: run
#     run      the Vulkan loader, Mesa's drivers (lavapipe among them), a linker, a Rust toolchain
#     test     run, and the validation layer, spirv-val, rustfmt, clippy
#     shaders  run, and what shaderc's C++ needs to build (only for `cargo build --features shaders`)
#     prepare  run, and the programs that `ivv prepare` calls: ffmpeg, COLMAP, OpenCV for Python
#     player   run, and what the tests of the browser player need: Chromium, node, packages of npm, the .4dgs package for Python
#     play     run, and what `ivv-play` needs to build and to open windows, and its tests: a display in memory, keys and pointer
#     manual   run, and what builds the manual and its commands need: mdBook, ffmpeg, Python
#     cluster  run, and what the jobs of a long clip are tested with: Snakemake, Slurm
#     mpi      run, and what `cargo build --features mpi` and `mpirun` need: Open MPI, libclang
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
export PATH="${CARGO_HOME:-$HOME/.cargo}/bin:$PATH"

say() { printf 'setup: %s\n' "$*"; }
# fail KIND WHAT REMEDY
fail() {
    printf 'setup: failed (%s): %s\nsetup: remedy: %s\n' "$1" "$2" "$3" >&2
    exit 1
}

as_root() {
    if [ "$(id -u)" -eq 0 ]; then
        "$@"
    elif command -v sudo >/dev/null; then
        sudo "$@"
    else
        fail permission "root is needed for: $*" "run it as root, or install sudo"
    fi
}

# Of the packages given, those that are not installed. dpkg-query fails when one is unknown to it: that is an answer too.
missing_packages() {
    local installed package
    installed=" $({ dpkg-query -W -f='${db:Status-Status} ${Package}\n' "$@" 2>/dev/null || true; } |
        sed -n 's/^installed //p' | tr '\n' ' ') "
    for package in "$@"; do
        [[ $installed == *" $package "* ]] || printf '%s\n' "$package"
    done
}

install_packages() {
    if ! command -v dpkg-query >/dev/null || ! command -v apt-get >/dev/null; then
        say "this is not Debian; going on in the hope that its counterparts of these are installed: $*"
        return
    fi
    local missing
    mapfile -t missing < <(missing_packages "$@")
    [ ${#missing[@]} -gt 0 ] || return 0
    say "installing ${missing[*]}"
    as_root apt-get -q update ||
        fail network "apt-get update" "check the network and /etc/apt/sources.list, then run this again"
    as_root env DEBIAN_FRONTEND=noninteractive apt-get install -q -y --no-install-recommends "${missing[@]}" ||
        fail packages "apt-get install ${missing[*]}" "read apt's message above, then run this again"
}

# The toolchain that Cargo.toml asks for, as major.minor.
wanted_rust() { sed -n 's/^rust-version *= *"\([0-9.]*\)".*/\1/p' Cargo.toml; }

# cargo's version, empty where there is none. `cargo --version` alone also fails for a rustup without a toolchain.
found_rust() { cargo --version 2>/dev/null | cut -d' ' -f2 || true; }

# at_least FOUND WANTED
at_least() { [ -n "$1" ] && [ "$(printf '%s\n%s\n' "$2" "$1" | sort -V | head -n 1)" = "$2" ]; }

install_rust() {
    local wanted found
    wanted=$(wanted_rust)
    found=$(found_rust)
    [ -n "$wanted" ] || fail project "Cargo.toml has no rust-version" "check the clone"
    if at_least "$found" "$wanted"; then
        return
    fi
    if command -v rustup >/dev/null; then
        say "cargo ${found:-is missing}, $wanted or newer is needed: asking rustup for its stable toolchain"
        rustup toolchain install stable --profile minimal ||
            fail network "rustup toolchain install stable" "check the network, then run this again"
        at_least "$(found_rust)" "$wanted" ||
            fail toolchain "the default toolchain is still older than $wanted" "rustup default stable"
        return
    fi
    say "cargo ${found:-is missing}, $wanted or newer is needed: installing Rust from https://sh.rustup.rs into ~/.cargo"
    install_packages ca-certificates curl
    curl --proto '=https' --tlsv1.2 --retry 3 -sSf https://sh.rustup.rs |
        sh -s -- -y --profile minimal --default-toolchain stable --no-modify-path ||
        fail network "https://sh.rustup.rs" "check the network, or install Rust $wanted or newer by other means"
    at_least "$(found_rust)" "$wanted" || fail toolchain "cargo is still older than $wanted" "see https://rustup.rs"
    say "the scripts find ~/.cargo/bin by themselves; for your own shell: source ~/.cargo/env"
}

install_components() {
    local missing=()
    cargo fmt --version >/dev/null 2>&1 || missing+=(rustfmt)
    cargo clippy --version >/dev/null 2>&1 || missing+=(clippy)
    [ ${#missing[@]} -gt 0 ] || return 0
    if ! command -v rustup >/dev/null; then
        say "${missing[*]} not found; only .ci/run needs them"
        return
    fi
    say "installing ${missing[*]}"
    rustup component add "${missing[@]}" ||
        fail network "rustup component add ${missing[*]}" "check the network, then run this again"
}

# Below the cache folder, where `tools/test.sh --player` and the tests of .4dgs look.
install_player_packages() {
    local folder=${XDG_CACHE_HOME:-$HOME/.cache}/ivv/player
    mkdir -p "$folder"
    cp tests/player/package.json tests/player/package-lock.json "$folder/"
    npm ci --prefix "$folder" --no-audit --no-fund --silent ||
        fail network "npm ci" "check the network, then run this again"
    pip_install "$folder/python" fourdgs==0.6.0
}

# pip_install FOLDER PACKAGE: into an environment of its own.
pip_install() {
    [ -x "$1/bin/python" ] || python3 -m venv "$1"
    "$1/bin/python" -m pip install --quiet "$2" || fail network "pip install $2" "check the network, then run this again"
}

# Below the cache folder, where `tools/manual.sh` looks. Two minutes of two cores, once.
install_mdbook() {
    local version=0.5.4 folder=${XDG_CACHE_HOME:-$HOME/.cache}/ivv/manual
    [ "$("$folder/bin/mdbook" --version 2>/dev/null || true)" != "mdbook v$version" ] || return 0
    say "building mdBook $version"
    cargo install mdbook --locked --version "$version" --no-default-features --features search --root "$folder" --quiet ||
        fail network "cargo install mdbook" "check the network, then run this again"
}

# Below the cache folder, where `tools/test.sh --cluster` looks.
install_snakemake() {
    local version=9.27.1 folder=${XDG_CACHE_HOME:-$HOME/.cache}/ivv/cluster
    [ "$("$folder/bin/snakemake" --version 2>/dev/null || true)" != "$version" ] || return 0
    say "installing Snakemake $version"
    pip_install "$folder" "snakemake==$version"
}

packages=(libvulkan1 mesa-vulkan-drivers gcc libc6-dev)
further=()
for part in "${@:-run}"; do
    case $part in
    run) ;;
    test) packages+=(vulkan-validationlayers spirv-tools) further+=(install_components) ;;
    shaders) packages+=(cmake g++ python3 make git) ;;
    prepare) packages+=(ffmpeg colmap python3-opencv) ;;
    player)
        packages+=(chromium python3-venv)
        command -v node >/dev/null || packages+=(nodejs npm)
        further+=(install_player_packages)
        ;;
    play)
        # ALSA's headers for sound; the rest is loaded when a window opens.
        packages+=(libasound2-dev pkg-config libx11-6 libx11-xcb1 libxcursor1 libxi6 libxrandr2 libxkbcommon-x11-0)
        packages+=(xvfb xdotool vulkan-validationlayers)
        ;;
    manual) packages+=(ffmpeg python3) further+=(install_mdbook) ;;
    mpi) packages+=(openmpi-bin libopenmpi-dev libclang-dev) ;;
    cluster) packages+=(python3-venv slurmctld slurmd slurm-client munge) further+=(install_snakemake) ;;
    *)
        echo "usage: tools/setup.sh [run] [test] [shaders] [prepare] [player] [play] [manual] [cluster] [mpi]" >&2
        exit 2
        ;;
    esac
done
install_packages "${packages[@]}"
install_rust
for install in "${further[@]}"; do "$install"; done
say "ready (${*:-run})"
